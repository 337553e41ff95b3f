"""How sure a model's parameters are where what is left is no noise: told, and fitted, by its own size and colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.evidence.counted import colour_of, signals_of
from ema_model.estimation import Calibration
from ema_model.estimation.calibrate import calibrated, problem_of
from ema_model.estimation.information import by_pieces, posterior
from ema_model.estimation.model_fit import Data, Fit, fit
from ema_model.quantities.numbers import HALF_90

Array = NDArray[np.float64]

_OF_FILE = 2.0 / HALF_90  # times that a tolerance counts which nothing checks
_ROUNDS = 6  # of fits at most, each without the parameters that the one before drove to their bounds


@lru_cache(maxsize=16)  # a page asks at every look
def with_intervals(data: Data, found: Fit) -> Calibration:
    """A fit's calibration with 90 % intervals that count what is left as it is: as many values as it has shapes.

    At the floor, too, what is left may last, where a model is not quite the rig's.  How its pieces in time pull at each
    parameter tells how far that may be off (White, Econometrica 48 (1980), by clusters); the wider interval counts.
    What the file alone tells, without a controller the scale of all torques above all, nothing checks there: of its
    tolerances, which are somebody's guess, two σ count.
    """
    calibration = found.calibration
    jacobian = calibration.weighted_jacobian / np.sqrt(colour_of(data, found))[:, None]
    covariance = posterior(jacobian)
    problem = problem_of(found.plant, data.floors, free=calibration.free, signals=data.signals)
    variance, most = np.diag(covariance), 1.0 if found.plant.simulates_commands else _OF_FILE
    by_file = np.sum(covariance**2, axis=1)  # of it, what the tolerances leave open
    wider = np.sqrt(np.maximum(1.0 + (most**2 - 1.0) * by_file / variance, _by_pieces(data, found) / variance))
    told = calibrated(problem, calibration.x, covariance * np.outer(wider, wider), most)
    parameters = {name: replace(told[name], at_bound=one.at_bound) for name, one in calibration.parameters.items()}
    return replace(calibration, parameters=parameters).as_result


def _by_pieces(data: Data, found: Fit) -> Array:
    """Variance of each unknown, in σ² of its tolerance, from how pieces of the windows pull at it: (unknowns,)."""
    windows = [i for i, one in enumerate(found.plant.windows) for name in data.signals if name in one.measured]
    parts = [(window, rows) for window, (_, rows) in zip(windows, signals_of(data, found.plant))]
    calibration = found.calibration
    return np.max(
        [np.diag(one) for one in by_pieces(calibration.weighted_jacobian, calibration.residual, parts)], axis=0
    )


def settled(data: Data, found: Fit, tell: Callable[[str], None]) -> Fit:
    """The same model fitted with what it leaves as its floor: its tolerances then count as much as they should.

    A parameter of the actuator that what is missing still drives to its bound stays as the file says.
    """
    size = {name: float(np.sqrt(colour_of(data, found)[rows][0])) for name, rows in signals_of(data, found.plant)}
    floors = [
        replace(
            one,
            noise={name: size.get(name, 1.0) * value for name, value in one.noise.items()},
            model={name: size.get(name, 1.0) * values for name, values in one.model.items()},
        )
        for one in data.floors
    ]
    quiet, again, held = replace(data, floors=floors), found, ()
    for _ in range(_ROUNDS):
        again = fit(quiet, found.actuator, again.starts, tell, found.faults, held)
        driven = [path for path, one in again.calibration.parameters.items() if one.at_bound and is_base(path)]
        if not driven:
            break
        held = (*held, *driven)
    calibration = again.calibration
    rows = np.concatenate([np.full(at.stop - at.start, size[name]) for name, at in signals_of(data, found.plant)])
    residual = calibration.residual * rows
    return replace(
        again,
        calibration=replace(
            calibration,
            residual=residual,
            chi2_per_value=float(residual @ residual) / len(residual),
            weighted_sensitivities=[
                {name: size[name] * values for name, values in part.items()}
                for part in calibration.weighted_sensitivities
            ],
        ),
    )


def is_base(path: str) -> bool:
    """Whether a parameter is the actuator's own, and no fault's or effect's."""
    return "." in path and not path.startswith("effects.")
