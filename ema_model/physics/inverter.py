"""The inverter's legs (T 3.2.5): a relay with hysteresis about the reference current."""

from __future__ import annotations

from ema_model.physics.jit import scalar


@scalar
def relay(leg, error, half_band):
    """New state of a leg, ±1, from the error of its phase current, A: it switches beyond ±half_band."""
    return 1.0 if error > half_band else (-1.0 if error < -half_band else leg)
