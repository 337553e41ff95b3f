"""Follows k over the flights of one unit: what is found, how, after each flight, and all of it in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model import faults
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation.problem import ECCENTRICITY
from ema_model.quantities import HALF_90, check_number, in_sentence, number
from ema_model.result import Result
from ema_model.text import Document, Lines, Note, Table
from ema_model.tracking.flights import Flight, Series
from ema_model.tracking.trends import (
    AHEAD,
    LEAST_FLIGHTS,
    LONGEST,
    MISFIT_SHARE,
    MISFIT_WINDOW,
    WORN_BEFORE,
    Crossing,
    Remaining,
    Wear,
    remaining,
    wear,
)

# --- what is found ----------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Jump:
    """A sudden step of k."""

    flight: Annotated[str, Meta(description="the first one after it")]
    before: Annotated[float, Meta(description="k before it")]
    after: Annotated[float, Meta(description="k after it")]
    replaced: Annotated[bool, Meta(description="whether it goes towards healthy, as after a part was replaced")]


@dataclass(frozen=True)
class LeftOut:
    """A flight that does not count."""

    flight: Annotated[str, Meta(description="its name")]
    reason: Annotated[str, Meta(description="why")]


@dataclass(frozen=True, eq=False)
class FaultTrack:
    """One k over the flights, 0 … 1, less what the unit's base parameters are found to add."""

    name: str
    trend: Annotated[bool, Meta(description="whether there is evidence that it drifts")]
    level: Annotated[float, Meta(description="k after the last flight")]
    # with what the unit's base parameters may add more or less
    level_interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about level")]
    drift: Annotated[float, Meta(description="of k in a flight; 0 without a trend")]
    drift_interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about drift")]
    since: Annotated[str | None, Meta(description="the flight after which the evidence for a trend sufficed")]
    threshold: Annotated[float | None, Meta(description="of k, at which the life ends; null: none was given")]
    remaining_flights: Annotated[Remaining | None, Meta(description="null: see reason")]
    reason: Annotated[str | None, Meta(description="why nothing is said of the remaining flights")]
    jumps: Annotated[tuple[Jump, ...], Meta(description="in the order of the flights")]
    log_evidence: Annotated[float, Meta(description="natural logarithm, of a trend against none")]
    k: Annotated[Array, Meta(description="of each flight that counts")]
    sigma: Annotated[Array, Meta(description="1 σ of each k, of the flight's own noise")]
    excluded: Annotated[tuple[LeftOut, ...], Meta(description="flights that do not count; the same for every k")]

    @property
    def crossing_probability(
        self,
    ) -> Annotated[tuple[Crossing, ...], Meta(description="empty where remaining_flights is null")]:
        """Of several numbers of flights."""
        return () if self.remaining_flights is None else self.remaining_flights.crossing


@dataclass(frozen=True, repr=False, eq=False)
class Tracked(Result):
    """What the flights of one unit tell, after the last one."""

    flights: tuple[Flight, ...]
    faults: Annotated[dict[str, FaultTrack], Meta(description="k1 … k8, without the angle k7")]
    correlation: Annotated[  # what trades against what
        Array,
        Meta(
            description="(8, 8), of the errors of k1 … k8 in one flight; in place of k6 and k7 their vector's parts",
            extra={"dimensions": 2},
        ),
    ]
    trusted: Annotated[bool, Meta(description="whether the model fits the last flights")]
    warnings: Annotated[tuple[str, ...], Meta(description="what the answer must be read with")]
    seed: int
    actuator: str = ""  # its name

    @property
    def answer(self) -> Annotated[str, Meta(description="in one sentence")]:
        """The first line of what it says."""
        return self.lines[0]

    @property
    def names(
        self,
    ) -> Annotated[
        list[str],
        Meta(description="their names in order of time, those that do not count too", extra={"as": "flights"}),
    ]:
        """As the flights' files are called."""
        return [one.name for one in self.flights]

    @property
    def usable(self) -> list[Flight]:
        """The flights that count."""
        return [one for one in self.flights if not one.excluded]


# --- the tracker ------------------------------------------------------------------------------------------------------

TRACKED = tuple(name for name in faults.NAMES if name != "k7")  # an angle wears nothing
COMPONENTS = len(faults.NAMES)
_ONE_SIDED = 5  # k1 … k5 grow
_GAIN = 7
_RECENT = 10  # flights, over which the unit's share of k̂ is averaged


def check_thresholds(thresholds: Mapping[str, float]) -> None:
    """InputError for a k that is none, that is an angle, or for a threshold that health has passed."""
    for name, value in thresholds.items():
        if name not in faults.NAMES:
            raise InputError(
                f"threshold {quoted(name)}: no such fault; faults are {', '.join(TRACKED)}{did_you_mean(name, TRACKED)}"
            )
        if name not in TRACKED:
            raise InputError(f"threshold {name}: is the direction of k6, and no wear; give k6 a threshold")
        check_number(value, f"threshold {name}")
        if not 0.0 <= value <= 1.0 or value == faults.BY_NAME[name].healthy:
            raise InputError(f"threshold {name} = {value:g}: must lie in 0 … 1, away from the healthy value")


@dataclass(frozen=True, eq=False)
class _Whole:
    """All usable flights: k (n, 8), own (n, 8, 8), common (n, 8, base parameters)."""

    k: Array
    own: Array
    common: Array


class Tracker:
    """Takes one flight after another; `look` tells what is known after the last one."""

    def __init__(self, thresholds: Mapping[str, float] | None = None, seed: int = 0) -> None:
        """thresholds: of k by name.  InputError as `check_thresholds`."""
        self.thresholds = dict(thresholds or {})
        check_thresholds(self.thresholds)
        self._seed = seed
        self._flights: list[Flight] = []
        self._usable: list[Flight] = []
        self._series: Series | None = None

    def add(self, flight: Flight) -> None:
        """The next flight in order of time; InputError where its base parameters are others than before."""
        if self._usable and not flight.excluded and flight.common.shape != self._usable[0].common.shape:
            raise InputError(f"{quoted(flight.name)}: is of another actuator than {quoted(self._usable[0].name)}")
        self._flights.append(flight)
        if flight.excluded:
            return
        if self._series is None:
            healthy = np.array([*[0.0] * _GAIN, faults.HEALTHY[_GAIN]])
            self._series = Series(flight.common.shape[1], np.arange(COMPONENTS) < _ONE_SIDED, healthy)
        self._usable.append(flight)
        self._series.add(float(len(self._flights)), flight)

    def has_trend(self, name: str) -> bool:
        """Whether there is evidence so far that this k drifts."""
        known = self._series
        return known is not None and any(known.trend_at[i] is not None for i in _places(name))

    def look(self) -> Tracked:
        """What is known; InputError before there are enough flights to tell anything."""
        if len(self._usable) < LEAST_FLIGHTS:
            told = f"{len(self._usable)} of {len(self._flights)} flights can be used"
            raise InputError(f"{told}, and a trend needs {LEAST_FLIGHTS} or more; add recordings of more flights")
        last = self._flights[-MISFIT_WINDOW:]
        bad = sum(bool(one.excluded) for one in last)
        trusted = bad < MISFIT_SHARE * len(last)
        warnings = []
        if not trusted:
            warnings.append(
                f"The model does not fit {bad} of the last {len(last)} flights: no trend is trusted; physics that it "
                "lacks may stand behind it; Discover, on these recordings, looks for it."
            )
        whole = _Whole(*(np.stack([getattr(one, part) for one in self._usable]) for part in ("k", "own", "common")))
        own = whole.own.mean(axis=0)
        sigma = np.sqrt(np.diag(own))
        return Tracked(
            flights=tuple(self._flights),
            faults={name: self._fault(name, trusted, whole) for name in TRACKED},
            correlation=own / np.outer(sigma, sigma),
            trusted=trusted,
            warnings=tuple(warnings),
            seed=self._seed,
        )

    def _fault(self, name: str, trusted: bool, whole: _Whole) -> FaultTrack:
        known = self._series
        assert known is not None  # there are flights
        lead = max(_places(name), key=lambda i: (known.trend_at[i] is not None, known.log_evidence[i]))
        trend, threshold = self.has_trend(name), self.thresholds.get(name)
        begin = max(known.start(i) for i in _places(name))
        healthy = faults.BY_NAME[name].healthy
        now = float(len(self._flights))
        base, spread = known.unit.known(_places(name))
        added = whole.common @ base
        way, sign = self._direction(name, (whole.k - added)[begin:], threshold)
        k, own = (whole.k - added) @ way, (whole.own @ way) @ way
        common = np.tensordot(whole.common, way, (1, 0)) @ np.linalg.cholesky(spread)
        factor = float(max(known.noise_factor[list(_places(name))]))
        unit = _unit(common[begin:])
        reason, left, drift, drift90 = "", None, 0.0, (0.0, 0.0)
        if trend:
            stray = np.sum((common[begin:] - _smoothed(common[begin:])) ** 2, axis=1)
            at = np.array(known.at[begin:])
            worn = wear(at, sign * (k[begin:] - healthy), factor * own[begin:] + stray, now)
            level, sigma = _mixed(worn.weight, worn.level, worn.covariance[:, 0])
            level = healthy + sign * level
            drift, spread = _mixed(worn.weight, worn.rate, worn.covariance[:, 2])
            drift *= sign
            drift90 = drift - HALF_90 * spread, drift + HALF_90 * spread
            reason, left = self._left(name, worn, sign * ((threshold or healthy) - healthy), unit, drift, sign)
        else:
            recent = slice(max(begin, len(k) - _RECENT), None)
            weight = 1.0 / (factor * own[recent])
            level = float(np.sum(weight * k[recent]) / np.sum(weight))
            sigma = float(np.sqrt(1.0 / np.sum(weight)))
            reason = "no trend; remaining life not defined"
        if not trusted:
            reason, left = "the model does not fit the last flights; remaining life not told", None
        sigma = float(np.sqrt(sigma**2 + unit[1, 1]))
        low, high = (float(np.clip(level + z * sigma, 0.0, 1.0)) for z in (-HALF_90, HALF_90))
        seen = known.trend_at[lead]
        since = None if seen is None else self._usable[seen].name
        return FaultTrack(
            name=name,
            trend=trend,
            level=float(np.clip(level, 0.0, 1.0)),
            level_interval90=(low, high),
            drift=drift,
            drift_interval90=drift90,
            since=since,
            threshold=threshold,
            remaining_flights=left,
            reason=reason or None,
            jumps=self._jumps(name, known),
            log_evidence=float(known.log_evidence[lead]),
            k=k,
            sigma=np.sqrt(factor * own),
            excluded=tuple(LeftOut(one.name, one.excluded) for one in self._flights if one.excluded),
        )

    def _left(self, name: str, worn: Wear, threshold: float, unit: Array, drift: float, sign: float):
        if name not in self.thresholds:
            return "no threshold was given", None
        if drift * sign <= 0.0:
            return "it moves away from its threshold", None
        begun = WORN_BEFORE * (1.0 - faults.BY_NAME[name].healthy)
        left = remaining(worn, threshold, unit, begun, TRACKED.index(name) < _ONE_SIDED, self._seed)
        if left.p50 >= LONGEST:
            return f"more than {LONGEST:g} flights remain", None
        if left.p95 >= LONGEST:
            return f"more than {left.p05:.0f} flights remain (95 %); it may never reach its threshold", None
        return "", left

    def _direction(self, name: str, k: Array, threshold: float | None) -> tuple[Array, float]:
        """By which a vector of k becomes this k, (8,), and the sign with which it grows; k (n, 8) since the jump."""
        way = np.zeros(COMPONENTS)
        if name == "k6":
            recent = k[-_RECENT:, list(ECCENTRICITY)].mean(axis=0)
            way[list(ECCENTRICITY)] = recent / max(float(np.hypot(*recent)), 1e-12)
            return way, 1.0
        place = faults.NAMES.index(name)
        way[place] = 1.0
        if name != "k8":
            return way, 1.0
        if threshold is not None:
            return way, float(np.sign(threshold - faults.HEALTHY[_GAIN]))
        gain = k[:, _GAIN]
        half = max(1, len(gain) // 2)
        return way, 1.0 if np.mean(gain[-half:]) >= np.mean(gain[:half]) else -1.0

    def _jumps(self, name: str, known: Series) -> tuple[Jump, ...]:
        found, healthy = [], 0.0 if name == "k6" else faults.BY_NAME[name].healthy
        base, _ = known.unit.known()
        for i in _places(name):
            k = [float(one.k[i] - one.common[i] @ base) for one in self._usable] if known.jumps[i] else []
            for place in known.jumps[i]:
                before, after = float(np.median(k[max(0, place - 3) : place])), float(np.median(k[place : place + 3]))
                back = abs(after - healthy) < abs(before - healthy)
                found.append(Jump(self._usable[place].name, before, after, back))
        return tuple(found)


def track(flights: Sequence[Flight], thresholds: Mapping[str, float] | None = None, seed: int = 0) -> Tracked:
    """The whole of it, for flights in order of time; InputError as `Tracker`."""
    tracker = Tracker(thresholds, seed)
    for flight in flights:
        tracker.add(flight)
    return tracker.look()


def _places(name: str) -> tuple[int, ...]:
    return ECCENTRICITY if name == "k6" else (faults.NAMES.index(name),)


def _unit(common: Array) -> Array:
    """(2, 2), covariance of what the base parameters add to k̂ at the first flights and at the last."""
    ends = np.stack([common[:_RECENT].mean(axis=0), common[-_RECENT:].mean(axis=0)])
    return ends @ ends.T


def _smoothed(common: Array) -> Array:
    """What the base parameters do, without what changes from flight to flight, (n, base parameters)."""
    if len(common) < 2:
        return common
    share = np.linspace(0.0, 1.0, len(common))[:, None]
    line = np.concatenate([np.ones_like(share), share], axis=1)
    return line @ np.linalg.lstsq(line, common, rcond=None)[0]


def _mixed(weight: Array, mean: Array, variance: Array) -> tuple[float, float]:
    middle = float(weight @ mean)
    return middle, float(np.sqrt(max(float(weight @ (variance + (mean - middle) ** 2)), 0.0)))


# --- what was known after each flight, and what came then -------------------------------------------------------------


@dataclass(frozen=True)
class Came:
    """What came after a flight."""

    crossed: int | None  # flights later, in which the level of k had reached its threshold; None: not so far
    seen: int  # flights since


@dataclass(frozen=True, eq=False)
class HistoryParts:
    """Of which a history is made: where it is stored, they stand for it."""

    thresholds: dict[str, float]
    seed: int
    flights: list[Flight]
    looks: dict[int, Tracked]  # without their flights, which are the first of these

    def made(self) -> History:
        """The history; InputError for looks that are not of its flights."""
        made = History(self.thresholds, self.seed)
        if not {*self.looks} <= {*range(1, len(self.flights) + 1)}:
            raise InputError("a history's looks are not of its flights")
        made.flights, made._tracker = self.flights, None
        made.looks = {count: replace(one, flights=tuple(self.flights[:count])) for count, one in self.looks.items()}
        return made


class History:
    """The looks of a `Tracker`, flight after flight; flights that arrive at the end cost their own looks alone."""

    def __init__(self, thresholds: Mapping[str, float] | None = None, seed: int = 0) -> None:
        """InputError as `Tracker`."""
        self.thresholds, self._seed = dict(thresholds or {}), seed
        self.looks: dict[int, Tracked] = {}  # by how many flights there were
        self.flights: list[Flight] = []  # in order of time
        self._tracker: Tracker | None = Tracker(self.thresholds, seed)

    def made_of(self) -> HistoryParts:
        """As `ema_model.result` stores it."""
        bare = {count: replace(one, flights=()) for count, one in self.looks.items()}
        return HistoryParts(self.thresholds, self._seed, self.flights, bare)

    def follow(self, flights: Sequence[Flight]) -> Iterator[int]:
        """Looks after each flight, all in order of time; yields how many are done.

        What was taken before is looked at anew only where it is not how these begin.  InputError as `Tracker.add`.
        """
        if [*map(id, self.flights)] != [*map(id, flights[: len(self.flights)])]:
            self.looks, self.flights, self._tracker = {}, [], Tracker(self.thresholds, self._seed)
        if self._tracker is None:  # it was stored
            self._tracker = Tracker(self.thresholds, self._seed)
            for one in self.flights:
                self._tracker.add(one)
        usable = sum(not one.excluded for one in self.flights)
        for one in flights[len(self.flights) :]:
            self._tracker.add(one)
            self.flights.append(one)
            usable += not one.excluded
            if usable >= LEAST_FLIGHTS:
                self.looks[len(self.flights)] = self._tracker.look()
            yield len(self.flights)

    def copy(self) -> History:
        """As it is now; what follows changes this one alone."""
        other = copy(self)
        other.looks, other.flights = dict(self.looks), list(self.flights)
        return other

    @property
    def last(self) -> Tracked | None:
        """After all of them; None before there are enough."""
        return self.looks.get(len(self.flights))

    def crossed(self, name: str) -> int | None:
        """The number of the flight after which the level of a k had first reached its threshold."""
        threshold = self.thresholds.get(name)
        if threshold is None:
            return None
        sign = 1.0 if threshold > faults.BY_NAME[name].healthy else -1.0
        passed = (n for n, look in self.looks.items() if sign * (look.faults[name].level - threshold) >= 0.0)
        return next(passed, None)

    def came(self, number: int, name: str) -> Came:
        """What came after so many flights; a part that is replaced ends nothing."""
        crossed = self.crossed(name)
        later = None if crossed is None or crossed < number else crossed - number
        return Came(later, len(self.flights) - number)


# --- in words: one sentence first, then a table, jumps, what was left out ---------------------------------------------

_MOST_NAMED = 5
_TRADES = 0.5  # correlation from which on two k are said to trade


def answer(result: Tracked) -> str:
    """The short one."""
    drifting = [one for one in result.faults.values() if one.trend]
    if not result.trusted:
        return "the model does not fit the last flights: no trend is trusted"
    if not drifting:
        return "no trend; remaining life not defined"
    return "; ".join(_sentence(one) for one in drifting)


def headline(result: Tracked) -> str:
    """The same to stand above all else; the name of a k stays small."""
    told = answer(result)
    return told if told[:2] in faults.BY_NAME else told[:1].upper() + told[1:]


def document_of(result: Tracked) -> Document:
    """All that the terminal and a notebook show."""
    usable = len(result.usable)
    counted = f"{len(result.flights)} flights, {usable} of them usable"
    blocks = [
        Lines([answer(result), counted]),
        *(Note(warning) for warning in result.warnings),
        _table(result),
    ]
    if ahead := _ahead(result):
        blocks.append(ahead)
    if lines := [*_jumps(result), *_trades(result), *_excluded(result)]:
        blocks.append(Lines(lines))
    return Document(blocks)


def hindsight(then: FaultTrack, came: Came) -> str:
    """What came of what was said of one k: whether it lay within the 90 % interval."""
    if then.threshold is None or not came.seen:
        return ""
    reached = f"{_called(then.name)} reached {then.threshold:g}"
    left = then.remaining_flights
    if came.crossed is None:
        since = "1 flight" if came.seen == 1 else f"{came.seen} flights"
        late = left is not None and came.seen > left.p95
        told = f", which is longer than the 90 % interval ({_flights(left.p95)})" if left and late else ""
        return f"what came: not so far, {since} later{told}"
    when = f"{came.crossed} flights later" if came.crossed != 1 else "1 flight later"
    if left is None:
        return f"what came: {reached}, {when}"
    inside = left.p05 - 0.5 <= came.crossed <= left.p95 + 0.5  # whole flights are counted
    side = "within" if inside else ("before" if came.crossed < left.p05 else "after")
    return f"what came: {reached}, {when}, {side} the 90 % interval"


def _sentence(one: FaultTrack) -> str:
    name = _called(one.name)
    told = f"{name} drifts by {number(one.drift)} a flight ({_interval(one.drift_interval90)})"
    if one.remaining_flights is None:
        return f"{told}: {one.reason}"
    left = one.remaining_flights
    if left.p95 < 0.5:
        return f"{told} and has reached {one.threshold:g}"
    return (
        f"{told} and reaches {one.threshold:g} in about {_flights(left.p50)} flights "
        f"(90 %: {_flights(left.p05)} … {_flights(left.p95)})"
    )


def _table(result: Tracked) -> Table:
    rows, remarks = [], []
    for one in result.faults.values():
        left = one.remaining_flights
        span = f"{_flights(left.p05)} … {_flights(left.p50)} … {_flights(left.p95)}" if left else "–"
        drift = f"{number(one.drift)}" if one.trend else "–"
        threshold = "–" if one.threshold is None else f"{one.threshold:g}"
        rows.append([_called(one.name), f"{one.level:.4f}", _interval(one.level_interval90), drift, threshold, span])
        remarks.append(
            one.reason or "" if not one.trend or one.threshold is not None else "a trend; no threshold was given"
        )
    return Table(("level", "90 % interval", "a flight", "threshold", "flights left 5, 50, 95 %"), rows, remarks=remarks)


def _ahead(result: Tracked) -> Table | None:
    rows = [
        [_called(one.name), *(_chance(soon.probability) for soon in one.crossing_probability)]
        for one in result.faults.values()
        if one.remaining_flights
    ]
    return Table([str(n) for n in AHEAD], rows, "crosses within the next flights, probability") if rows else None


def _jumps(result: Tracked) -> list[str]:
    return [
        f"{_called(one.name)} jumped from {jump.before:.3f} to {jump.after:.3f} before {jump.flight}"
        f"{', as after a part was replaced' if jump.replaced else ''}: it is judged anew from there"
        for one in result.faults.values()
        for jump in one.jumps
    ]


def _trades(result: Tracked) -> list[str]:
    found = []
    places = [i for i in range(len(faults.NAMES)) if i not in ECCENTRICITY]  # its direction has no name of its own
    for i, j in combinations(places, 2):
        share = result.correlation[i, j]
        if abs(share) > _TRADES:
            found.append(f"{faults.NAMES[i]} and {faults.NAMES[j]} ({share:+.2f})")
    return [f"errors of one flight trade between {', '.join(found)}"] if found else []


def _excluded(result: Tracked) -> list[str]:
    left_out = [one for one in result.flights if one.excluded]
    lines = []
    for reason, count in Counter(one.excluded for one in left_out).items():
        names = [one.name for one in left_out if one.excluded == reason]
        more = f" and {count - _MOST_NAMED} more" if count > _MOST_NAMED else ""
        lines.append(f"left out: {', '.join(names[:_MOST_NAMED])}{more} ({reason})")
    return lines


def _called(name: str) -> str:
    return f"{name} {in_sentence(faults.BY_NAME[name].title)}"


def _interval(ends: tuple[float, float]) -> str:
    return f"{number(ends[0])} … {number(ends[1])}"


def _flights(count: float) -> str:
    return f"{count:.0f}" if count < 1e4 else "over 10000"


def _chance(p: float) -> str:
    return f"{p:.3f}" if p >= 5e-4 else "< 0.001"
