"""Whether an effect is the same everywhere: its parameters, found on parts of the recordings apart, must agree.

Parts are recordings, or the halves of a single one.  On each the fit takes one step from where all together ended, with
the same prior; how far it goes is told by what is left there, not by the sensors' noise.  What stands in for something
else is bent another way by another motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.criteria import APART, DISAGREES, LATE_BY, PHASES_APART
from ema_model.discovery.evidence.counted import colour, signals_of
from ema_model.effects import catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit

Array = NDArray[np.float64]

_LOOSE = 0.1  # of the prior's weight, that an effect's own parameters keep: their σ is only a guess
_TELLS = 0.5  # of an amplitude, up to which its σ in a part says anything of it


@dataclass(frozen=True, eq=False)
class Disagreement:
    """A parameter of an effect that parts of the recordings put at values apart."""

    parameter: str
    values: tuple[float, ...]  # of the parts that tell, in its unit


def disagreement(data: Data, found: Fit, key: str) -> Disagreement | None:
    """The parameter of an effect on which parts of the recordings disagree most; None where they agree."""
    from scipy.special import chdtrc  # takes a while to import

    names = [*found.calibration.parameters, *found.calibration.starts]
    own = [i for i, name in enumerate(names) if name.startswith(f"effects.{key}.")]
    first = find(catalogue_name(key)).parameters[0]
    strength = f"effects.{key}.{first.name}" if first.low <= 0.0 else ""  # the model is straight in it
    parts = [_apart(data, found, rows, own) for rows in parts_of(data, found)]
    worst, least = None, DISAGREES
    for place, i in enumerate(own):
        one = found.calibration.parameters[names[i]]
        sigma = found.actuator.tolerances[names[i]].sigma
        tell = [(one.value + sigma * step[place], sigma * error[place]) for step, error in parts]
        is_phase = names[i].endswith(ANGLES)
        limit = PHASES_APART if is_phase else APART * abs(one.value)
        if names[i].endswith("delay_s"):
            limit = max(limit, LATE_BY * max(one.sample_period_s for one in data.measurements))
        tell = [(value, error) for value, error in tell if error < max(limit, _TELLS * abs(one.value))]
        if not (is_phase or names[i] == strength):  # a step of its own size is beyond what is straight
            tell = [(value, error) for value, error in tell if abs(value - one.value) < abs(one.value)]
        if len(tell) < 2:
            continue
        values, errors = np.array(tell).T
        weights = errors**-2.0
        mean = float(np.average(values, weights=weights))
        chance = float(chdtrc(len(values) - 1, float(weights @ (values - mean) ** 2)))
        if chance < least and float(np.max(np.abs(values - one.value))) > limit:
            worst, least = Disagreement(names[i], tuple(float(value) for value in values)), chance
    return worst


def parts_of(data: Data, found: Fit) -> list[NDArray[np.bool_]]:
    """Rows of a fit's residual by recording; by halves of its time where there is but one."""
    rows = list(signals_of(data, found.plant))
    windows = [window for window in found.plant.windows for name in data.signals if name in window.measured]
    label = np.empty(len(found.residual), np.intp)
    for (_, at), window in zip(rows, windows):
        label[at] = window.recording
    if np.ptp(label) == 0:
        middle = np.median(np.concatenate([window.time_s for window in found.plant.windows]))
        for (_, at), window in zip(rows, windows):
            label[at] = window.time_s > middle
    return [label == one for one in np.unique(label)]


def _apart(data: Data, found: Fit, rows: NDArray[np.bool_], own: Sequence[int]) -> tuple[Array, Array]:
    """The step of an effect's parameters on some rows alone, and its standard errors, in σ of their tolerances."""
    calibration = found.calibration
    jacobian = calibration.weighted_jacobian[rows]
    weight = 1.0 / colour(data, found.plant, np.where(rows, found.residual, 0.0))[rows]
    prior = np.ones(len(calibration.x))
    prior[own] = _LOOSE
    pulled = calibration.x.copy()
    pulled[own] = 0.0
    normal = (jacobian * weight[:, None]).T @ jacobian + np.diag(prior)
    moment = jacobian.T @ (weight * found.residual[rows]) + prior * pulled
    covariance = np.linalg.inv(normal)
    return -(covariance @ moment)[own], np.sqrt(np.diag(covariance))[own]
