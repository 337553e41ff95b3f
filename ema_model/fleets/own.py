"""How well the recordings of one unit tell each of its parameters, and which are only known together.

It is what a fit of that unit alone leaves open, at the file's values, with the file's tolerances as all else that is
known: the covariance is (G + 1)⁻¹ in tolerances, G as of `units.block`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, parse_actuator
from ema_model.actuator.write import as_toml
from ema_model.fleets.recorded import recorded
from ema_model.units.block import linearised, pooled, unit_of

Array = NDArray[np.float64]

_ROUNDS = 8  # of twins: their spread is known to a tenth
_KNOWN = 0.4  # of a tolerance, up to which a parameter is told by itself
_SHOWS = 0.2  # of it, up to which one shows at all, were all others known
_TOGETHER = 0.7  # correlation from which on two that are not told by themselves are only known together


@dataclass(frozen=True)
class Own:
    """One parameter, or one of those that are only known together."""

    parameter: str  # "section.parameter"
    together: tuple[str, ...]  # with itself, in the file's order
    sigma: float  # of the file's tolerance: what is not known of it, were the others of `together` known


def own(actuator: Actuator, runs: tuple[str, ...]) -> tuple[Own, ...]:
    """Of each parameter that shows in these runs."""
    return _own(as_toml(actuator), runs)


@lru_cache(maxsize=4)
def _own(text: str, runs: tuple[str, ...]) -> tuple[Own, ...]:
    actuator = parse_actuator(text, "the fleet's actuator")
    unit = unit_of("", list(recorded(actuator, 0, runs=runs).values()), actuator)
    part = linearised(unit, np.zeros(len(unit.parameters)), rounds=_ROUNDS)
    return _told(unit.parameters, pooled([part])[0].information)


def _told(names: Sequence[str], information: Array) -> tuple[Own, ...]:
    whole = information + np.eye(len(information))
    covariance = np.linalg.inv(whole)
    sigma = np.sqrt(np.diag(covariance))
    alone = 1.0 / np.sqrt(np.diag(whole))
    correlation = np.abs(covariance / np.outer(sigma, sigma))
    found = []
    for i, name in enumerate(names):
        mates = [i]
        if sigma[i] > _KNOWN:
            mates = [j for j in range(len(names)) if j == i or (sigma[j] > _KNOWN and correlation[i, j] > _TOGETHER)]
        rest = [j for j in range(len(names)) if j == i or j not in mates]
        of_group = float(np.sqrt(np.linalg.inv(whole[np.ix_(rest, rest)])[rest.index(i), rest.index(i)]))
        if of_group <= _KNOWN and alone[i] <= _SHOWS and not name.startswith("sensors."):
            found.append(Own(name, tuple(names[j] for j in mates), of_group))
    return tuple(found)
