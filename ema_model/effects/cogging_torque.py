"""Cogging: the magnets' pull toward the stator's teeth, with or without current."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, NEITHER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, amplitude, order, phase):
    """A sin(hθ + φ), added."""
    return torque + amplitude * sine(order * theta + phase)


EFFECT = Effect(
    title="Cogging torque",
    equation="T = A sin(h θ + φ)",
    source="Hanselman, Brushless Permanent Magnet Motor Design, 2003, ch. 10",
    explanation=(
        "The rotor's magnets pull toward the iron teeth between the stator's slots, so the unpowered rotor clicks "
        "from one preferred angle to the next. The torque repeats a fixed number of times in each turn — a multiple "
        "of the slots or of the poles — and does not depend on the current. The controller must fight it, "
        "and the current shows it against the motor's angle."
    ),
    parameters=(
        Parameter("amplitude_Nm", "amplitude A", 0.012, 0.0, 0.3, side=MOTOR, linear=(10.0, 0.0, 1e4)),
        Parameter(
            "order",
            "periods h in each turn of the motor",
            12.0,
            1.0,
            96.0,
            integer=True,
            per=MOTOR,
            linear=(200.0, 1.0, 20000.0),
        ),
        Parameter("phase_rad", "phase φ", 0.0, -math.pi, math.pi, side=NEITHER),
    ),
    severities=(0.006, 0.012, 0.024),
    places=(shaft_torque,),
    shows="periodic in the motor angle, at any current",
    against="motor_angle",
    mistaken_for="eccentricity, torque ripple",
    family="electrics",
)
