"""Parameters at a bound that an effect lets go.

What hides behind a parameter at its bound is seen too little by a score that holds it there: beside the effect it
would move back, and the others with it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.model_fit import Fit

Array = NDArray[np.float64]

AT_BOUND = 0.02  # σ from it
_RIDGE = 1e-9  # of the columns' mean energy


class Freed(NamedTuple):
    """Amounts a of some columns beside what leaves its bound: χ² falls by c + 2 a·t − a·E·a with any near these."""

    amounts: Array  # a
    energy: Array  # E
    toward: Array  # t
    given: float  # c
    change: Array  # of the residual, (values,), with all that moves beside them


def at_bounds(found: Fit) -> NDArray[np.bool_]:
    """Which unknowns stand at a bound."""
    low, high = found.calibration.room
    return np.minimum(-low, high) <= AT_BOUND


@lru_cache(maxsize=1)  # a fit is asked with the columns of each candidate
def _parabola(found: Fit) -> tuple[Array, Array, Array]:
    """J, and half of χ²'s second and first derivative by the unknowns."""
    calibration = found.calibration
    jacobian, x = calibration.weighted_jacobian, calibration.x
    return jacobian, jacobian.T @ jacobian + np.eye(len(x)), jacobian.T @ found.residual + x


def let_go(found: Fit, columns: Array) -> Freed | None:
    """Amounts of some columns (values, columns) beside what leaves its bound for them; None where nothing does.

    The descent is linear, and holds an unknown at its bound as long as it would go beyond.
    """
    held = np.flatnonzero(at_bounds(found))
    if not len(held):
        return None
    residual, (low, high) = found.residual, found.calibration.room
    jacobian, hessian, gradient = _parabola(found)
    mixed, energy = jacobian.T @ columns, columns.T @ columns
    gone: set[int] = set()
    barred: set[int] = set()
    amounts, own, toward, given = np.zeros(columns.shape[1]), energy, energy[0], 0.0
    step = np.zeros(len(gradient))
    for _ in range(2 * len(held) + 1):
        free = np.array([one for one in range(len(gradient)) if one not in held or one in gone], dtype=int)
        inverse = np.linalg.inv(hessian[np.ix_(free, free)])
        own = energy - mixed[free].T @ inverse @ mixed[free]
        toward = mixed[free].T @ inverse @ gradient[free] - columns.T @ residual
        given = float(gradient[free] @ inverse @ gradient[free])
        amounts = np.linalg.solve(own + _RIDGE * (np.trace(energy) + 1e-300) * np.eye(len(own)), toward)
        step = np.zeros(len(gradient))
        step[free] = -inverse @ (gradient[free] + mixed[free] @ amounts)
        beyond = {one for one in gone if not low[one] - AT_BOUND <= step[one] <= high[one] + AT_BOUND}
        if beyond:
            gone, barred = gone - beyond, barred | beyond
            continue
        push = gradient + hessian @ step + mixed @ amounts  # χ² falls against it
        back = {int(one) for one in held if (push[one] > 0.0 if high[one] <= AT_BOUND else push[one] < 0.0)}
        back -= gone | barred
        if not back:
            break
        gone |= back
    return Freed(amounts, own, toward, given, columns @ amounts + jacobian @ step) if gone else None
