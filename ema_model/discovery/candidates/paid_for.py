"""Whether the data pay for a candidate in the model: by what was fitted, and by what was not."""

from __future__ import annotations

import math

import numpy as np

from ema_model.discovery.candidates.refit import LEAST_FALL, Trial, fitted_count
from ema_model.discovery.criteria import BEYOND_DOUBT, LEAST_BIC, MOMENT, MOMENTS
from ema_model.discovery.evidence.counted import colour_of, effective_values, evidence
from ema_model.estimation.model_fit import Data, Fit, holdout_change, holdout_error

_FALL = 0.01  # below which a fall is slight, and the data must be twice as sure
_LEAST_T = 2.4  # of the mean gain over blocks of time: 1 % of chance
_HELD = 0.01  # of the held-out error, that must go above the floor
_SHOWS = 0.125  # of the fall of the fitted error at the floor, that must be seen there as well
_AGREES = 0.8  # of the held-out error: so great a fall there, and of the fitted one, needs no other test
_FLOOR = 1.1  # of the floor, up to which an error counts as at it
_CORRELATED = 50  # values of a signal that may share their error


def worth(data: Data, current: Fit, trial: Trial) -> float:
    """How much a trial tells beyond what its parameters must (BIC), relative to what it leaves."""
    return evidence(data, current, trial.fit) - price(data, current, trial)


def price(data: Data, current: Fit, trial: Trial) -> float:
    """What the parameters of a trial must tell before they tell anything (BIC)."""
    count = sum(fitted_count(name, current.actuator.axes) for name in trial.effects) + len(trial.faults)
    return count * math.log(min(len(current.residual), effective_values(data, trial.fit)))


def pays(current: Fit, trial: Trial, data: Data, held: Data | None) -> bool:
    """Whether the data pay for the parameters: most of the time, materially, and where they were not fitted."""
    fall = 1.0 - trial.fit.error() / current.error()
    if fall < LEAST_FALL:
        return False
    tells = worth(data, current, trial) >= (LEAST_BIC if fall > _FALL else 2.0 * LEAST_BIC)
    if held is not None and (tells or fall > 1.0 - _AGREES):
        before, after = holdout_error(held, current), holdout_error(held, trial.fit)
        if after < _AGREES * before:
            return True  # no chance repeats itself where it was not fitted
        tells = tells and (_holds(before, after, fall) or _holds_its_peace(data, held, current, trial))
    return tells and _lasts(data, current, trial.fit)


def _lasts(data: Data, before: Fit, after: Fit) -> bool:
    """Whether a gain is seen most of the time, or beyond chance in several moments apart."""
    gains = (before.residual**2 - after.residual**2) / colour_of(data, after)
    blocks = np.array_split(gains, max(8, len(gains) // _CORRELATED))
    sums = np.array([block.sum() for block in blocks])
    if sums.sum() >= _LEAST_T * np.std(sums, ddof=1) * np.sqrt(len(sums)):
        return True
    moments = np.flatnonzero(sums > MOMENT)
    apart = np.count_nonzero(np.diff(moments) > 1) + min(1, len(moments))
    return bool(apart >= MOMENTS and -sums[sums < 0.0].sum() < 0.5 * sums[sums > 0.0].sum())


def _holds(before: float, after: float, fall: float) -> bool:
    """Whether what was not fitted agrees; fall: of the error of what was.

    What falls by little at the floor must fall there as well: a model that is not quite the rig's finds something in
    every recording, and another thing in each.
    """
    return after < (1.0 - _asked(before, fall)) * before


def _asked(before: float, fall: float) -> float:
    """The share of its error by which what was not fitted must fall."""
    return _HELD if before > _FLOOR else _SHOWS * fall


def _holds_its_peace(data: Data, held: Data, current: Fit, trial: Trial) -> bool:
    """Whether what was not fitted could not fall by as much even if all were true, and what was is beyond doubt.

    What is true takes from an error by its square as much as it changes: a slow sine tells nothing of an acceleration's
    limit, and nothing against it.
    """
    before, after = holdout_error(held, current), holdout_error(held, trial.fit)
    asked = _asked(before, 1.0 - trial.fit.error() / current.error())
    least = (1.0 - asked) * before
    if before > _FLOOR or before**2 - holdout_change(held, current, trial.fit) ** 2 < least**2:
        return False
    return after < (1.0 + asked) * before and worth(data, current, trial) > BEYOND_DOUBT
