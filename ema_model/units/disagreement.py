"""In what the recordings of one unit disagree: the zero of the current's sensor, by how long the current is late, and
how warm the winding was.

None is the unit's: a sensor's zero drifts from day to day, and a logger takes the signals a little apart.  They are
freed for a recording where the data pay for it, as differences between units are, and integrated out; of a unit with a
recording whose current is late, or whose winding was far warmer, no difference is told before that is set right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ema_model.identification.model_bias import TWINS
from ema_model.units.block import Linearised
from ema_model.units.candidates import Candidate
from ema_model.units.criteria import FALSE

Array = NDArray[np.float64]

_ANYWHERE = 1e-3  # σ⁻², of a parameter whose value the other recordings are to tell, not the file
_WHITE = 1_000_000  # independent values where nothing but the sensors' noise scatters


@dataclass(frozen=True)
class Paid:
    """One that the data pay for."""

    place: int  # among the unit's candidates
    of: Candidate
    value: float  # in its unit
    sigma: float

    @property
    def is_allowed_for(self) -> bool:
        """Whether what is said of the unit does not suffer by it."""
        return abs(self.value) <= self.of.farthest * self.of.sigma


def disagreements(parts: Sequence[Linearised]) -> list[list[Paid]]:
    """Of each unit what the data pay for, the best first; its ripple is taken to be alike in all units."""
    total = sum(len(one.candidates) for one in parts)
    if not total:
        return [[] for _ in parts]
    freedom = sum(one.rounds * (TWINS - 1) for one in parts)
    price = float(stdtrit(freedom or _WHITE, 0.5 * FALSE / total)) ** 2
    ripple = _ripple(parts, freedom)
    found = []
    for part in parts:
        chosen: list[int] = []
        while left := [place for place in range(len(part.candidates)) if place not in chosen]:
            scores = {place: _score(part, place, chosen, ripple) for place in left}
            best = max(left, key=lambda place: abs(scores[place][0]) / scores[place][1])
            value, sigma = scores[best]
            if (value / sigma) ** 2 <= price:
                break
            chosen.append(best)
        found.append(
            [
                _paid(part, place, *_score(part, place, [one for one in chosen if one != place], ripple))
                for place in chosen
            ]
        )
    return found


def _paid(part: Linearised, place: int, value: float, sigma: float) -> Paid:
    one = part.candidates[place]
    return Paid(place, one, one.sigma * value, one.sigma * float(np.hypot(sigma, one.bent * value)))


def _score(part: Linearised, place: int, chosen: Sequence[int], ripple: dict[str, float]) -> tuple[float, float]:
    """How far one is off, once all else has taken what it can of it, and 1 σ, in its own σ."""
    whole, information, known = _left(part, place, chosen)
    variance = float(whole @ part.noise @ whole + known @ whole**2) + ripple[part.candidates[place].name] * information
    sigma = np.hypot(np.sqrt(variance) / information, part.candidates[place].model)
    return float(whole @ part.gradient) / information, float(sigma)


def _left(part: Linearised, place: int, chosen: Sequence[int]) -> tuple[Array, float, Array]:
    """The combination of columns (columns,) that is left of a candidate, its curvature, and the priors (columns,)."""
    others = [*range(part.parameters), *part.nuisances(chosen)]
    column = part.nuisances([place])[-1]
    prior = np.zeros(len(others))
    prior[: part.parameters] = 1.0  # a tolerance
    if (same := part.candidates[place].parameter) is not None:
        prior[same] = _ANYWHERE
    prior[len(others) - len(chosen) :] = 1.0
    taken = np.linalg.solve(part.curvature[np.ix_(others, others)] + np.diag(prior), part.curvature[others, column])
    whole = np.zeros(len(part.curvature))
    whole[column], whole[others] = 1.0, -taken
    known = np.zeros(len(whole))
    known[others] = prior
    return whole, max(float(part.curvature[column] @ whole), 1e-12), known


def _ripple(parts: Sequence[Linearised], freedom: int) -> dict[str, float]:
    """The ripple's variance over the curvature, of each kind."""
    ratios: dict[str, list[float]] = {}
    for part in parts:
        for place, one in enumerate(part.candidates):
            whole, information, _ = _left(part, place, ())
            square = float(np.sum((part.ripple @ whole) ** 2)) / max(part.rounds * (TWINS - 1), 1)
            ratios.setdefault(one.name, []).append((1.0 + 1.0 / TWINS) * square / information if freedom else 0.0)
    return {name: float(np.mean(each)) for name, each in ratios.items()}
