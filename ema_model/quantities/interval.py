"""Intervals as they are told: each holds 90 %."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

HALF_90 = 1.645  # σ of a normal distribution, on either side
IntervalJson = Annotated[list[float], Meta(min_length=2, max_length=2)]  # its lower and its upper end
