"""A constant torque at the user: a weight on a rope, a preload, a spring that hardly moves."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, recorded, time, load):
    """− τ T_0, added."""
    return torque - gear * load


EFFECT = Effect(
    title="Constant load",
    equation="T = − τ T_0",
    source="Battaglia (Politecnico di Torino), eq. 3.13: the load in the rotor's balance",
    explanation=(
        "Something pulls at the user with the same torque all the time: a weight, a preload, the wind. It opposes "
        "the motion one way and helps it the other, so the motor's mean current is off zero even at rest."
    ),
    parameters=(
        Parameter(
            "torque_Nm",
            "torque T_0, positive opposes positive motion",
            6.0,
            -1e6,
            1e6,
            side=USER,
            linear=(100.0, -1e6, 1e6),
        ),
    ),
    severities=(3.0, 6.0, 12.0),
    places=(shaft_torque,),
    shows="as a constant offset of the current",
    against="motor_speed",
    mistaken_for="current sensor bias",
    family="mechanics",
    duplicates="sensors.current_bias_A",
    is_load=True,
)
