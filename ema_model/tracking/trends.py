"""What drifts and what remains: the evidence of a trend or a jump, how a k wears, and the life that remains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr, ndtr, ndtri

from ema_model.physics.jit import recursion

# --- every number that decides in the tracking of flights -------------------------------------------------------------

FALSE_TREND = 0.01  # probability of a trend that is none, of a unit's whole life, all k and all looks together
ONSET_EVERY = 4  # flights between two onsets that are looked at
SLOPES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # of k in a flight, spread of what a trend may be
GROWN_BY = 10  # flights before one, by which it is told how far its sensitivities have grown with k
NOISE_PRIOR = 3.0  # flights, by which the stated noise counts beside the one that is seen

JUMP_BACK = 6.0  # of the differences' spread: towards healthy, a part replaced
JUMP_ON = 12.0  # the same away from healthy, where wear itself is uneven
JUMP_LEAST = 0.02  # of k, and no less
JUMP_AFTER = 3  # flights that must follow it
JUMP_SURE = 6  # flights after which one towards healthy is looked for once more
JUMP_WINDOW = 12  # flights beside it, by which its size is judged

LEAST_FLIGHTS = 8  # usable ones, before which nothing is told
MISFIT_WINDOW, MISFIT_SHARE = 10, 0.5  # of the last flights that the model fits badly: trends are then not trusted
WORN_BEFORE = 0.05  # of k, 1 σ of what a unit or a new part has already when its first flight is seen

LONGEST = 100_000.0  # flights; what would remain longer has no end that could be told
AHEAD = (1, 2, 5, 10, 20, 50, 100, 200)  # flights within which the probability of crossing is told
SAMPLES = 2000  # of the remaining life


# --- a sudden step of k between two flights: a part replaced, or a fault that came at once ----------------------------

Array = NDArray[np.float64]


def jump(k: Array, variance: Array, common: Array, healthy: float) -> int | None:
    """The place of the first flight after a step, of the flights (n,) of one k; None where there is none.

    Only one that JUMP_AFTER flights follow is looked for, so that it is found as soon as it can be, and once more, if
    k went back towards healthy, after JUMP_SURE.  What the base parameters may add in other commands is no step: k is
    without what is known of it, common (flights, parameters) is what is not.
    """
    soon = _step(k, variance, common, JUMP_AFTER, healthy)
    if soon.sure > (JUMP_BACK if soon.back else JUMP_ON):
        return soon.at
    later = _step(k, variance, common, JUMP_SURE, healthy)
    return later.at if later.back and later.sure > JUMP_BACK else None


class _Step(NamedTuple):
    at: int  # place of the first flight after it
    sure: float  # its size over the spread
    back: bool  # towards healthy


def _step(k: Array, variance: Array, common: Array, after: int, healthy: float) -> _Step:
    """One that so many flights follow.

    Medians of as many flights on either side tell its size, less what wear adds meanwhile; the differences of the
    flights beside it tell the spread.
    """
    at = len(k) - after
    if at < after + 1:
        return _Step(at, 0.0, False)
    low, high = float(np.median(k[at - after : at])), float(np.median(k[at:]))
    first = max(0, at - JUMP_WINDOW)
    beside = np.delete(np.diff(k[first:]), at - first - 1)
    spread = max(
        1.4826 * float(np.median(np.abs(beside - np.median(beside)))),
        float(np.sqrt(2.0 * np.median(variance[first:]))),
    )
    # The median of a few differences is no slope for long; the flights before a step tell one, it itself does not.
    wear = float(np.median(beside)) if after == JUMP_AFTER else _slope(k[first:at])
    of_unit = np.linalg.norm(np.mean(common[at:], axis=0) - np.mean(common[at - after : at], axis=0))
    spread = float(np.hypot(spread * np.sqrt(JUMP_AFTER / after), of_unit))
    size = abs(high - low - after * wear)
    near = k[at - 2 : at + 2]  # medians leave it open by one
    back = abs(high - healthy) < abs(low - healthy)
    return _Step(at - 1 + int(np.argmax(np.abs(np.diff(near)))), size / spread if size > JUMP_LEAST else 0.0, back)


def _slope(k: Array) -> float:
    """Of a flight, by Theil and Sen: the median of those between any two."""
    sooner, later = np.triu_indices(len(k), 1)
    return float(np.median((k[later] - k[sooner]) / (later - sooner)))


# --- evidence for a trend of each k that may be looked at after each flight -------------------------------------------
# Without a trend k̂_t = c + s_t · u + e_t: c any constant, u the base parameters (σ = 1 each), e_t the flight's own
# noise; s_t is stated for one state of wear (`tracking.sensitivity`). With one, a slope is added from an onset on.
# The marginal likelihoods' ratio, c flat in both (the ratio is then one of the differences alone, whatever c),
# averaged over onsets and slopes, is a martingale without a trend: the probability that it ever reaches 1/α is α at
# most (Ville; Ramdas et al., Statistical Science 38, 2023, for such e-processes). The noise is the stated one, or
# what successive flights differ by where that is more.


class Evidence:
    """Of several k side by side, a flight at a time; each can begin anew."""

    def __init__(self, base: int, one_sided: ArrayLike) -> None:
        """base: how many base parameters; one_sided (k,): whether each can only grow."""
        self._one_sided = np.asarray(one_sided, dtype=bool)
        count, size = len(self._one_sided), base + 1
        self._prior = np.diag([0.0, *np.ones(base)])
        self._information = np.tile(self._prior, (count, 1, 1))
        self._seen = np.zeros((count, size))
        self._onsets = np.zeros(0)
        self._slopes = np.zeros((count, 0, size + 2))  # by onset: with the nuisances, with itself, with what is seen
        self._flights = np.zeros(count, dtype=int)
        self._first = np.full(count, np.inf)
        self._last = [(0.0, np.zeros(base), 0.0)] * count
        self._differences = np.full((2, count), NOISE_PRIOR)  # their sum, and how many

    @property
    def noise_factor(self) -> Array:
        """(k,), by which the variance that is seen exceeds the stated one; 1 at least."""
        return np.maximum(1.0, self._differences[0] / self._differences[1])

    def forget(self, i: int) -> None:
        """Begins anew with one of the k."""
        self._information[i], self._seen[i], self._slopes[i] = self._prior, 0.0, 0.0
        self._flights[i], self._first[i], self._differences[:, i] = 0, np.inf, NOISE_PRIOR

    def add(self, at: float, k: Array, variance: Array, common: Array, which: NDArray[np.int64]) -> Array:
        """The logarithms of the evidence of `which` k after a flight, in their order.

        at: its number; k̂, own variance (k,) and common (k, base parameters), of all.
        """
        if not len(self._onsets) or at >= self._onsets[-1] + ONSET_EVERY:
            self._onsets = np.append(self._onsets, at - 1.0)
            fresh = np.zeros((len(k), 1, self._slopes.shape[2]))
            self._slopes = np.concatenate([self._slopes, fresh], axis=1)
        factor = self.noise_factor[which]  # before this flight
        self._first[which] = np.minimum(self._first[which], at)
        row = np.concatenate([np.ones((len(which), 1)), common[which]], axis=1)
        over = row / variance[which, None]
        ramp = np.maximum(at - self._onsets, 0.0)
        self._information[which] += over[:, :, None] * row[:, None, :]
        self._seen[which] += over * k[which, None]
        with_slope = np.concatenate([over, np.zeros((len(which), 1)), (k / variance)[which, None]], axis=1)
        moved = ramp[None, :, None] * with_slope[:, None, :]
        moved[:, :, -2] = ramp**2 / variance[which, None]
        self._slopes[which] += moved
        self._flights[which] += 1
        inverse = np.linalg.inv(self._information[which])
        self._observe(k, variance, common, inverse, which)
        if np.all(self._flights[which] < LEAST_FLIGHTS):
            return np.zeros(len(which))
        slopes = self._slopes[which]
        projected = slopes[:, :, :-2] @ inverse
        size = np.maximum(slopes[:, :, -2] - np.sum(projected * slopes[:, :, :-2], axis=2), 0.0) / factor[:, None]
        score = (slopes[:, :, -1] - (projected @ self._seen[which][:, :, None])[:, :, 0]) / factor[:, None]
        return np.where(self._flights[which] < LEAST_FLIGHTS, 0.0, self._averaged(size, score, which))

    def _averaged(self, size: Array, score: Array, which: NDArray[np.int64]) -> Array:
        """Over onsets, the early ones heavier, and normal (or half normal) slopes of each spread."""
        order = np.cumsum(self._onsets[None, :] >= self._first[which, None] - 1.0, axis=1).astype(float)
        weight = np.where(order > 0.0, 1.0 / np.maximum(order * (order + 1.0), 1e-300), 0.0)
        tau = np.array(SLOPES)[:, None, None]
        shrunk = 1.0 + tau**2 * size
        z = tau * score / np.sqrt(shrunk)
        ratio = 0.5 * z**2 - 0.5 * np.log(shrunk)
        sided = self._one_sided[which]
        ratio[:, sided] += np.log(2.0) + log_ndtr(z[:, sided])
        with np.errstate(divide="ignore"):
            ratio += np.log(weight) - np.log(len(SLOPES))
        most = ratio.max(axis=(0, 2))
        return most + np.log(np.sum(np.exp(ratio - most[None, :, None]), axis=(0, 2)))

    def _observe(self, k: Array, variance: Array, common: Array, inverse: Array, which: NDArray[np.int64]) -> None:
        for place, i in enumerate(which):
            if self._flights[i] > 1:
                before, row, other = self._last[i]
                changed = common[i] - row
                moved = float(changed @ (inverse[place] @ self._seen[i])[1:])
                unknown = float(changed @ inverse[place][1:, 1:] @ changed)
                self._differences[0, i] += (k[i] - before - moved) ** 2 / (variance[i] + other + unknown)
                self._differences[1, i] += 1.0
            self._last[i] = float(k[i]), common[i], float(variance[i])


# --- how one k wears: level and drift of today, for each of many ways in which it may have come there -----------------
# A way is an onset, a shape of the rate of wear since (constant, growing as a power of the time since the onset,
# growing by a constant share a flight), and how unevenly flights wear.  For each, level and today's rate are the state
# of a Kalman filter, and the flights' likelihood makes its weight: the maximum over the process noise has the most of
# it.


POWERS = (1.0, 1.5, 2.0, 2.5, 3.0)  # k ∝ (flights since the onset)ᵖ
GROWTHS = (1.0 / 150.0, 1.0 / 75.0, 1.0 / 40.0)  # the rate's share a flight
UNEVEN = (0.3, 0.7, 1.2)  # coefficient of variation of a flight's wear
_ONSETS = 14  # that are tried
_STEADY = 0.4  # prior of a constant rate; the shapes that grow share the rest
_AT_ONCE = 0.4  # of wear that began with the first flight, if the rate is constant; the later onsets share the rest
_GROWING_AT_ONCE = 0.8  # the same if it grows: a wear that departs from the simplest in two ways is rarer
_RATE = 0.03  # of k in a flight, 1 σ of the prior of today's rate
_PASSES = 2
_COUNTS = 0.75  # of the likelihood, between ways: it takes what flights wear as normal, and that is skewed


@dataclass(frozen=True, eq=False)
class Wear:
    """By way, (ways,): weight, mean of level and today's rate, their covariance, and the way itself."""

    weight: Array
    level: Array
    rate: Array
    covariance: Array  # (ways, 3): of the level, of both, of the rate
    age: Array  # flights since the onset
    power: Array  # 0 where the rate grows by a share
    growth: Array
    uneven: Array
    worn: Array  # today's level less the first flight's, in units of today's rate


def wear(at: Array, k: Array, variance: Array, now: float) -> Wear:
    """at (n,): the flights' numbers; k (n,), so turned that it grows; variance (n,) of their own noise."""
    first = at[0]
    onsets = np.unique(np.round(np.linspace(first - 1.0, max(now - 4.0, first - 1.0), _ONSETS)))
    steps = np.arange(first + 1.0, now + 1.0)  # the flights in which something wears
    since = np.maximum(steps - onsets[:, None], 0.0)  # (onsets, steps)
    ages = np.maximum(now - onsets, 1.0)
    by_power = (since / ages[:, None])[:, None, :] ** (np.array(POWERS)[:, None] - 1.0)
    by_growth = np.exp(-np.array(GROWTHS)[:, None] * (now - steps))
    rates = np.concatenate([by_power, np.broadcast_to(by_growth, (len(onsets), *by_growth.shape))], axis=1)
    rates = (rates * (since > 0.0)[:, None, :]).reshape(-1, len(steps))
    table = np.zeros((len(rates), 2, len(steps) + 1))
    table[:, 0, 1:], table[:, 1, 1:] = np.cumsum(rates, axis=1), np.cumsum(rates**2, axis=1)
    # ways: onsets × shapes × unevenness
    shapes = len(POWERS) + len(GROWTHS)
    count = len(rates) * len(UNEVEN)
    shape = np.repeat(np.arange(len(rates)), len(UNEVEN))
    age = np.repeat(ages, shapes * len(UNEVEN))
    kind = shape % shapes
    power, growth = np.array([*POWERS, *[0.0] * len(GROWTHS)])[kind], np.array([*[0.0] * len(POWERS), *GROWTHS])[kind]
    uneven = np.tile(np.array(UNEVEN), count // len(UNEVEN))
    at_once = np.where(kind > 0, _GROWING_AT_ONCE, _AT_ONCE)
    later = np.repeat(onsets >= first, shapes * len(UNEVEN))
    prior = np.log(np.where(kind > 0, (1.0 - _STEADY) / (shapes - 1), _STEADY))
    prior += np.log(np.where(later, (1.0 - at_once) / max(len(onsets) - 1, 1), at_once))
    places = (at - first).astype(np.int64)
    last = np.append(places, int(now - first))  # the state is today's, whether today's flight is usable or not
    path = np.ascontiguousarray(table[:, :, last].transpose(1, 2, 0))
    found = _filtered(path, np.array(UNEVEN), k, variance, _RATE, _PASSES)
    level, rate, a, b, c, fit = found.reshape(-1, 6).T
    sigma = np.sqrt(np.maximum(c, 1e-18))
    weight = _COUNTS * fit + prior + log_ndtr(rate / sigma)
    weight = np.exp(weight - weight.max())
    worn = table[:, 0, -1][shape]
    return Wear(weight / weight.sum(), level, rate, np.stack([a, b, c], axis=1), age, power, growth, uneven, worn)


@recursion
def _filtered(path, uneven, k, variance, rate_sigma, passes):  # pragma: no cover (compiled)
    """(shapes, uneven, 6): level, rate, their (co)variances, log likelihood; path (2, flights + 1, shapes).

    All shapes stand side by side in each step, which a processor takes several of at once.
    """
    shapes, flights = path.shape[2], len(k)
    found = np.zeros((shapes, len(uneven), 6))
    usual, spread, x, r = np.empty(shapes), np.empty(shapes), np.empty(shapes), np.empty(shapes)
    a, b, c = np.empty(shapes), np.empty(shapes), np.empty(shapes)
    squared, product, logarithm = np.empty(shapes), np.empty(shapes), np.empty(shapes)
    for way in range(len(uneven)):
        for j in range(shapes):
            usual[j] = max((k[flights - 1] - k[0]) / max(path[0, flights, j] - path[0, 0, j], 1.0), 1e-5)
        for _ in range(passes):
            for j in range(shapes):
                x[j], r[j] = k[0], 0.0
                a[j], b[j], c[j] = variance[0], 0.0, rate_sigma**2
                squared[j], product[j], logarithm[j] = 0.0, 1.0, 0.0
                usual[j] = (uneven[way] * usual[j]) ** 2
            for i in range(1, flights):
                for j in range(shapes):
                    d = path[0, i, j] - path[0, i - 1, j]
                    level, both = x[j] + d * r[j], b[j] + d * c[j]
                    known = a[j] + d * (b[j] + both) + usual[j] * (path[1, i, j] - path[1, i - 1, j])
                    s = known + variance[i]
                    gap = k[i] - level
                    share = 1.0 / s
                    squared[j] += gap * gap * share
                    product[j] *= s
                    ga, gb = known * share, both * share
                    x[j], r[j] = level + ga * gap, r[j] + gb * gap
                    a[j], b[j], c[j] = known - ga * known, both - gb * known, c[j] - gb * both
                if i % 8 == 0:  # one logarithm for several flights
                    for j in range(shapes):
                        logarithm[j] += np.log(product[j])
                        product[j] = 1.0
            for j in range(shapes):
                spread[j], usual[j] = usual[j], max(r[j], 1e-5)
        for j in range(shapes):
            d = path[0, flights, j] - path[0, flights - 1, j]
            both = b[j] + d * c[j]
            q = spread[j] * (path[1, flights, j] - path[1, flights - 1, j])
            found[j, way, 0], found[j, way, 1] = x[j] + d * r[j], r[j]
            found[j, way, 2], found[j, way, 3], found[j, way, 4] = a[j] + d * (b[j] + both) + q, both, c[j]
            found[j, way, 5] = -0.5 * (squared[j] + logarithm[j] + np.log(product[j]))
    return found


# --- remaining life: the flights until k first crosses its threshold, as a distribution -------------------------------

_MORE = 4  # times as many are drawn as are kept
_LEAST_RATE = 1e-5  # of k in a flight; what wears less is not told from what wears nothing


@dataclass(frozen=True)
class Crossing:
    """How likely k crosses its threshold soon."""

    flights: Annotated[int, Meta(description="within so many from the last one on")]
    probability: Annotated[float, Meta(description="0 … 1")]


@dataclass(frozen=True, eq=False)
class Remaining:
    """Flights until k first crosses its threshold, from the last flight on."""

    p05: Annotated[float, Meta(description="flights; 5 % of such units cross earlier")]
    p50: Annotated[float, Meta(description="flights; half of such units cross earlier")]
    p95: Annotated[float, Meta(description="flights; 95 % of such units cross earlier")]
    samples: Array  # sorted, of the distribution

    @property
    def crossing(self) -> tuple[Crossing, ...]:
        """Of several numbers of flights."""
        return tuple(Crossing(flights, self.within(flights)) for flights in AHEAD)

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
