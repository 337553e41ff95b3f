"""One flight as the tracking sees it: k as its recording tells it, and how sure that is, in two parts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flight:
    """k̂ = k + common · u + e, the eccentricity as a vector in the places of k6 and k7 (see `estimation.unknowns`).

    u are the unit's base parameters in σ of their tolerances: the same numbers in all its flights, so that they move
    no trend.  e is the flight's own: its sensors' noise, its start, the model's own error on its command.
    """

    name: str
    k: Array  # (8,), unbounded: noise may take it beyond 0 and 1
    own: Array  # (8, 8), covariance of e
    common: Array  # (8, base parameters)
    excluded: str = ""  # why it says nothing of k; empty where it does
