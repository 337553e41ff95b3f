"""Torque saturation: the iron fills up with flux, and each further ampere gives less torque."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def electric_torque(torque, theta, omega, current, saturation):
    """T_m / (1 + s |I|)."""
    return torque / (1.0 + saturation * abs(current))


EFFECT = Effect(
    title="Torque saturation",
    equation="T_m = k_t I / (1 + s |I|)",
    source="Frölich 1881: B = H/(a + b H), the magnetising curve in its simplest form",
    explanation=(
        "At high current the stator's teeth are full of flux, and the torque constant falls. The motor then needs "
        "more current than the model says, the more the harder it works, while at low current both agree. A torque "
        "constant that is wrong altogether is off by the same share at any current."
    ),
    # Iron loses up to a quarter at twice the rated current.  What takes more is no iron's: of a servo with plastic
    # gears it would be 31 %, and its friction grows with load.
    parameters=(
        Parameter(
            "saturation_1_A",
            "share s lost by each ampere",
            0.01,
            0.0,
            1.0,
            plausible=(0.0, 1.0 / 3.0),
            plausible_at="current_A",
        ),
    ),
    severities=(0.005, 0.01, 0.0125),  # the last one takes 22 % of the torque at 22.5 A
    places=(electric_torque,),
    shows="in the current, with its square",
    against="current",
    mistaken_for="demagnetisation, current sensor gain, load-dependent friction",
    family="electrics",
)
