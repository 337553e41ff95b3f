"""How sure a model's parameters are where what is left is no noise: told, and fitted, by its own size and colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.evidence import colour_of, signals_of
from ema_model.discovery.model_fit import Data, Fit, fit
from ema_model.estimation import Calibration
from ema_model.estimation.calibrate import calibrated, problem_of

Array = NDArray[np.float64]

_ROUNDS = 3  # of fits, each without the parameters that the one before drove to their bounds


@lru_cache(maxsize=16)  # a page asks at every look
def with_intervals(data: Data, found: Fit) -> Calibration:
    """A fit's calibration with 90 % intervals that count what is left as it is: as many values as it has shapes."""
    calibration = found.calibration
    jacobian = calibration.weighted_jacobian / np.sqrt(colour_of(data, found))[:, None]
    # Orthogonal to the last digit: beside a fine floor JᵀJ itself rounds the prior away.
    root = np.linalg.inv(np.linalg.qr(np.concatenate([jacobian, np.eye(jacobian.shape[1])]), mode="r"))
    problem = problem_of(found.plant, data.floors, free=calibration.free, signals=data.signals)
    told = calibrated(problem, calibration.x, root @ root.T)
    parameters = {n: replace(one, interval90=told[n].interval90) for n, one in calibration.parameters.items()}
    return replace(calibration, parameters=parameters)


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
        driven = [path for path, one in again.calibration.parameters.items() if one.at_bound and _is_base(path)]
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


def _is_base(path: str) -> bool:
    return "." in path and not path.startswith("effects.")
