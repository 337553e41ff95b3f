"""Further orders of a periodic effect: cogging is seldom one sine alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ema_model.discovery.fingerprints import fingerprints
from ema_model.discovery.model_fit import Data, Fit
from ema_model.discovery.refit import LEAST_BIC, Trial, pays, tried
from ema_model.discovery.result import Candidate
from ema_model.discovery.score import scored_together
from ema_model.effects import catalogue_name, find

_MOST = 5  # further orders
_SHARE = 0.05  # of the strongest one's predicted drop


def with_further_orders(
    data: Data, held: Data | None, current: Fit, name: str, tell: Callable[[str], None]
) -> Trial | None:
    """The model with the effect at further orders as well, if the data pay for them: all at once, or the best alone."""
    present = current.actuator.effects.items()
    known = {values.get("order") for effect, values in present if catalogue_name(effect) == name}
    order = next(parameter for parameter in find(name).parameters if parameter.name == "order")
    tell(f"scoring further orders of {name}")
    left = [h for h in range(int(order.low), int(order.high) + 1) if h not in known]
    found = scored_together(current, fingerprints(data, current, [f"{name}_2"], left), _MOST)
    worth = [c for c in found if c.predicted_drop > max(2.0 * LEAST_BIC, _SHARE * found[0].predicted_drop)]
    for chosen in (worth, worth[:1]):
        if chosen:
            tell(f"trying {name} at {len(chosen)} further orders")
            effects = {f"{name}_{i}": one.settings for i, one in enumerate(chosen, 2)}
            trial = tried(data, current, _together(name, chosen), effects, tell)
            if pays(current, trial, data, held):
                return trial
    return None


def _together(name: str, chosen: Sequence[Candidate]) -> Candidate:
    return Candidate(name, sum(one.predicted_drop for one in chosen), chosen[0].settings)
