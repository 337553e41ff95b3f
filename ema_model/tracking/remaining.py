"""Remaining life: the flights until k first crosses its threshold, as a distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ema_model.tracking.evidence import AHEAD, LONGEST, SAMPLES
from ema_model.tracking.wear import Wear

Array = NDArray[np.float64]

_MORE = 4  # times as many are drawn as are kept
_LEAST_RATE = 1e-5  # of k in a flight; what wears less is not told from what wears nothing


@dataclass(frozen=True, eq=False)
class Remaining:
    """Flights that remain, from now on."""

    p05: float
    p50: float
    p95: float
    samples: Array  # sorted, of the distribution

    @property
    def crossing(self) -> tuple[tuple[int, float], ...]:
        """Within so many flights, with which probability."""
        return tuple((flights, self.within(flights)) for flights in AHEAD)

    def within(self, flights: float) -> float:
        """The probability of crossing within the next flights."""
        return float(np.searchsorted(self.samples, flights, side="right") / len(self.samples))


def remaining(worn: Wear, threshold: float, unit: Array, begun_sigma: float, bounded: bool, seed: int) -> Remaining:
    """threshold: in the coordinate in which k grows, healthy at 0.

    unit: (2, 2), covariance of what the unit's base parameters may still add to k at the first flight and today.  That
    is not known, but k had begun little worn (1 σ: begun_sigma), and where `bounded` not below 0; as it may grow with
    k, it changes the rate too.
    The rest of the way is a first passage: with today's rate and shape it would take D flights, and as flights wear
    unevenly (coefficient of variation v), it takes inverse Gaussian many, of mean D and shape (D/v)².
    """
    random = np.random.default_rng(seed)
    drawn = _MORE * SAMPLES
    way = np.searchsorted(np.cumsum(worn.weight), (np.arange(drawn) + 0.5) / drawn * (1.0 - 1e-12))
    random.shuffle(way)
    sigma = np.sqrt(np.maximum(worn.covariance[way, 2], 1e-18))
    rate = worn.rate[way] + sigma * _above(-worn.rate[way] / sigma, random)
    # A rate may be of any size: its prior is even in its logarithm, the filter's was in the rate itself.
    chance = np.cumsum(1.0 / np.maximum(rate, _LEAST_RATE))
    kept = np.searchsorted(chance, (np.arange(SAMPLES) + 0.5) / SAMPLES * chance[-1] * (1.0 - 1e-12))
    way, rate = way[kept], rate[kept]
    a, b, c = worn.covariance[way].T
    sigma = np.sqrt(np.maximum(c, 1e-18))
    level = worn.level[way] + b / sigma**2 * (rate - worn.rate[way])
    level += np.sqrt(np.maximum(a - (b / sigma) ** 2, 0.0)) * random.standard_normal(SAMPLES)
    begun = level - rate * worn.worn[way]
    added = begun - _truly_begun(begun, unit[0, 0], begun_sigma, bounded, random)
    slope = unit[0, 1] / max(unit[0, 0], 1e-12)
    rest = np.sqrt(max(unit[1, 1] - slope * unit[0, 1], 0.0))
    true_level = level - slope * added - rest * random.standard_normal(SAMPLES)
    grown = np.maximum(level - begun, 1e-9)
    rate = rate * np.clip((true_level - begun + added) / grown, 0.3, 3.0)
    distance = np.maximum(threshold - true_level, 0.0)
    power, growth, age = worn.power[way], worn.growth[way], worn.age[way]
    p = np.where(power > 0.0, power, 1.0)
    g = np.where(growth > 0.0, growth, 1.0)
    # capped: what wears so little never ends
    flights = np.minimum(distance / np.maximum(rate, 1e-9), 1e12)
    by_power = age * np.expm1(np.log1p(p * flights / age) / p)
    by_growth = np.log1p(g * flights) / g
    usual = np.where(growth > 0.0, by_growth, by_power)
    uneven = worn.uneven[way]
    there = np.maximum(usual, 1e-9)
    passage = np.where(distance > 0.0, random.wald(there, (there / uneven) ** 2) + 0.5 * (1.0 + uneven**2), 0.0)
    samples = np.sort(np.minimum(passage, LONGEST))
    p05, p50, p95 = np.quantile(samples, [0.05, 0.5, 0.95])
    return Remaining(float(p05), float(p50), float(p95), samples)


def _truly_begun(begun: Array, variance: float, sigma: float, bounded: bool, random: np.random.Generator) -> Array:
    """k at the first flight, of what was measured of it."""
    share = sigma**2 / (sigma**2 + variance)
    spread = max(np.sqrt(share * variance), 1e-9)
    normal = _above(-begun * share / spread, random) if bounded else random.standard_normal(len(begun))
    return begun * share + spread * normal


def _above(low: Array, random: np.random.Generator) -> Array:
    """Standard normal numbers, each above its bound."""
    return -ndtri(np.maximum(random.random(len(low)) * ndtr(-low), 1e-300))
