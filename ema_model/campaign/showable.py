"""How much hidden effects change recordings beyond what the tolerances can: whether anyone could see them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ema_model.actuator import Actuator
from ema_model.comparison.compare import weights_of
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import fit, gather
from ema_model.recordings import Measurement, prepared


def showable(
    recordings: Sequence[Measurement],
    actuator: Actuator,
    effects: Mapping[str, Mapping[str, float]],
    signals: Sequence[str] | None = None,
) -> float:
    """Expected fall of χ² at the effects' true settings."""
    data = gather([prepared(one, actuator) for one in recordings], actuator, weights_of(signals, actuator), None)
    data = data.beside(fit(data, actuator))
    base = fit(data, actuator)
    x = base.calibration.x
    with_them = data.plant(replace(actuator, effects={name: dict(given) for name, given in effects.items()}))
    problem = problem_of(with_them, data.floors, signals=data.signals)
    change = problem.residuals(x[None, :])[0, : problem.values] - base.residual
    columns = base.calibration.weighted_jacobian
    own = change - columns @ np.linalg.solve(columns.T @ columns + np.eye(len(x)), columns.T @ change)
    return float(change @ own)
