"""Oracles that know the law of a life and how unevenly flights wear: with its exponent and its onset, or without.

They learn where k began, how fast it wears and, where they are told of it, what the unit's base parameters add; one
that is given several exponents or onsets learns which it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from life_peers import DRAWN, QUANTILES, Array, Quantiles, told

_LENGTHS = np.geomspace(20.0, 450.0, 160)
_TURNS = 2  # of each flight's linearisation
_WORN = 8.0  # σ of a flight's own noise, by which k must have moved for what the unit adds to be seen to change with it


@dataclass(frozen=True)
class Law:
    """What an oracle knows: k = s + (threshold − s) (w/W)ᵖ, w the wear since the onset, of 1 a flight on average."""

    power: float
    onset: int  # flights since the part was new, before which nothing wears
    variation: float  # of a flight's wear
    most_begun: float  # s is below it
    shortest: float = 0.0  # W, in flights, and the longest
    longest: float = np.inf


@dataclass(frozen=True, eq=False)
class Adds:
    """What the unit's base parameters add to k: (at_healthy + grows k) · c, each number of c normal."""

    at_healthy: Array  # (numbers,)
    grows: Array  # (numbers,)
    strays: Array  # (flights,), variance of what commands and loads change of it


NOTHING = Adds(np.zeros(0), np.zeros(0), np.zeros(0))


def adds(k: Array, sigma: Array, common: Array) -> Adds:
    """Of the flights (n,), common (n, base parameters): the two numbers that matter most, straight over k."""
    if not len(k):
        return NOTHING
    _, _, ways = np.linalg.svd(common, full_matrices=False)
    common = common @ ways[:2].T
    grows = np.zeros(common.shape[1])
    if len(k) > 10 and np.ptp(k) > _WORN * np.median(sigma):
        line = np.stack([np.ones_like(k), k - k.mean()], axis=1)
        grows = np.linalg.lstsq(line, common, rcond=None)[0][1]
    rest = common - np.outer(k, grows)
    middle = rest.mean(axis=0)
    return Adds(middle, grows, np.sum((rest - middle) ** 2, axis=1))


def oracle(
    at: Array,
    k: Array,
    sigma: Array,
    now: float,
    threshold: float,
    laws: Sequence[Law],
    first: int,
    unit: Adds = NOTHING,
) -> Quantiles:
    """5, 50 and 95 % of what remains; at, k, sigma (n,) and now as for `life_peers`; first: the part's first flight.

    An iterated extended Kalman filter of w, s and c for each law, all as likely at first, and each W of a grid.
    """
    numbers = len(unit.grows)
    variance = sigma**2 + (unit.strays if numbers else 0.0)
    seen, drawn = dict(zip(at.astype(int), zip(k, variance))), []
    for law in laws:
        mean = np.zeros((len(_LENGTHS), 2 + numbers))
        mean[:, 1] = law.most_begun / 2.0
        covariance = np.tile(np.diag([0.0, law.most_begun**2 / 12.0, *np.ones(numbers)]), (len(_LENGTHS), 1, 1))
        fit = np.where((_LENGTHS >= law.shortest) & (_LENGTHS <= law.longest), 0.0, -np.inf)
        for flight in range(first, int(now) + 1):
            if flight - first >= law.onset:
                mean[:, 0] += 1.0
                covariance[:, 0, 0] += law.variation**2
            if flight in seen:
                mean, covariance, likelihood = _told_by(*seen[flight], mean, covariance, threshold, law, unit)
                fit += likelihood
        wait = np.full(len(_LENGTHS), max(0, first + law.onset - 1 - int(now)))
        drawn.append((_LENGTHS - mean[:, 0], covariance[:, 0, 0], wait, fit))
    return _left(*(np.concatenate(part) for part in zip(*drawn)), laws[0].variation)


def _told_by(value: float, variance: float, mean: Array, covariance: Array, threshold: float, law: Law, unit: Adds):
    """Mean, covariance and log likelihood after a flight."""
    x, row = mean, np.zeros_like(mean)
    for _ in range(_TURNS):
        share = np.maximum(x[:, 0], 1e-9) / _LENGTHS
        worn, c = share**law.power, x[:, 2:]
        true = x[:, 1] + (threshold - x[:, 1]) * worn
        factor = 1.0 + c @ unit.grows
        row[:, 0] = (threshold - x[:, 1]) * law.power * share ** (law.power - 1.0) / _LENGTHS * factor
        row[:, 1] = (1.0 - worn) * factor
        row[:, 2:] = unit.at_healthy + true[:, None] * unit.grows
        gap = value - true - np.sum(row[:, 2:] * c, axis=1) - np.sum(row * (mean - x), axis=1)
        to = (covariance @ row[:, :, None])[:, :, 0]
        total = np.sum(row * to, axis=1) + variance
        x = mean + to * (gap / total)[:, None]
    covariance = covariance - to[:, :, None] * to[:, None, :] / total[:, None, None]
    return x, covariance, -0.5 * (np.log(total) + gap**2 / total)


def _left(there: Array, variance: Array, wait: Array, fit: Array, variation: float) -> Quantiles:
    weight = np.exp(fit - fit.max())
    edges = np.cumsum(weight / weight.sum())
    random = np.random.default_rng(0)
    chosen = np.searchsorted(edges, (np.arange(DRAWN) + 0.5) / DRAWN * (1.0 - 1e-12))
    spread = np.sqrt(np.maximum(variance[chosen], 0.0))
    way = np.maximum(there[chosen] - spread * random.standard_normal(DRAWN), 1e-3)
    passed = random.wald(way, (way / variation) ** 2) + 0.5 * (1.0 + variation**2)
    return told(np.quantile(wait[chosen] + passed, QUANTILES))
