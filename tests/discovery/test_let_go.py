"""What the score sees of an effect behind parameters at a bound, beside the least of the bounded problem itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from ema_model.discovery.candidates.let_go import let_go
from ema_model.estimation.model_fit import Fit


def found_at_bounds(seed: int) -> tuple[Fit, np.ndarray, np.ndarray]:
    """A linear fit whose unknowns, a σ of prior each, hide a column of their own size; some end at a bound of 0.5 σ."""
    random = np.random.default_rng(seed)
    jacobian = random.standard_normal((400, 5))
    column = jacobian @ [0.8, -0.6, 0.3, 0.0, 0.0] + 0.3 * random.standard_normal(400)
    measured = random.standard_normal(400) - 2.0 * column
    rows, target = np.r_[jacobian, np.eye(5)], np.r_[-measured, np.zeros(5)]
    x = lsq_linear(rows, target, (-0.5, 0.5), tol=1e-14).x
    calibration: Any = SimpleNamespace(weighted_jacobian=jacobian, x=x, room=(-0.5 - x, 0.5 - x))
    calibration.residual = measured + jacobian @ x
    nothing: Any = None
    return Fit(nothing, nothing, calibration, {}), column, x


@pytest.mark.parametrize("seed", range(5))
def test_the_fall_is_that_of_the_bounded_problem(seed):
    found, column, x = found_at_bounds(seed)
    assert np.sum(np.abs(x) > 0.49) >= 2
    freed = let_go(found, column[:, None])
    assert freed is not None
    amounts, energy, toward, given, change = freed
    rows = np.c_[np.r_[found.calibration.weighted_jacobian, np.eye(5)], np.r_[column, np.zeros(5)]]
    target = -np.r_[found.residual, x]
    low, high = found.calibration.room
    least = lsq_linear(rows, target, (np.r_[low, -np.inf], np.r_[high, np.inf]), tol=1e-14)
    fall = float(target @ target) - 2.0 * least.cost
    assert given + 2.0 * amounts @ toward - amounts @ energy @ amounts == pytest.approx(fall, rel=0.02)
    assert amounts[0] == pytest.approx(least.x[-1], rel=0.02)
    np.testing.assert_allclose(change, (rows @ least.x)[:400], atol=0.02 * np.abs(change).max())


def test_nothing_is_let_go_where_none_stands_at_a_bound():
    found, column, _ = found_at_bounds(0)
    calibration: Any = found.calibration
    calibration.room = (np.full(5, -3.0), np.full(5, 3.0))
    assert let_go(found, column[:, None]) is None
