"""What a true model would leave: the floor of each signal with its band, and the noise model of a fit's likelihood."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.fft import dct
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d
from scipy.special import gammaln

from ema_model.actuator import Actuator
from ema_model.models import Model, Window
from ema_model.models.model import Signals
from ema_model.quantities import HALF_90, SIGNALS
from ema_model.recordings.signals import SCATTER, white_noise

# --- how well a floor is known: between which multiples of it the error of a true model lies --------------------------

Array = NDArray[np.float64]

_ROUNDING = 1e-9
_KNOWN_TO = 0.02  # of a floor: a few in a hundred of the noise and of what a fit takes up remain a guess


def spread(floors: Sequence[Floor], signals: Sequence[Collection[str]]) -> float:
    """Standard deviation of a true model's error in floors, pooled over windows and over each window's signals.

    The squared error is a mean: of noise, block by block (or as often as a filter leaves it alike), whose size is
    itself estimated, unless it is a grid's; and of the model's own error, which is one value in 25 ms, or a standstill,
    for all signals.
    A square of a normal value scatters by √2 of its mean.
    """
    variance = total = 0.0
    for one, names in zip(floors, signals):
        size = max(1, round(CORRELATED_S / one.block_s))
        lasting = np.zeros(len(one.counts))
        for name in names:
            of_noise = one.counts * (one.white_part(name) / one.sigma(name)) ** 2
            lasting += one.counts - of_noise
            estimated = 0.0 if name in one.exact else 4.0 * SCATTER / len(of_noise)
            variance += 2.0 * one.alike * float(of_noise @ of_noise) + estimated * float(of_noise.sum()) ** 2
            total += float(one.counts.sum())
        value = np.ceil(np.cumsum(one.counts) / size - _ROUNDING).astype(int)  # a standstill counts 25 ms, in all
        together = np.bincount(value, lasting)
        variance += 2.0 * float(together @ together)
    return float(np.hypot(0.5 * np.sqrt(variance) / total, _KNOWN_TO)) if total else _KNOWN_TO


def least(floors: Sequence[Floor], signals: Sequence[Collection[str]]) -> float:
    """The error in floors of a true model of which nothing is there that the floors only allow for, pooled likewise."""
    left = total = 0.0
    for one, names in zip(floors, signals):
        for name in names:
            allowed = (one.allowed[name] / one.sigma(name)) ** 2 if name in one.allowed else np.zeros(len(one.counts))
            left += float(one.counts @ (1.0 - allowed))
            total += float(one.counts.sum())
    return float(np.sqrt(left / total)) if total else 1.0


def band(spread: float, least: float = 1.0) -> tuple[float, float]:
    """Between which multiples of the floor nine of ten true models' errors lie; `least`: what a floor is made of."""
    half = HALF_90 * spread
    return max(0.0, 1.0 - half) * least, 1.0 + half


# --- whether a signal tells anything at all of a model ----------------------------------------------------------------

CONSTANT, BELOW_FLOOR = "constant", "floor"  # why one does not


def tells_nothing(values: Array, name: str, noise: Array | float, floor: Array | float) -> str:
    """Why a signal (n,) tells nothing of any model; "" where it does.

    `CONSTANT`, or `BELOW_FLOOR` where what it has beyond its noise is no larger than the floor, so that a model which
    says nothing would pass as well.  A position counts from its mean, a current, a torque and a speed from 0.
    name: the signal's inside; noise, floor: standard deviations in its unit, numbers or (n,).
    """
    if not np.ptp(values) > _ROUNDING * np.max(np.abs(values)):
        return CONSTANT
    from_mean = SIGNALS[name].kind == "position"
    size2 = float(np.var(values) if from_mean else np.mean(values**2))
    beyond = size2 - float(np.mean(np.square(noise)))
    return "" if beyond > float(np.mean(np.square(floor))) else BELOW_FLOOR


# Whose residual is explained: what drives the motor, where it is measured; a loop's motion follows any physics.
ORDER_OF_PRIMARY = ("current_A", "motor_torque_Nm", "user_position_rad", "motor_position_rad", "motor_speed_rad_s")


def silent(windows: Sequence[Window], floors: Sequence[Floor]) -> tuple[str, str]:
    """The first signal of `ORDER_OF_PRIMARY`, and `tells_nothing` of it in all recordings; "" where one tells."""
    name = next((name for name in ORDER_OF_PRIMARY if any(name in one.measured for one in windows)), "")
    found = ""
    having = [(window, one) for window, one in zip(windows, floors) if name in window.measured]
    for recording in dict.fromkeys(window.recording for window, _ in having):
        parts = [pair for pair in having if pair[0].recording == recording]
        values = np.concatenate([window.measured[name] for window, _ in parts])
        noise = np.concatenate([np.full(window.blocks, one.noise[name]) for window, one in parts])
        found = tells_nothing(values, name, noise, np.concatenate([one.sigma(name) for _, one in parts]))
        if not found:
            break
    return name, found


# --- the floor of a comparison: what a perfect Monitor Model would still differ from a recording by -------------------
# Two parts, for each signal and block: the sensors' noise, estimated from the recording itself, and the model floor,
# how far the Monitor Model is from its three-phase twin under the same command (MODEL §2). The twin differs most in
# transients, so its floor is local: the rms within 12.5 ms on either side. Where the motor stands, friction holds it
# at any place in a band, and the model's error there is one error, however long it stands. When a command jumped is
# known to within a sample, which moves the transient that follows; how it went between samples is not known at all.
#
# A fit takes part of the twin's difference up in its parameters: `after_fit` tells what a true model then leaves.

BAND_SIGMAS = 2.0  # σ on either side: 95 of 100 blocks of a perfect model lie within
CORRELATED_S = 0.025  # how long the model's error, and a sensor's inaccuracy, stay alike
_LEAST_OF_NOISE = 0.5  # that is always taken for the sensors'
DRAWS = 16  # of the twin's difference, which relays and sticking make another one at the least change: as many as
# the three-phase kernel runs at once, and so for the price of one
_INERTIA = "motor.inertia_kgm2"
_APART = 1e-4  # of the inertia, between draws: nobody knows it as well
_STILL = 8.0  # of a position's noise, within which it stands
POSITIONS = ("motor_position_rad", "user_position_rad")
SPEED = "motor_speed_rad_s"  # which counts where no position is: it is mostly one's difference


@dataclass(frozen=True, eq=False)
class Floor:
    """Standard deviations per block of one window, by signal, in the signals' units."""

    noise: dict[str, float]  # white
    model: dict[str, Array]  # (blocks,)
    repeats: Array  # (blocks,), over how many blocks the model's error stays alike
    block_s: float
    white: frozenset[str] = frozenset()  # signals whose model error does not last while the motor moves
    left: Mapping[str, Array] = field(default_factory=dict)  # of `model`, that a fit does not take up, (blocks,) each
    beating: Mapping[str, Array] = field(default_factory=dict)  # of quantisation, (blocks,); told once it was fitted
    held_s: Mapping[str, Array] = field(default_factory=dict)  # how long a reading stays the same, (blocks,)
    samples: int = 1  # in a block
    allowed: Mapping[str, Array] = field(default_factory=dict)  # of `model`, what need not be there, (blocks,) each
    alike: float = 1.0  # over how many blocks the noise stays alike
    exact: frozenset[str] = frozenset()  # signals whose noise is known, and not estimated
    turning: Mapping[str, Array] = field(default_factory=dict)  # of a filtered motion, (blocks,); told, not weighed by
    even: bool = False  # a fit counts the noise of all blocks alike: far from the floor it is no reading's error

    def sigma(self, signal: str) -> Array:
        """Both together, (blocks,); once fitted, what a true model leaves: `left` in place of `model`."""
        noise = np.hypot(np.hypot(self.white_part(signal), self._held(signal)), self.turning.get(signal, 0.0))
        if signal not in self.left:
            return np.hypot(noise, self.model[signal])
        return np.hypot(np.hypot(noise, self.beating.get(signal, 0.0)), self.left[signal])

    def fit_sigma(self, signal: str) -> Array:
        """What to weight a fit by: what lasts counts as often as it repeats, (blocks,)."""
        repeats = self.repeats
        if signal in self.white:
            repeats = np.where(repeats > np.min(repeats), repeats, 1.0)
        return np.hypot(self.fit_noise(signal), np.sqrt(repeats) * self.model[signal])

    def fit_noise(self, signal: str) -> Array:
        """The noise as a fit counts it: a reading that is held is one in 25 ms, not one a sample, (blocks,).

        So is noise as often as a filter leaves it alike.
        """
        if self.even or signal not in self.held_s:
            return np.full(len(self.repeats), np.sqrt(self.alike) * self.noise[signal])
        lasts = np.minimum(self.held_s[signal], CORRELATED_S) / self.block_s
        return np.hypot(self.white_part(signal), np.sqrt(np.maximum(1.0, lasts)) * self._held(signal))

    def white_part(self, signal: str) -> Array:
        """Of the noise, what a mean over 25 ms takes away, (blocks,)."""
        return self.noise[signal] * np.sqrt(1.0 - self._held_share(signal))

    def _held(self, signal: str) -> Array:
        """Of quantisation, what lasts: a mean takes nothing of it away, not that of a block either, (blocks,)."""
        return self.noise[signal] * np.sqrt(self.samples * self._held_share(signal))

    def _held_share(self, signal: str) -> Array:
        """Of the noise's variance, (blocks,).

        A motion that crosses m < 1 steps of a grid in a time is read off by e there, in the mean, where e is uniform
        over 1 − m of a step: the reading stays the same for 1/m of that time.
        """
        if signal not in self.held_s:
            return np.zeros(len(self.repeats))
        return (1.0 - np.minimum(1.0, CORRELATED_S / self.held_s[signal])) ** 2

    @property
    def counts(self) -> Array:
        """How much each block counts in a mean over time, (blocks,): 25 ms of motion as much as a whole standstill."""
        return np.min(self.repeats) / self.repeats

    def beside(self, other: Floor) -> Floor:
        """The greater model floor of two, block by block."""
        return replace(self, model={name: np.maximum(self.model[name], other.model[name]) for name in self.model})


def floor(
    model: Model,
    place: int,
    k: ArrayLike | None = None,
    stated: Mapping[str, Mapping[str, float]] | None = None,
    *,
    whole_noise: bool = False,
) -> Floor:
    """The floor of one of a model's windows, by its place.

    k: where the twins are run; without it, at the actuator's own.  stated: what is known of the sensors, by signal:
    "noise" (white, rms per sample) in place of the estimate, "accuracy" (slow, rms) besides it.
    whole_noise: the estimate as it is, without the twins' ripple taken off.
    """
    window, given = model.windows[place], stated or {}
    told = {name: one["noise"] for name, one in given.items() if "noise" in one}
    draws, late = twin_error(model, place, None, k), model.a_sample_late(place, k)
    between = model.between_samples(place, k)
    noise = model.noise(place, told)
    if not whole_noise:
        noise |= {name: _of_sensors(noise[name], draws[name]) for name in draws if name not in told}
    slow = {}
    for name in noise:
        lasting = local_rms(draws[name], window.block_s) if draws else np.zeros(window.blocks)
        jump = late[name] / np.sqrt(12.0) if late else 0.0  # anywhere within the sample
        drawn = local_rms(between[name], window.block_s) if between else 0.0
        own = np.hypot(np.hypot(lasting, jump), np.hypot(drawn, window.lasting.get(name, 0.0)))
        slow[name] = np.hypot(own, given.get(name, {}).get("accuracy", 0.0))
    return Floor(
        noise,
        slow,
        repeats_of(window, noise),
        window.block_s,
        beating=window.beating,
        turning={name: values for name, values in model.turning(place, k).items() if name in noise},
        held_s=window.held_s,
        samples=window.samples_per_block,
        allowed=window.allowed,
        alike=window.alike,
        exact=frozenset({*window.on_grid, *told}),
    )


def local_rms(values: Array, block_s: float) -> Array:
    """Over 12.5 ms on either side, and over draws where there are some: (blocks,) or (draws, blocks) → (blocks,)."""
    width = max(3, round(CORRELATED_S / block_s) | 1)
    squares = np.mean(np.atleast_2d(values) ** 2, axis=0)
    return np.sqrt(np.maximum(uniform_filter1d(squares, width, mode="nearest"), 0.0))


def _of_sensors(noise: float, draws: Array) -> float:
    """What of a recording's noise is not the inverter's ripple, which the twin's difference has as well."""
    ripple2 = np.mean([white_noise(one) ** 2 for one in draws])
    return float(np.sqrt(max(noise**2 - ripple2, (_LEAST_OF_NOISE * noise) ** 2)))


def twin_error(model: Model, place: int, actuator: Actuator | None = None, k: ArrayLike | None = None) -> Signals:
    """What a model is known to be off by: its twin's measured signals less its own, (draws, blocks); empty without.

    The first draw is of the actuator as it is; the others have a little more inertia each.
    """
    actuator = actuator or model.actuator
    drawn = actuator.varied({_INERTIA: actuator.value(_INERTIA) * (1.0 + _APART * np.arange(DRAWS))})
    faults = np.tile(actuator.k if k is None else np.asarray(k, dtype=float), (DRAWS, 1))
    twins = model.twins(place, drawn, faults)
    own = model.signals(place, drawn, faults, even=True) if twins else {}
    return {name: values - own[name] for name, values in twins.items()}


def twin_errors(model: Model, actuator: Actuator | None = None, k: ArrayLike | None = None) -> list[Signals]:
    """`twin_error` of each of a model's windows."""
    return [twin_error(model, place, actuator, k) for place in range(len(model.windows))]


def as_it_is(draws: Signals) -> Signals:
    """Of `twin_error`, the draw of the actuator as it is: (blocks,) each."""
    return {name: values[0].copy() for name, values in draws.items()}


def repeats_of(window: Window, noise: Mapping[str, float]) -> Array:
    """Blocks over which the model's error stays alike: 25 ms, or as long as the motor stands, (blocks,)."""
    repeats = np.full(window.blocks, max(1.0, CORRELATED_S / window.block_s))
    name = next((name for name in POSITIONS if name in window.measured), None)
    width = round(CORRELATED_S / window.block_s)
    if name is None or width < 2:
        return repeats
    position = window.measured[name]
    moved = maximum_filter1d(position, width) - minimum_filter1d(position, width)
    stands = np.concatenate([[False], moved < _STILL * noise[name], [False]])
    ends = np.flatnonzero(np.diff(stands.astype(int)))
    for first, last in zip(ends[::2], ends[1::2]):
        repeats[first:last] = np.maximum(repeats[first:last], last - first)
    return repeats


# --- the noise model: what sensors and a model that is not quite the rig's leave, in one likelihood -------------------
# A residual over its floor is cut into pieces of an eighth of a second, and each piece is taken apart into cosines of
# the same energy. There an error that lasts stands in few coefficients, and one that comes in bursts in few pieces:
# either counts as the few values that it is. A coefficient is Student's t about 0; its level, a variance in floors², is
# one of its signal and octave of frequency, and is estimated with the model, above what sensors alone leave. So a fall
# of the error beside a large rest that nobody knows is worth its share of that rest, and at the floor it is worth
# itself (Lange, Little and Taylor, J. Am. Stat. Assoc. 84, 1989; Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001).

PIECE = 256  # values: an eighth of a second at 2 kHz

# Degrees of freedom: a line or a burst of ten levels counts as four values of one level.
_FREEDOM = 4.0
# Least level, in floors²: healthy plants leave 0.3 to 0.5 of their current's floor and less of a position's.
_LEAST_LEVEL = 0.5
# Values of level 1 that a level is believed to have been seen in before.
_SEEN_BEFORE = 4.0

_CONSTANT = float(gammaln(0.5 * (_FREEDOM + 1.0)) - gammaln(0.5 * _FREEDOM) - 0.5 * np.log(_FREEDOM * np.pi))


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Of a residual (values,): where its pieces begin and end, and the signal and octave of each coefficient."""

    pieces: tuple[slice, ...]
    group: NDArray[np.intp]  # (values,)
    names: tuple[tuple[str, int], ...]  # of the groups: signal, octave

    @classmethod
    def of(cls, parts: Iterable[tuple[str, slice]]) -> NoiseModel:
        """parts: each window's signals with their rows in a residual, in its order."""
        pieces: list[slice] = []
        keys: list[tuple[str, int]] = []
        for name, rows in parts:
            count = rows.stop - rows.start
            ends = rows.start + np.linspace(0, count, max(1, round(count / PIECE)) + 1).astype(int)
            for start, stop in pairwise(ends):
                pieces.append(slice(int(start), int(stop)))
                cycles = np.arange(stop - start) * PIECE / (stop - start)  # half cycles of a whole piece
                keys += [(name, int(np.ceil(np.log2(one + 1.0)))) for one in cycles]
        names = tuple(dict.fromkeys(keys))
        place = {name: i for i, name in enumerate(names)}
        return cls(tuple(pieces), np.array([place[key] for key in keys], dtype=np.intp), names)

    def coefficients(self, values: Array) -> Array:
        """Of values (values, …) over the floor: the same shape, and the same sum of squares."""
        found = np.empty(values.shape)
        for piece in self.pieces:
            found[piece] = np.asarray(dct(values[piece], axis=0, norm="ortho"))
        return found

    def weights(self, coefficients: Array, levels: Array) -> Array:
        """What each counts in a least-squares step toward the greatest likelihood, (values,)."""
        own = levels[self.group]
        return (_FREEDOM + 1.0) / (_FREEDOM * own + coefficients**2)

    def levels(self, coefficients: Array, start: Array | None = None) -> Array:
        """The most probable level of each group, (groups,), toward which one goes from another guess."""
        count = len(self.names)
        number = np.bincount(self.group, minlength=count)
        found = np.bincount(self.group, coefficients**2, count) / number if start is None else start
        for _ in range(3):
            found = np.maximum(found, _LEAST_LEVEL)
            power = np.bincount(
                self.group, self.weights(coefficients, found) * found[self.group] * coefficients**2, count
            )
            found = (power + _SEEN_BEFORE) / (number + _SEEN_BEFORE)
        return np.maximum(found, _LEAST_LEVEL)

    def log_likelihood(self, coefficients: Array, levels: Array) -> float:
        """Of coefficients with these levels, and of the levels."""
        own = levels[self.group]
        likelihood = (
            _CONSTANT - 0.5 * np.log(own) - 0.5 * (_FREEDOM + 1.0) * np.log1p(coefficients**2 / (_FREEDOM * own))
        )
        prior = -0.5 * _SEEN_BEFORE * (np.log(levels) + 1.0 / levels)
        return float(likelihood.sum() + prior.sum())
