"""Follows k over the flights of one unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model import faults
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation.problem import ECCENTRICITY
from ema_model.quantities.numbers import HALF_90, check_number
from ema_model.tracking.evidence import LEAST_FLIGHTS, LONGEST, MISFIT_SHARE, MISFIT_WINDOW, WORN_BEFORE
from ema_model.tracking.flights import Flight
from ema_model.tracking.remaining import Wear, remaining, wear
from ema_model.tracking.result import FaultTrack, Jump, LeftOut, Tracked
from ema_model.tracking.series import Series

Array = NDArray[np.float64]

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
