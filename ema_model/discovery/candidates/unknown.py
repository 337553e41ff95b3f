"""An effect that the library does not have: the curve that the residual draws, tried like any effect."""

from __future__ import annotations

from collections.abc import Callable

from ema_model.comparison.explain import Explanation
from ema_model.discovery.candidates.paid_for import pays
from ema_model.discovery.candidates.refit import Trial, stands_for
from ema_model.discovery.candidates.torque_curve import is_torque, with_curve
from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.result import Candidate
from ema_model.effects import find
from ema_model.estimation.model_fit import Data, Fit, fit

_HALF = 0.5
_KNOT = 3.0  # χ² that each knot must be worth beside a parameter: knots lie on one smooth line
TEETH = 4  # periods in a turn from which on a torque is one of teeth or poles


def curve_for(
    data: Data, held: Data | None, current: Fit, explanation: Explanation | None, tell: Callable[[str], None]
) -> Trial | None:
    """The model with the residual's own curve as a torque, if there is one and the data pay for it."""
    if explanation is None or not is_torque(explanation, current.actuator):
        return None
    tell(f"trying a curve over the {explanation.variable.replace('_', ' ')}")
    actuator, name = with_curve(data, current, explanation)
    found = fit(data, actuator, current.starts, tell, current.faults)
    settings = dict(actuator.effects[name])
    trial = Trial(Candidate(name, 0.0, settings), {name: settings}, found, current.chi2 - found.chi2)
    return trial if pays(current, trial, data, held) else None


def curve_instead(
    data: Data,
    held: Data | None,
    current: Fit,
    best: Trial,
    explanation: Explanation | None,
    tell: Callable[[str], None],
) -> Trial | None:
    """The residual's own curve, if it tells so much more than the best effect that this one only bends toward it.

    A parameter outside its tolerance bends far: the curve need only be worth its knots.  An effect may be one of
    several: the curve must tell twice as much.
    """
    if explanation is None:
        return None
    stands_in = bool(stands_for(current, best))
    if not stands_in and best.drop > _HALF * explanation.beyond_noise * current.chi2:
        return None
    curve = curve_for(data, held, current, explanation, tell)
    if curve is None:
        return None
    knots = sum(len(find(name).parameters) for name in curve.effects) - len(best.effects)
    worth = curve.drop - best.drop > _KNOT * knots + LEAST_BIC
    return curve if worth and (stands_in or best.drop < _HALF * curve.drop) else None


def is_a_shape(orders: list[float]) -> bool:
    """Whether several low orders together are no teeth, but one shape within the turn, which no order is."""
    return len(orders) > 1 and max(orders) < TEETH
