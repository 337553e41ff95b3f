"""The flights of a life without recordings: k̂ drawn from what identifications can tell.

What is common to a unit's flights (its base parameters) is drawn once, what is a flight's own in each flight; both
change with the flight's profile and with how worn the unit is.
"""

from __future__ import annotations

import numpy as np

from ema_model import faults
from ema_model.estimation.unknowns import ECCENTRICITY, to_vector
from ema_model.lives.accuracy import STATES, WORN_AT, accuracy
from ema_model.lives.life import Life
from ema_model.lives.profiles import profiles_of
from ema_model.lives.recorded import base_of
from ema_model.tracking.flight import Flight
from ema_model.tracking.identify import UNFIT

_STATED = 0.2  # by which what an identification says of its own σ² varies about what it is, in natural logarithms


def drawn(life: Life) -> list[Flight]:
    """All flights of a life; those that are of no use are excluded, and their k̂ is anything."""
    random = np.random.default_rng([life.seed, 45])
    known, profiles = accuracy(), profiles_of(life)
    u = base_of(life, known.common.shape[-1])
    vectors = to_vector(life.k)
    healthy = to_vector(faults.HEALTHY)
    flights = []
    for i, (k, profile) in enumerate(zip(vectors, profiles)):
        shares = _states(k - healthy)
        own = np.tensordot(shares, known.own[:, profile], 1)
        common = np.tensordot(shares, known.common[:, profile], 1)
        error = np.linalg.cholesky(own + 1e-14 * np.eye(8)) @ random.standard_normal(8)
        stated = own * np.exp(_STATED * random.standard_normal())
        usable = bool(life.usable[i])
        seen = k + common @ u + error if usable else random.random(8)
        flights.append(Flight(f"flight_{i + 1:04d}", seen, stated, common, "" if usable else UNFIT))
    return flights


def _states(off: np.ndarray) -> np.ndarray:
    """How much each state of `accuracy` counts for a unit that is `off` (8,) from healthy; sums to 1."""
    size = np.abs(off)
    eccentricity = float(np.hypot(*off[list(ECCENTRICITY)]))
    worn = np.array([*size[:5], eccentricity, size[7]]) / WORN_AT
    worn /= max(1.0, float(worn.sum()))
    assert len(worn) + 1 == len(STATES)
    return np.concatenate([[1.0 - worn.sum()], worn])
