"""Other ways to tell the life that remains, of the same k, so turned that it grows from 0: each gives quantiles.

at (n,): the numbers of the usable flights since the part was new; k (n,) and its own σ (n,); now: today's flight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
Quantiles = tuple[float, float, float]

UNDEFINED = (np.nan, np.nan, np.nan)
LONGEST = 100_000.0  # flights; a median beyond it is no answer
QUANTILES = (0.05, 0.5, 0.95)
DRAWN = 2000


def exponential_fit(at: Array, k: Array, sigma: Array, now: float, threshold: float) -> Quantiles:
    """k = a + b exp(c t) by weighted least squares, b and c positive; drawn from the fit's covariance."""
    if len(k) < 4:
        return UNDEFINED
    t, span = at - at[0], max(at[-1] - at[0], 1.0)

    def model(x: Array) -> Array:
        return x[0] + np.exp(x[1]) * np.expm1(np.exp(x[2]) * t)

    best = None
    for turns in (0.03, 0.3, 1.0, 3.0):
        size = max(np.ptp(k), 1e-3) / np.expm1(turns)
        begin = [float(k[0]), np.log(size), np.log(turns / span)]
        bounds = ([-1.0, -25.0, np.log(1e-3 / span)], [1.0, 5.0, np.log(12.0 / span)])
        begin = np.clip(begin, np.array(bounds[0]) + 1e-6, np.array(bounds[1]) - 1e-6)
        found = least_squares(lambda x: (model(x) - k) / sigma, begin, bounds=bounds, x_scale="jac")
        best = found if best is None or found.cost < best.cost else best
    assert best is not None
    scale = max(1.0, 2.0 * best.cost / max(len(k) - 3, 1))
    covariance = scale * np.linalg.pinv(best.jac.T @ best.jac + 1e-9 * np.eye(3))
    random = np.random.default_rng(0)
    drawn = random.multivariate_normal(best.x, covariance, DRAWN, method="eigh")
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        reached = np.log1p((threshold - drawn[:, 0]) / np.exp(drawn[:, 1])) / np.exp(drawn[:, 2]) + at[0] - now
    reached = np.clip(np.nan_to_num(reached, nan=0.0, posinf=LONGEST), 0.0, LONGEST)
    return told(np.quantile(reached, QUANTILES))


def particle_filter(at: Array, k: Array, sigma: Array, now: float, threshold: float, seed: int = 0) -> Quantiles:
    """A bootstrap filter: level and the logarithm of its growth in a flight, which walks; each particle goes on."""
    random = np.random.default_rng(seed)
    count, walk, uneven = DRAWN, 0.03, 0.7
    level = random.uniform(0.0, 0.05, count)
    rate = np.log(10.0) * random.uniform(-5.0, -1.5, count)
    last = at[0]
    for flight, seen, spread in zip(at, k, sigma):
        for _ in range(int(flight - last)):
            rate = rate + walk * random.standard_normal(count)
            level = level + np.exp(rate) * random.gamma(uneven**-2, uneven**2, count)
        last = flight
        weight = -0.5 * ((seen - level) / spread) ** 2
        weight = np.exp(weight - weight.max())
        edges = np.cumsum(weight / weight.sum())
        chosen = np.searchsorted(edges, (np.arange(count) + random.random()) / count * (1.0 - 1e-12))
        level, rate = level[chosen], rate[chosen]
    left, reached = np.full(count, LONGEST), level >= threshold
    left[reached] = 0.0
    for ahead in range(1, 3001):
        rate = rate + walk * random.standard_normal(count)
        level = level + np.exp(rate) * random.gamma(uneven**-2, uneven**2, count)
        new = (level >= threshold) & ~reached
        left[new], reached = ahead, reached | new
        if reached.all():
            break
    return told(np.quantile(left, QUANTILES))


def told(quantiles: Array) -> Quantiles:
    """Of the flights that remain; no answer where their median has no end."""
    low, middle, high = (float(one) for one in quantiles)
    return (low, middle, high) if middle < LONGEST else UNDEFINED
