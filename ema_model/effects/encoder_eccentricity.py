"""Encoder eccentricity: a code disc that sits off its centre reads ahead and behind once in each turn of the motor."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, NEITHER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar

_QUARTER = 0.5 * math.pi


@scalar
def motor_angle_reading(theta, amplitude, phase):
    """θ + A sin(θ + φ)."""
    return theta + amplitude * sine(theta + phase)


@scalar
def motor_speed_reading(omega, theta, amplitude, phase):
    """ω [1 + A cos(θ + φ)]."""
    return omega + amplitude * omega * sine(theta + phase + _QUARTER)


EFFECT = Effect(
    title="Encoder eccentricity",
    equation="θ_read = θ + A sin(θ + φ), ω_read = ω [1 + A cos(θ + φ)]",
    source="a disc of radius r that sits e off the axis: A = e/r; Hanselman, IEEE Trans. Ind. Electron. 37(6), 1990",
    explanation=(
        "The motor's encoder disc, or its magnet, does not sit exactly on the shaft's axis. It then reads a little "
        "ahead over one half of a turn and behind over the other. The speed that is computed from it swings with each "
        "turn as well, and the speed loop answers with a current that no torque asked for."
    ),
    parameters=(
        Parameter(
            "amplitude_rad",
            "amplitude A at the motor, eccentricity over radius",
            5e-3,
            0.0,
            0.1,
            side=MOTOR,
            linear=(1e-5, 0.0, 1e-2),
        ),
        Parameter("phase_rad", "phase φ", 0.0, -math.pi, math.pi, side=NEITHER),
    ),
    severities=(2e-3, 5e-3, 1e-2),
    places=(motor_angle_reading, motor_speed_reading),
    shows="in the motor's angle and speed, once in each turn, growing with the speed in the current",
    against="motor_angle",
    mistaken_for="screw lead error, cogging torque of order 1",
    family="sensor",
    turns=MOTOR,
)
