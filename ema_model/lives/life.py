"""What truly happens to a unit: its wear, flight by flight, with the load of each flight, a repair, bad recordings.

Each flight wears by its severity, which is Gamma distributed with mean 1 and a coefficient of variation, so that the
time in which a part wears is a sum over flights and no count of them.  Three laws say how k follows that time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model import faults
from ema_model.errors import InputError, quoted

Array = NDArray[np.float64]

LAWS = ("linear", "accelerating", "onset")
_WORN = ("k1", "k2", "k3", "k4", "k5", "k6", "k8")
_THRESHOLDS = {"k1": (0.2, 0.6), "k2": (0.2, 0.6), "k6": (0.15, 0.5), "k8": (0.1, 0.3)}
_SHORT = (0.1, 0.4)  # of k3, k4, k5
_FLIGHTS = (100, 400)
POWER = (1.5, 3.0)  # of the accelerating law, k ∝ tᵖ
ONSET = (0.2, 0.6)  # share of a part's life before which nothing wears
_START = 0.05  # most of a worn part's k at first
_BAD = 0.03  # share of flights whose recording is of no use
_REPAIRED = 0.25  # share of lives in which the part is replaced once
_REPAIRED_AT = (0.4, 0.8)  # share of the part's life
_BESIDE = 0.5  # share of lives in which another fault wears too, and how far it gets towards its own threshold
_BESIDE_AT_END = 0.3


@dataclass(frozen=True, eq=False)
class Life:
    """A unit from its first flight to the one in which its fault crosses the threshold, or to its last."""

    seed: int
    law: str  # of LAWS, or "healthy"
    variation: float  # coefficient of variation of the severities
    k: Array  # (flights, 8), true
    severity: Array  # (flights,), mean 1
    usable: NDArray[np.bool_]  # (flights,)
    fault: str = ""  # the one that crosses
    threshold: float = float("nan")  # of that k
    power: float = 1.0  # of the law
    onset: int = 0  # flight of the last part from which on it wears
    repaired: int | None = None  # the first flight with a new part

    @property
    def flights(self) -> int:
        """How many there are; in the last one the threshold is crossed, if at all."""
        return len(self.k)


def healthy_life(seed: int, flights: int | None = None, variation: float = 0.5) -> Life:
    """Nothing wears."""
    random = np.random.default_rng([seed, 40])
    count = int(random.integers(*_FLIGHTS)) if flights is None else flights
    severity = _severities(random, variation, count)
    k = np.tile(faults.HEALTHY, (count, 1))
    return Life(seed, "healthy", variation, k, severity, random.random(count) >= _BAD)


def worn_life(law: str, seed: int, variation: float = 0.5, fault: str | None = None) -> Life:
    """One fault wears by a law until it crosses a threshold that is drawn, after 100 … 400 flights or so.

    Another may wear a little beside it, and the part may have been replaced once.  InputError for no such law.
    """
    if law not in LAWS:
        raise InputError(f"no wear law {quoted(law)!r}; there are {', '.join(LAWS)}")
    random = np.random.default_rng([seed, 41, LAWS.index(law)])
    name = str(random.choice(_WORN)) if fault is None else fault
    beside = str(random.choice([one for one in _WORN if one != name])) if random.random() < _BESIDE else ""
    phase = float(random.uniform(0.0, 1.0))  # of an eccentricity, wherever there is one
    start, threshold = _ends(random, name)
    length = float(random.uniform(*_FLIGHTS))
    power = float(random.uniform(*POWER)) if law == "accelerating" else 1.0
    onset_share = float(random.uniform(*ONSET)) if law == "onset" else 0.0
    parts = [1.0]
    if random.random() < _REPAIRED:
        first = float(random.uniform(*_REPAIRED_AT))
        parts, length = [first, 1.0], length / (1.0 + first)
    severity = _severities(random, variation, 4 * int(length) + 4000)
    values, at, onset, repaired = [], 0, 0, None
    for number, share in enumerate(parts):
        onset = at + round(onset_share * length)
        wear = np.cumsum(np.where(np.arange(len(severity)) >= onset, severity, 0.0)[at:])
        progress = (wear / ((1.0 - onset_share) * length)) ** power
        end = int(np.argmax(progress >= share)) + 1
        values.append(progress[:end])
        at += end
        if number + 1 < len(parts):
            repaired = at
    progress = np.concatenate(values)
    count = len(progress)
    k = np.tile(faults.HEALTHY, (count, 1))
    k[:, faults.NAMES.index(name)] = start + (threshold - start) * progress
    if beside:
        low, far = _ends(random, beside)
        k[:, faults.NAMES.index(beside)] = low + _BESIDE_AT_END * (far - low) * np.arange(1, count + 1) / count
    if "k6" in (name, beside):
        k[:, 6] = phase
    return Life(
        seed, law, variation, k, severity[:count], random.random(count) >= _BAD, name, threshold, power, onset, repaired
    )


def _ends(random: np.random.Generator, name: str) -> tuple[float, float]:
    """A fault's value when the part is new to us, and its threshold."""
    size = float(random.uniform(*_THRESHOLDS.get(name, _SHORT)))
    start = float(random.uniform(0.0, _START))
    if name == "k8":
        return 0.5, 0.5 + float(random.choice([-1.0, 1.0])) * size
    return start, size


def _severities(random: np.random.Generator, variation: float, count: int) -> Array:
    shape = 1.0 / variation**2
    return random.gamma(shape, 1.0 / shape, count)
