"""Parameters of the actuator whose value no tolerance of its file allows."""

from __future__ import annotations

import numpy as np

from ema_model.discovery.evidence.counted import colour_of
from ema_model.discovery.evidence.uncertainty import is_base
from ema_model.estimation.information import posterior
from ema_model.estimation.model_fit import Data, Fit

_FAR = 3.0  # σ of a parameter's tolerance, beyond which it lies outside
_TOGETHER = 0.7  # correlation from which on two are drawn by the same


def outside_tolerance(data: Data, found: Fit) -> list[str]:
    """Their paths, those of effects left out.

    Without a controller one scale holds all torques, so that several parameters share what draws at them, and none of
    them may be far off.  If the file is right, the estimates, in σ of the tolerances, are spread by 1 − C where C is
    the posterior's covariance: what counts is how far one is off in that, and of those drawn together, the farthest.
    """
    calibration = found.calibration
    if found.plant.simulates_commands:
        return [name for name in calibration.outside_tolerance if is_base(name)]
    jacobian = calibration.weighted_jacobian / np.sqrt(colour_of(data, found))[:, None]
    expected = np.eye(calibration.x.size) - posterior(jacobian)
    spread = np.sqrt(np.maximum(np.diag(expected), np.finfo(float).eps))
    together = np.abs(expected / np.outer(spread, spread)) > _TOGETHER
    told: list[int] = []
    for i in np.argsort(-np.abs(calibration.x[: len(calibration.free)])):
        is_far = abs(calibration.x[i]) > _FAR * spread[i]
        if is_far and is_base(calibration.free[i]) and not together[i, told].any():
            told.append(int(i))
    return [calibration.free[i] for i in sorted(told)]
