"""One descent of a fit, on problems whose lowest point is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.estimation.least_squares import descended


def problem(residuals, slopes, low=(-3.0, -3.0), high=(3.0, 3.0)):
    """Of two unknowns; residuals (values,) and slopes (values, 2) of one x."""
    low, high = np.array(low), np.array(high)

    def each(x):
        return np.array([residuals(one) for one in x])

    def derivatives(x):
        return np.array([slopes(one) for one in x])

    return SimpleNamespace(
        low=low,
        high=high,
        count=2,
        clip=lambda x: np.clip(x, low, high),
        residuals=each,
        jacobians=lambda x, in_whole_blocks: (each(x), derivatives(x)),
        jacobians_beside=lambda x, others, in_whole_blocks: (each(x), derivatives(x), each(others)),
        has_room_for=lambda others: True,
        points_in_whole_blocks=lambda n: n,
    )


def test_a_bent_valley_is_followed_to_its_end():
    """Rosenbrock's."""
    found = descended(
        problem(
            lambda x: np.array([100.0 * (x[1] - x[0] ** 2), 10.0 * (1.0 - x[0])]),
            lambda x: np.array([[-200.0 * x[0], 100.0], [-10.0, 0.0]]),
        ),
        np.array([-1.2, 1.0]),
    )
    assert found.ended and found.x == pytest.approx([1.0, 1.0], abs=1e-2)


def test_a_start_at_a_bound_is_left():
    found = descended(
        problem(lambda x: 10.0 * (x - [1.0, 0.5]), lambda x: 10.0 * np.eye(2), low=(0.0, -3.0)), np.zeros(2)
    )
    assert found.x == pytest.approx([1.0, 0.5], abs=1e-3) and found.cost == pytest.approx(0.0, abs=1e-2)


def test_what_lies_beyond_a_bound_is_not_reached():
    found = descended(problem(lambda x: 10.0 * (x - [5.0, 0.5]), lambda x: 10.0 * np.eye(2)), np.zeros(2))
    assert found.x == pytest.approx([3.0, 0.5], abs=1e-3)


def test_large_errors_may_count_less():
    """A mean of eleven values, one of them far off: squares give 1/11 of it, softened ones a small share."""
    values = np.r_[np.zeros(10), 1000.0]

    def mean_of(soft):
        def slopes(x):
            return np.stack([np.ones(11), np.zeros(11)], axis=1)

        wide = problem(lambda x: x[0] - values, slopes, low=(-2e3, -3.0), high=(2e3, 3.0))
        return descended(wide, np.zeros(2), soft).x[0]

    assert mean_of(None) == pytest.approx(1000.0 / 11.0, rel=1e-3)
    # 10 x = 1 / √(1 + …) · s: the one error counts as s wherever it lies
    assert mean_of(1.0) == pytest.approx(0.1, rel=0.05)


def test_it_may_be_stopped():
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        descended(problem(lambda x: x, lambda x: np.eye(2)), np.ones(2), tell=stop)
