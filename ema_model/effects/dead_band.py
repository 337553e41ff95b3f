"""A dead band of the position error, within which the drive does nothing."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def position_error(error, begins, dt, half_width):
    """e − sat(e, ±b)."""
    return error - clamp(error, -half_width, half_width)


EFFECT = Effect(
    title="Dead band",
    equation="e → 0 for |e| ≤ b, else e − b sgn e",
    source="Khalil, Nonlinear Systems, 3rd ed., 2002: the dead zone",
    explanation=(
        "So as not to hunt about the target for ever, and to spare the motor current at rest, position controllers "
        "ignore an error that is small: one to a few steps of the sensor, half a degree in model servos. The actuator "
        "comes to rest anywhere within the band, and turns back only after the command has crossed it. It looks like "
        "play, but a load does not move the output through it freely."
    ),
    parameters=(Parameter("half_width_rad", "half width b", 1e-4, 0.0, 0.1, side=USER, linear=(1e-4, 0.0, 0.1)),),
    severities=(5e-5, 1e-4, 2e-4),
    places=(position_error,),
    shows="in the position at rest and at each turn of a slow motion",
    against="motor_speed",
    mistaken_for="backlash, dry friction, position sensor bias, presliding friction",
    family="drive",
)
