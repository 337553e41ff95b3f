"""What fault parameters mean in one actuator, as an engineer reads them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator.actuator import Actuator
from ema_model.faults import physical
from ema_model.quantities.numbers import Quantity, with_uncertainty
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


def between(k: ArrayLike, interval: ArrayLike, actuator: Actuator) -> tuple[str, ...]:
    """k (8,) and its interval (8, 2) as values in physical units, one phrase for each: 'friction × 1.60 ± 0.02'."""
    k, ends = np.asarray(k, dtype=float), np.asarray(interval, dtype=float).T
    p, low, high = physical(k), physical(ends[0]), physical(ends[1])
    play = actuator.transmission.backlash_rad
    unit = actuator.axes.unit("rad", USER)
    half = 0.5 * play * abs(float(high.backlash_factor) - float(low.backlash_factor))
    phrases = [
        f"friction × {_within(p.friction_factor, low.friction_factor, high.friction_factor)}",
        f"backlash {with_uncertainty(play * float(p.backlash_factor), half, unit)}",
    ]
    for phase, *values in zip("ABC", p.turns, low.turns, high.turns):
        phrases.append(f"phase {phase}: {_within(*(100.0 * float(one) for one in values))} % of turns")
    phrases.append(f"eccentricity ζ = {_within(p.eccentricity, low.eccentricity, high.eccentricity)}")
    angles = [float(np.degrees(one)) for one in (p.phase_rad, low.phase_rad, high.phase_rad)]
    phrases.append(f"thinnest gap at {_within(*angles)}°")
    phrases.append(f"gain × {_within(p.gain_factor, low.gain_factor, high.gain_factor)}")
    return tuple(phrases)


def _within(value: ArrayLike, low: ArrayLike, high: ArrayLike) -> str:
    """'1.60 ± 0.02': half the width with two digits, the value with as many decimals."""
    at, bottom, top = (float(np.asarray(one)) for one in (value, low, high))
    half = 0.5 * abs(top - bottom)
    decimals = 3 if half < 5e-4 else min(3, max(0, 1 - int(np.floor(np.log10(half)))))
    return f"{at:.{decimals}f} ± {max(half, 0.5 * 10.0**-decimals):.{decimals}f}".replace("-", "−")


def _backlash(actuator: Actuator) -> str:
    return actuator.axes.name("backlash_rad", USER)


def _play(value: float, unit: str) -> str:
    """'703 µrad', as an interval has it, in place of 0.703 mrad."""
    shown = Quantity("", unit).scaled(value)
    return (Quantity("", unit).scaled(1e-3 * value) if shown.factor * value < 1.0 else shown).text(value)


def _direction(phase_rad: float) -> str:
    """'+72', '0'."""
    degrees = round(np.degrees(phase_rad))
    return f"{degrees:+d}".replace("-", "−") if degrees else "0"


def sentences(k: ArrayLike, actuator: Actuator) -> tuple[str, ...]:
    """The same as eight short phrases, one for each k."""
    r = readings(k, actuator)
    return (
        f"friction × {r['friction_factor']:.2f}",
        f"backlash {_play(r[_backlash(actuator)], actuator.axes.unit('rad', USER))}",
        f"phase A: {100.0 * r['turns_a']:.0f} % of turns",
        f"phase B: {100.0 * r['turns_b']:.0f} % of turns",
        f"phase C: {100.0 * r['turns_c']:.0f} % of turns",
        f"eccentricity ζ = {r['eccentricity']:.2f}",
        f"thinnest gap at {_direction(r['eccentricity_phase_rad'])}°",
        f"gain × {physical(k).gain_factor:.2f}",
    )
