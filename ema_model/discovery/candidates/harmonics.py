"""Further orders of a periodic effect: cogging is seldom one sine alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ema_model.comparison.explain import Order, colour
from ema_model.discovery.candidates.fingerprints import fingerprints
from ema_model.discovery.candidates.paid_for import pays
from ema_model.discovery.candidates.refit import Trial, tried
from ema_model.discovery.candidates.score import scored_beside, scored_together
from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.evidence.remaining import left_by
from ema_model.discovery.result import Candidate
from ema_model.effects import catalogue_name, find
from ema_model.estimation.model_fit import Data

_MOST = 5  # further orders
_APART = 0.5  # orders, closer than which two are one
_SHARE = 0.05  # of the strongest one's predicted drop


@dataclass(frozen=True, eq=False)
class Further:
    """What is seen of other orders beside one of a periodic effect."""

    stands_out: bool  # whether that one tells more than what is left tells at its neighbours
    trial: Trial | None  # the model with further orders, where the data pay for them


def further_orders(data: Data, held: Data | None, best: Trial, tell: Callable[[str], None]) -> Further:
    """The model of a trial with its effect at further orders as well, if the data pay: all at once, or the best alone.

    Teeth and poles have a cause, and stand out; what is no periodic torque tells a little at every order.
    """
    name, current = best.candidate.name, best.fit
    present = current.actuator.effects.items()
    known = {values["order"] for effect, values in present if catalogue_name(effect) == name}
    tell(f"scoring further orders of {name}")
    left = [h for h in _orders(data, best) if all(abs(h - other) >= _APART for other in known)]
    if not left:
        return Further(True, None)
    prints = fingerprints(data, current, [f"{name}_2"], left)
    found = scored_together(current, prints, _MOST)
    drops = np.array([one.predicted_drop for one in scored_beside(current, prints, found)])
    around = dict(zip(left, colour(drops)))
    strong = [c for c in found if c.predicted_drop > max(2.0 * LEAST_BIC, _SHARE * found[0].predicted_drop)]
    worth = [c for c in strong if _stands_out(c.settings["order"], c.predicted_drop, around)]
    for chosen in (worth, worth[:1]):
        if chosen:
            tell(f"trying {name} at {len(chosen)} further orders")
            effects = {f"{name}_{i}": one.settings for i, one in enumerate(chosen, 2)}
            trial = tried(data, current, _together(name, chosen), effects, tell)
            if pays(current, trial, data, held):
                return Further(_stands_out(best.candidate.settings["order"], best.drop, around), trial)
    return Further(_stands_out(best.candidate.settings["order"], best.drop, around), None)


def _orders(data: Data, best: Trial) -> list[float]:
    """All that a turn can have, or of a linear motor those that what is left shows."""
    order = next(one for one in find(best.candidate.name, best.fit.actuator.axes).parameters if one.name == "order")
    if not order.integer:
        return left_by(data, best.fit).orders
    return [float(h) for h in range(int(order.low), int(order.high) + 1)]


def _stands_out(order: float, drop: float, around: Mapping[float, float]) -> bool:
    """Whether a fall of χ² at an order is significant; around: how strong noise is at the others."""
    near = min(around, key=lambda other: abs(other - order))
    return Order(order, 0.0, 0.0, drop / around[near]).is_significant(len(around))


def _together(name: str, chosen: Sequence[Candidate]) -> Candidate:
    return Candidate(name, sum(one.predicted_drop for one in chosen), chosen[0].settings)
