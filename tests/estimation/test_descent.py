"""Descent and its robust form beside scipy's least squares, on a curve with outliers and bounds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from ema_model.estimation.descent import LeastSquares, Robust, descend

TIME = np.linspace(0.0, 4.0, 120)


class Decay:
    """a·exp(−b t) + c beside data, a few of which are far off; c may not fall below 0.2."""

    low, high = np.array([0.0, 0.0, 0.2]), np.array([5.0, 4.0, 1.0])
    count = 3

    def __init__(self) -> None:
        random = np.random.default_rng(2)
        self.data = 2.0 * np.exp(-1.3 * TIME) + 0.1 + 0.02 * random.standard_normal(TIME.size)
        self.data[::17] += random.uniform(1.0, 4.0, self.data[::17].size)

    def clip(self, x):
        return np.clip(x, self.low, self.high)

    def residuals(self, x):
        a, b, c = x.T[:, :, None]
        return (a * np.exp(-b * TIME) + c - self.data) / 0.02

    def jacobians(self, x):
        a, b, _ = x.T[:, :, None]
        fading = np.exp(-b * TIME)
        slopes = np.stack([fading, -a * TIME * fading, np.ones_like(fading)], axis=2) / 0.02
        return self.residuals(x), slopes


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
def test_every_start_ends_where_scipy_does(loss):
    own = Decay()
    scale = 2.0 if loss == "soft_l1" else 1.0
    problem: LeastSquares = Robust(own, scale) if loss == "soft_l1" else own
    starts = np.array([[1.0, 1.0, 0.5], [4.0, 0.2, 0.9], [0.5, 3.0, 0.3]])
    found = descend(problem, starts, 200)
    expected = least_squares(
        lambda x: own.residuals(x[None, :])[0], starts[0], bounds=(own.low, own.high), loss=loss, f_scale=scale
    )
    assert found.done
    np.testing.assert_allclose(found.cost, 2.0 * expected.cost, rtol=1e-4)
    np.testing.assert_allclose(found.x, np.tile(expected.x, (3, 1)), atol=0.01)
    if loss == "soft_l1":
        np.testing.assert_allclose(found.x[:, :2], [[1.9, 1.5]] * 3, atol=0.2)  # outliers hardly move it


def test_robust_slopes_are_those_of_its_residuals():
    problem = Robust(Decay(), 3.0)
    x = np.array([[2.0, 1.3, 0.4]])
    slopes = problem.jacobians(x)[1][0]
    for i, step in enumerate(1e-6 * np.eye(3)):
        change = (problem.residuals(x + step) - problem.residuals(x - step))[0] / 2e-6
        np.testing.assert_allclose(slopes[:, i], change, rtol=1e-5, atol=1e-5)
