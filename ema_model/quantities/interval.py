"""Intervals as they are told: each holds 90 %."""

HALF_90 = 1.645  # σ of a normal distribution, on either side
