"""The flights of a unit: their files in order of time, k of each, and what all of them tell of its base parameters."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from math import log
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.identification.run import Progress, identify
from ema_model.identification.search import Objective
from ema_model.physics.jit import recursion
from ema_model.recordings import Measurement, check_one_actuator
from ema_model.recordings.formats import FORMATS
from ema_model.recordings.recording_set import long_enough, recordings_in
from ema_model.tracking.trends import (
    FALSE_TREND,
    GROWN_BY,
    JUMP_AFTER,
    JUMP_LEAST,
    JUMP_SURE,
    JUMP_WINDOW,
    LEAST_FLIGHTS,
    WORN_BEFORE,
    Evidence,
    jump,
)

# --- one flight as the tracking sees it: k as its recording tells it, and how sure that is, in two parts --------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flight:
    """k̂ = k + common · u + e, the eccentricity as a vector in the places of k6 and k7 (see `estimation.problem`).

    u are the unit's base parameters in σ of their tolerances: the same numbers in all its flights, so that they move
    no trend.  e is the flight's own: its sensors' noise, its start, the model's own error on its command.
    """

    name: str
    k: Array  # (8,), unbounded: noise may take it beyond 0 and 1
    own: Array  # (8, 8), covariance of e
    common: Array  # (8, base parameters)
    excluded: str = ""  # why it says nothing of k; empty where it does


# --- the flights of a unit in order of time, as their files' names tell it: by the numbers in them, date or count -----

_NUMBER = re.compile(r"\d+")


def flights_in(folder: Path) -> list[Path]:
    """The recordings of a folder in order; InputError where it is none, holds none, or a name tells no time."""
    found = recordings_in(folder)
    if not found:
        raise InputError(f"{quoted(folder)}: holds no recording ({', '.join(FORMATS)})")
    for inner in (path for path in sorted(folder.iterdir()) if path.is_dir()):
        if recordings_in(inner):
            told = f"{quoted(folder)}: there are recordings beside it in its folder {quoted(inner.name)}"
            raise InputError(f"{told}; a folder holds the flights of one unit, so move them or name the files")
    return in_order(found)


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Flights in order of time; InputError for a name that tells none."""
    return sorted(paths, key=_when)


def check_order(paths: Sequence[Path]) -> None:
    """InputError for flights out of order, at the same time, or of several actuators, by what their files say."""
    for before, after in pairwise(paths):
        if _when(before) == _when(after):
            raise InputError(
                f"{quoted(before.name)} and {quoted(after.name)}: have the same number or date in their names, so that "
                "nothing tells which flew first; rename them"
            )
        if _when(before) > _when(after):
            raise InputError(
                f"{quoted(after.name)}: comes after {quoted(before.name)}, though its name says that it flew before; "
                "give the flights in order of time"
            )
    check_one_actuator(paths, "the flights are of one unit")


def check_enough(flights: Sized, where: str) -> None:
    """InputError for fewer flights than a trend needs; where: what was named."""
    if len(flights) < LEAST_FLIGHTS:
        told = "1 flight tells" if len(flights) == 1 else f"{len(flights)} flights tell"
        raise InputError(f"{quoted(where)}: {told} no trend; give {LEAST_FLIGHTS} or more, or use `emaviz identify`")


def _when(path: Path) -> tuple[int, ...]:
    numbers = tuple(int(one) for one in _NUMBER.findall(path.stem))
    if not numbers:
        raise InputError(f"{quoted(path.name)}: its name has no number or date that tells when it flew; rename it")
    return numbers


# --- recordings of flights → k of each, with what its identification leaves open --------------------------------------

UNFIT = "the model does not fit this flight, whatever k"
UNTOLD = "this flight hardly tells k"
_UNTOLD_OF = 4  # of the k, from which on a flight is of no use


def identified(
    recording: Measurement,
    name: str,
    actuator: Actuator,
    seed: int = 0,
    on_iteration: Callable[[Progress], None] | None = None,
) -> Flight:
    """One flight by the robust identification; excluded where the model does not fit it or it tells too little."""
    sure = identify(Objective([recording], actuator), seed=seed, on_iteration=on_iteration).uncertainty
    excluded = ""
    if not sure.adequate:
        excluded = UNFIT
    elif len(sure.hardly_known) >= _UNTOLD_OF:
        excluded = UNTOLD
    return Flight(name, sure.unbounded, sure.own, sure.common, excluded)


def identify_all(
    paths: Sequence[Path],
    read: Callable[[Path], Measurement],
    actuator: Actuator,
    seed: int = 0,
    on_flight: Callable[[int, str], None] = lambda number, name: None,
    left_out: Callable[[str], None] = lambda line: None,
) -> Iterator[Flight]:
    """One after another; of several, one that is too short is left out.  Raises InputError for what cannot be read."""

    def read_next(numbered: tuple[int, Path]) -> Measurement:
        number, path = numbered
        on_flight(number, path.name)
        return read(path)

    for (_, path), recording in long_enough(enumerate(paths), read_next, left_out):
        yield identified(recording, path.stem, actuator, seed)


# --- what a unit's base parameters add to k̂, stated for one state of wear --------------------------------------------
# Backlash is the play × (1 + 99 k2), so that what is uncertain of the play (15 %) moves k2 in proportion to what wear
# has made of it: a flight's sensitivity grows with the very k that it tells.  Taken as it is it would explain any
# growth of k2 by a unit that is 1/0.15 σ off, and no growth costs more.  Of a k that does not wear the sensitivity may
# differ between commands and loads, but does not grow with that k.  Other faults grow theirs too little to be explained
# by it.


def growth(k: ArrayLike) -> Array:
    """(…, 8), by what the sensitivity of each k̂ (…, 8) to the base parameters grows with that k itself.

    k̂ may lie beyond its range, as noise takes it, and counts as its nearest end: there it was linearised.
    """
    grown = np.ones(np.shape(k))
    grown[..., 1] = faults.physical(np.clip(k, 0.0, 1.0)).backlash_factor
    return grown


# --- what all flights of a unit, and all its k, tell of its base parameters -------------------------------------------
# What these add can then be taken out of k̂.
# k̂_t = x_t + s_t · u + e_t (`tracking.flight`), with the same u in every flight and in all eight k.  Commands and
# loads change s_t, so that flights beside each other differ by u; and each part had begun little worn, so that what all
# k̂ stood off by at first is mostly u's.  A Kalman filter follows the levels x, their drifts, where they began, and u.
# It knows no law of wear: flights may wear very unevenly, and a level may step.
#
# s_t also changes with wear, which no u may explain (`tracking.sensitivity`): what counts is s of a part's first
# flights and how a flight's differs from those of the last ones; of a k whose sensitivity grows with it, the first
# alone.

FIRST = 10  # flights of a part, by which its sensitivities at first are told
_LAST = 20  # flights, from whose mean a flight's sensitivities differ by command and load
_ANYWHERE = 1.0  # of k, 1 σ of a level of which nothing is known yet
_DRIFT = 0.01  # of k in a flight, the same of a drift
# In a flight a level strays by so many of its drifts (the harder ones wear more, and differ in s_t as well: what they
# wear must not pass for what u adds), and by so much of k without one; and so does a drift itself.
_UNEVEN, _CREEP = 4.0, 3e-4
_TURNS, _TURN = 0.1, 2e-5
_STEP = 2.5  # σ, beyond which a level has stepped
_LINEAR = 0.05  # what a base parameter adds is as stated but for such a share
_TOLD = 0.1  # σ of a tolerance, and no better is u told by however many flights, as all is linear only nearly
_TOGETHER = 0.6  # of WORN_BEFORE, 1 σ of what all parts of a unit had worn more or less than is usual
_HALF_MEAN, _HALF_SIGMA = np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)  # of what is normal, but not below 0


class Unit:
    """Takes one flight after another; `known` tells of u."""

    def __init__(self, base: int, one_sided: NDArray[np.bool_], healthy: Array) -> None:
        """base: how many base parameters; one_sided, healthy (k,): whether each only grows, and where it begins."""
        self._count = count = len(healthy)
        worn_before = WORN_BEFORE * (1.0 - healthy)  # of the way that there is
        self._begun = healthy + np.where(one_sided, worn_before * _HALF_MEAN, 0.0)
        together = _TOGETHER * worn_before * one_sided
        alone = worn_before * np.where(one_sided, _HALF_SIGMA, 1.0)
        self._begun_covariance = np.diag(alone**2) + np.outer(together, together)
        size = 3 * count + base
        self._mean = np.zeros(size)  # levels, drifts, where each began, u
        self._covariance = np.eye(size)
        for i in range(count):
            self._unknown(i, float(healthy[i]))
        self._differs = growth(np.ones(count)) == 1.0
        self._flights = np.zeros(count)  # of each part
        self._first = np.zeros((count, base))  # the mean of its first ones' sensitivities
        self._last: deque[Array] = deque(maxlen=_LAST)
        self._at = np.nan

    def copy(self) -> Unit:
        """As it is now; flights that this one takes do not change it."""
        other = copy(self)
        other._mean, other._covariance, other._last = self._mean.copy(), self._covariance.copy(), self._last.copy()
        other._flights, other._first = self._flights.copy(), self._first.copy()
        return other

    def add(self, at: float, k: Array, own: Array, common: Array) -> None:
        """The flight's number; k̂ (k,), own covariance (k, k), common (k, base parameters)."""
        self._last.append(common)
        self._flights += 1.0
        first = self._flights <= FIRST
        self._first[first] += (common[first] - self._first[first]) / self._flights[first, None]
        rows = np.zeros((self._count, len(self._mean)))
        rows[:, : self._count] = np.eye(self._count)
        differs = common - np.mean(self._last, axis=0)
        rows[:, 3 * self._count :] = self._first + np.where(self._differs[:, None], differs, 0.0)
        own = own + np.diag((_LINEAR * np.linalg.norm(common, axis=1)) ** 2 + 1e-12)
        if not np.isnan(self._at):
            _ahead(self._mean, self._covariance, self._count, at - self._at)
        self._at = at
        gap = k - rows @ self._mean
        expected = np.sum((rows @ self._covariance) * rows, axis=1) + np.diag(own)
        places = np.arange(self._count)
        self._covariance[places, places] += np.where(gap**2 > _STEP**2 * expected, gap**2, 0.0)
        root = np.linalg.inv(np.linalg.cholesky(own))
        _see(self._mean, self._covariance, root @ rows, root @ k)

    def replaced(self, i: int) -> None:
        """Before the flight in which a part is new to us: where the last one began is taken up, the level is any."""
        self._mean, self._covariance = self._with([i])
        self._unknown(i, float(self._mean[2 * self._count + i]))
        self._flights[i], self._first[i] = 0.0, 0.0

    def known(self, apart: tuple[int, ...] = ()) -> tuple[Array, Array]:
        """Mean and covariance of u; where the parts of these k began counts as not known."""
        mean, covariance = self._with([i for i in range(self._count) if i not in apart])
        base = slice(3 * self._count, None)
        return mean[base], covariance[base, base] + _TOLD**2 * np.eye(len(mean[base]))

    def _with(self, parts: list[int]) -> tuple[Array, Array]:
        """What is known once it is said that these parts had begun little worn."""
        places = [2 * self._count + i for i in parts]
        to = self._covariance[:, places]
        gain = np.linalg.solve(to[places] + self._begun_covariance[np.ix_(parts, parts)], to.T).T
        return self._mean + gain @ (self._begun[parts] - self._mean[places]), self._covariance - gain @ to.T

    def _unknown(self, i: int, about: float) -> None:
        level, drift, begun = i, self._count + i, 2 * self._count + i
        for place in (level, drift, begun):
            self._covariance[place], self._covariance[:, place] = 0.0, 0.0
        self._mean[[level, begun]], self._mean[drift] = about, 0.0
        self._covariance[np.ix_([level, begun], [level, begun])] = _ANYWHERE**2
        self._covariance[drift, drift] = _DRIFT**2


@recursion
def _ahead(mean, covariance, count, ahead):  # pragma: no cover (compiled)
    """In place: so many flights later."""
    size = len(mean)
    for i in range(count):
        drift = count + i
        mean[i] += ahead * mean[drift]
        for j in range(size):
            covariance[i, j] += ahead * covariance[drift, j]
        for j in range(size):
            covariance[j, i] += ahead * covariance[j, drift]
        worn = abs(mean[drift])
        covariance[i, i] += ahead * ((_UNEVEN * worn) ** 2 + _CREEP**2)
        covariance[drift, drift] += ahead * ((_TURNS * worn) ** 2 + _TURN**2)


@recursion
def _see(mean, covariance, rows, seen):  # pragma: no cover (compiled)
    """In place: what is seen (k,), of unit variance, by rows (k, state); the covariance is symmetric."""
    size, to = len(mean), np.empty(len(mean))
    for row in range(len(seen)):
        to[:] = 0.0
        for i in range(size):
            for j in range(size):
                to[j] += covariance[i, j] * rows[row, i]
        total, gap = 1.0, seen[row]
        for i in range(size):
            total += rows[row, i] * to[i]
            gap -= rows[row, i] * mean[i]
        gap /= total
        for i in range(size):
            mean[i] += to[i] * gap
            for j in range(size):
                covariance[i, j] -= to[i] * to[j] / total


# --- all k over the flights so far: their evidence, and where each jumped, from where on it is judged anew ------------


class Series:
    """The components of k, (8,), flight by flight; a place is that of a usable flight."""

    def __init__(self, base: int, one_sided: NDArray[np.bool_], healthy: Array) -> None:
        """one_sided, healthy (8,): whether each only grows, and where it begins."""
        self._healthy, count = healthy, len(healthy)
        self._evidence = Evidence(base, one_sided)
        self.unit = Unit(base, one_sided, healthy)
        self._units: dict[int, Unit] = {}  # before each of the last flights
        self.at: list[float] = []
        self.flights: list[Flight] = []
        self.jumps: list[list[int]] = [[] for _ in range(count)]  # places of the first flight after each
        self.trend_at: list[int | None] = [None] * count  # place of the flight after which the evidence sufficed
        self.log_evidence = np.zeros(count)

    def add(self, at: float, flight: Flight) -> None:
        """One usable flight more, and its number."""
        self.at.append(at)
        self.flights.append(flight)
        self._weigh(len(self.at) - 1, np.arange(len(self._healthy)))
        self._follow(len(self.at) - 1)
        found = [place for i in range(len(self._healthy)) if (place := self._jump(i)) is not None]
        if found:  # some flights after it came
            self.unit = self._units[min(found)].copy()
            for place in range(min(found), len(self.at)):
                self._follow(place)

    def start(self, i: int) -> int:
        """Place of the first flight since the last jump of a component."""
        return self.jumps[i][-1] if self.jumps[i] else 0

    @property
    def noise_factor(self) -> Array:
        """(8,), seen over stated variance."""
        return self._evidence.noise_factor

    def _follow(self, place: int) -> None:
        """What the flight tells of the unit."""
        self._units[place] = self.unit.copy()
        self._units.pop(place - JUMP_WINDOW - JUMP_SURE, None)
        for i, jumps in enumerate(self.jumps):
            if place in jumps:
                self.unit.replaced(i)
        flight, spread = self.flights[place], np.sqrt(self.noise_factor)
        self.unit.add(self.at[place], flight.k, spread[:, None] * flight.own * spread, flight.common)

    def _jump(self, i: int) -> int | None:
        """The place of a jump that is found now."""
        if not self._may_have_jumped(i):
            return None
        first = max(self.start(i), len(self.at) - JUMP_WINDOW - JUMP_SURE)
        last = self.flights[first:]
        base, covariance = self.unit.known()
        common: Array = np.array([one.common[i] for one in last])
        found = jump(
            np.array([one.k[i] for one in last]) - common @ base,
            np.array([one.own[i, i] for one in last]),
            common @ np.linalg.cholesky(covariance),
            float(self._healthy[i]),
        )
        if found is None:
            return None
        self.jumps[i].append(first + found)
        self.trend_at[i], self.log_evidence[i] = None, 0.0
        self._evidence.forget(i)
        for place in range(self.start(i), len(self.at)):
            self._weigh(place, np.array([i]))
        return self.start(i)

    def _at_begin(self, place: int) -> Array:
        """(8,), the share of a flight's sensitivities that was there in each k's first flight since its last jump.

        Told by the flights before it: by its own k̂ the noise of that would stand in the sensitivity as well.
        """
        last = np.stack([one.k for one in self.flights[max(0, place - GROWN_BY) : place]] or [self.flights[0].k])
        begin = [self.start(i) for i in range(len(self._healthy))]
        first = np.array([self.flights[at].k[i] for i, at in enumerate(begin)])
        before = [last[-(place - at) :, i].mean() if place > at else first[i] for i, at in enumerate(begin)]
        return growth(first) / growth(before)

    def _may_have_jumped(self, i: int) -> bool:
        """Whether the last flights stand far enough from those before them; asked of all, so it must be quick."""
        return any(self._stands_off(i, after) for after in (JUMP_AFTER, JUMP_SURE))

    def _stands_off(self, i: int, after: int) -> bool:
        last = [float(one.k[i]) for one in self.flights[-2 * after :]]
        low, high = sorted(last[:after]), sorted(last[after:])
        return len(last) == 2 * after and abs(high[after // 2] - low[after // 2]) > JUMP_LEAST

    def _weigh(self, place: int, which: NDArray[np.int64]) -> None:
        flight = self.flights[place]
        own = np.diagonal(flight.own)
        common = flight.common * self._at_begin(place)[:, None]
        self.log_evidence[which] = self._evidence.add(self.at[place], flight.k, own, common, which)
        for i in which:
            # After each jump half of the probability of a false trend is spent, so that all together stay below it.
            needed = log(len(self._healthy) / FALSE_TREND) + (len(self.jumps[i]) + 1) * log(2.0)
            if self.trend_at[i] is None and self.log_evidence[i] >= needed:
                self.trend_at[i] = place
