"""What fault parameters mean in one actuator, as an engineer reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator.actuator import Actuator
from ema_model.faults import physical
from ema_model.quantities.numbers import amount
from ema_model.quantities.sides import USER


def readings(k: ArrayLike, actuator: Actuator) -> dict[str, float]:
    """One k as the physical values that an engineer reads, units in the names."""
    p = physical(k)
    return {
        "friction_factor": float(p.friction_factor),
        _backlash(actuator): float(p.backlash_factor * actuator.transmission.backlash_rad),
        "turns_a": float(p.turns[0]),
        "turns_b": float(p.turns[1]),
        "turns_c": float(p.turns[2]),
        "eccentricity": float(p.eccentricity),
        "eccentricity_phase_rad": float(p.phase_rad),
        "position_gain_1_s": float(p.gain_factor * actuator.controller.position_gain_1_s),
    }


def _backlash(actuator: Actuator) -> str:
    return actuator.axes.name("backlash_rad", USER)


def sentences(k: ArrayLike, actuator: Actuator) -> tuple[str, ...]:
    """The same as eight short phrases, one for each k."""
    r = readings(k, actuator)
    return (
        f"friction × {r['friction_factor']:.2f}",
        f"backlash {amount(r[_backlash(actuator)], actuator.axes.unit('rad', USER))}",
        f"phase A: {r['turns_a']:.0%} of turns",
        f"phase B: {r['turns_b']:.0%} of turns",
        f"phase C: {r['turns_c']:.0%} of turns",
        f"eccentricity ζ = {r['eccentricity']:.2f}",
        f"thinnest gap at {round(np.degrees(r['eccentricity_phase_rad'])):+d}°",
        f"gain × {physical(k).gain_factor:.2f}",
    )
