"""The model of each unit on the recordings of each other one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ema_model.estimation.problem import SIGNALS
from ema_model.units.fit import Fitted
from ema_model.units.result import Transfer


def transfer(fits: Sequence[Fitted]) -> Transfer:
    """All models beside one unit's recordings are one population; the recordings start as their own unit's fit says."""
    count = len(fits)
    signal = next(name for name in SIGNALS if all(name in one.unit.model.windows[0].measured for one in fits))
    error, floors, floor = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
    for place, one in enumerate(fits):
        problem = one.unit.problem
        problem.reweighted(one.unit.floors)
        at = np.repeat(one.calibration.x[None, :], count, axis=0)
        parameters = len(one.unit.parameters)
        at[:, :parameters] = [other.calibration.x[:parameters] for other in fits]
        residuals = problem.residuals(problem.clip(at))[:, : problem.values]
        floors[:, place] = one.over_floor(residuals)
        parts = [part for part in problem.parts() if part[1] == signal]
        size = [problem.over_sigma(i, name, np.ones(rows.stop - rows.start)) for i, name, rows in parts]
        squares = [np.sum((residuals[:, rows] / over) ** 2, axis=1) for (_, _, rows), over in zip(parts, size)]
        values = sum(len(over) for over in size)
        error[:, place] = np.sqrt(np.sum(squares, axis=0) / values)
        own = [one.floors[i].sigma(signal) ** 2 for i, _, _ in parts]
        floor[place] = np.sqrt(np.sum(np.concatenate(own)) / values)
    return Transfer(signal, error, floor, floors)
