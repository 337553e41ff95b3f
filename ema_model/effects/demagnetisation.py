"""Demagnetisation: weaker magnets give less torque per ampere, and less back-EMF."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def electric_torque(torque, theta, omega, current, ratio):
    """T_m (1 − d)."""
    return torque * (1.0 - ratio)


@scalar
def back_emf(emf, omega, current, gain, most, ratio):
    """E (1 − d)."""
    return emf * (1.0 - ratio)


EFFECT = Effect(
    title="Demagnetisation",
    equation="T_m = (1 − d) k_t I, E = (1 − d) k_t ω",
    source="Ruoho, Dlala, Arkkio, Comparison of demagnetization models for PM machines, IEEE Trans. Magn. 43(11), 2007",
    explanation=(
        "Heat and strong opposing currents rob permanent magnets of a part of their field. The motor then needs "
        "more current for the same torque, and its voltage at the same speed is lower, which lets it run faster "
        "at the voltage limit. A current sensor that reads too much looks the same but leaves the top speed alone."
    ),
    parameters=(Parameter("ratio", "share d of the flux that is lost", 0.08, 0.0, 0.9, plausible=(0.0, 0.4)),),
    severities=(0.04, 0.08, 0.15),
    places=(electric_torque, back_emf),
    shows="in the current, in proportion to the current; top speed",
    against="current",
    mistaken_for="current sensor gain, short circuit of all phases alike",
    family="electrics",
    duplicates="motor.torque_constant_Nm_A",
    scale=-1.0,
)
