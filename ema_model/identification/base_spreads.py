"""How far each base parameter of an actuator is from its file's value, as recordings say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.problem import Problem
from ema_model.faults import NAMES

Array = NDArray[np.float64]

_FAULTS = len(NAMES)  # the first of the unknowns
_SWEEPS = 30  # over the base parameters, at most
_SWEPT = 0.01  # of a spread, that a sweep changes when it is the last
_WORTH = 4.0  # logarithm of the likelihood that a spread must gain: there are many to choose from
_SEEN = 1e-6  # (σ of the noise)², by which a parameter's tolerance must change the signals


def spreads_of(problem: Problem, x: Array) -> Array:
    """How far each base parameter is from its file's value, in its tolerances, as the data say: (base parameters,).

    x: the best fit with the file's values.  The likelihood of the data with k and the base parameters integrated
    out, each of these with a prior of its own `spread` σ, at its maximum (automatic relevance determination: MacKay,
    Neural Computation 4, 1992; Tipping, JMLR 1, 2001).  A rig that is as its file says gets its k with hardly any
    cost of tolerances that it does not use, and one parameter that is off does not set the others free.
    """
    residuals, all_slopes = problem.jacobians(x[None, :])
    residual, slopes, base = residuals[0], all_slopes[0], problem.base
    free = ~base
    free[:_FAULTS] &= (x > problem.low + 1e-9)[:_FAULTS] & (x < problem.high - 1e-9)[:_FAULTS]
    q, _ = np.linalg.qr(slopes[:, free])
    columns = slopes[:, base].copy()
    columns[problem.values :] = 0.0  # their prior is what is asked for
    columns -= q @ (q.T @ columns)
    return most_likely_spreads(columns.T @ columns, columns.T @ residual)


def most_likely_spreads(inner: Array, shown: Array) -> Array:
    """The prior σ of each of n numbers, 0 to 1, at which data are likeliest: (n,), found one after another.

    0 where that hardly makes them likelier: of many numbers one gains a little by chance.

    inner (n, n): of their derivatives, over the noise; shown (n,): of these with what is left without them.
    Of one number alone the best is known: √(q² − s) / s (Tipping and Faul, AISTATS 2003, eq. 20).
    """
    spreads = np.zeros(len(shown))
    for _ in range(_SWEEPS):
        before = spreads.copy()
        for one in range(len(spreads)):
            spreads[one] = 0.0
            on = np.flatnonzero(spreads)
            scaled = np.eye(len(on)) + spreads[on, None] * inner[np.ix_(on, on)] * spreads[on]
            both = np.linalg.solve(scaled, spreads[on, None] * np.column_stack([inner[on, one], shown[on]]))
            across = inner[on, one] * spreads[on]
            s, q = np.array([inner[one, one], shown[one]]) - across @ both
            if q * q > s > _SEEN:
                spread = min(1.0, np.sqrt(q * q - s) / s)
                more = spread * spread * s
                if 0.5 * (q * q / s * more / (1.0 + more) - np.log1p(more)) > _WORTH:
                    spreads[one] = spread
        if np.max(np.abs(spreads - before)) < _SWEPT:
            break
    return spreads
