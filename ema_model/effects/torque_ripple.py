"""Torque ripple: the motor's torque per ampere is not the same at every angle."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, NEITHER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar

_QUARTER = 0.5 * math.pi


@scalar
def electric_torque(torque, theta, omega, current, ratio, order, phase):
    """T_m [1 + a cos(hθ + φ)]."""
    return torque * (1.0 + ratio * sine(order * theta + (phase + _QUARTER)))


EFFECT = Effect(
    title="Torque ripple",
    equation="T_m = k_t I [1 + a cos(h θ + φ)]",
    source="Jahns, Soong, Pulsating torque minimization for PM AC drives, IEEE Trans. Ind. Electron. 43, 1996",
    explanation=(
        "A real motor's windings and magnets do not give the pure sine waves that the drive counts on, so the same "
        "current makes more torque at some angles than at others. The ripple repeats a fixed number of times in "
        "each turn like cogging, but it is in proportion to the current: without current there is none."
    ),
    parameters=(
        Parameter("ratio", "amplitude a, per mean torque", 0.06, 0.0, 0.9, plausible=(0.0, 0.5)),
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
    severities=(0.03, 0.06, 0.12),
    places=(electric_torque,),
    shows="in the current, periodic in the motor angle and in proportion to the current",
    against="motor_angle",
    mistaken_for="short circuit, eccentricity, cogging torque",
    family="electrics",
)
