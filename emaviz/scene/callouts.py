"""What differs from healthy, said in physical units at its place on the machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.faults import FAULTS

_LEAST = 0.005  # of a k beyond healthy: a step of its slider
Place = tuple[float, float, float]
PLACES: dict[str, Place] = {
    "k1": (-0.335, -0.05, 0.055),
    "k2": (0.80, -0.02, -0.07),
    "k3": (-0.1, 0.06, 0.235),
    "k4": (-0.25, 0.235, -0.06),
    "k5": (-0.1, -0.235, -0.08),
    "k6": (-0.25, 0.0, 0.125),
    "k7": (-0.25, -0.12, 0.0),
    "k8": (0.44, 0.40, -0.10),
}


@dataclass(frozen=True)
class Callout:
    """One fault, what is to be read of it, and where it sits."""

    fault: str  # k1 … k8
    text: str
    place: Place


def callouts(k: ArrayLike, actuator: Actuator, play_enlarged: float, gap_enlarged: float) -> tuple[Callout, ...]:
    """Of every component of k (8,) that is not healthy; the factors are those by which play and gap are drawn larger.

    The direction of an eccentricity (k7) that is not there is said to do nothing.
    """
    values = np.asarray(k, dtype=float)
    off = {
        fault.name: said
        for fault, value, said in zip(FAULTS, values, sentences(values, actuator))
        if abs(value - fault.healthy) >= _LEAST
    }
    more = {
        "k2": f"shown × {play_enlarged:g}",
        "k6": f"shown × {gap_enlarged:g}",
        "k7": "" if "k6" in off else "(no effect: ζ = 0)",
    }
    return tuple(
        Callout(name, "\n".join(filter(None, (said, more.get(name)))), PLACES[name]) for name, said in off.items()
    )
