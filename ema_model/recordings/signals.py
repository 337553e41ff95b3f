"""What signals tell by themselves: their noise and steps, how late one comes, and a window of one in numbers."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.quantities import SIGNALS

# --- the white noise of a recorded signal, from the signal itself -----------------------------------------------------

Array = NDArray[np.float64]

# What no sensor and no simulation resolves, by the kind of signal, in its unit: the noise of one that hardly tells its
# own, because it was calculated or does not change.
_FINEST = {"position": 1e-9, "speed": 1e-6, "current": 1e-6, "torque": 1e-8, "force": 1e-6}

_ORDERS = range(3, 9)  # of the differences: a smooth motion has no third ones, but where it is sampled slowly
_LEVEL = 0.98  # of an order's noise, that the next order's must reach: noise is white, and motion is not
_PIECE, _SLOW = 64, 0.25  # samples, and the share of such pieces in which a signal moves slowly
_ROUNDING, _ON_GRID = 1e-12, 0.01  # of a value, and of a grid's step
_BEAT = 0.25  # of a beat, that a mean spans
_LASTS = 50  # means, over which a pace stays whole
_AROUND = 2  # means on either side, over which a pace is told
SCATTER = 1.3  # times 1/n: relative variance of a noise's standard deviation that n samples tell (third differences)
_MORE, _AT_MOST = 1.05, 1.12  # of a grid's noise: what differences tell of it in the mean, and of some motions
NEAR, WITHIN = 3.0, 0.9866  # standard deviations, and the rms of a normal distribution's values within them


_LEAST_LEFT = 0.1  # of a point's variance, that its neighbours leave, to tell the noise


def sample_noise(values: Array, signal: str) -> float:
    """White noise and quantisation of a signal (samples,), rms.

    From its third differences, which a smooth motion lacks, or from higher ones where these are smaller until they
    are so no more: the median of their size is blind to steps and reversals.  A signal on a grid whose values are held
    shows where it moves slowly whether it has more noise than the grid's, s/√12.  Never 0: a floor is what errors are
    counted in.
    """
    return max(_own_noise(values)[0], least_noise(signal))


def scatter_of(values: Array, along: Sequence[Array], signal: str) -> float:
    """White noise of the points of a table, (points,), about surfaces of second order through their neighbours, rms.

    along: what the table goes along, (points,) each; neighbours have the same signs of all of it, since friction turns
    with the motion.  In a table there is no order in time by whose differences the noise would show.
    """
    scaled = np.stack([one / (np.ptp(one) or 1.0) for one in along], axis=1)
    count = 4 * len(along) + 3
    signs = np.sign(np.stack(along, axis=1))
    off = []
    for at in range(len(values)):
        like = np.flatnonzero(np.all(signs == signs[at], axis=1))
        near = like[np.argsort(np.sum((scaled[like] - scaled[at]) ** 2, axis=1), kind="stable")[:count]]
        away = scaled[near] - scaled[at]
        columns = np.concatenate([np.ones((near.size, 1)), away, away**2], axis=1)
        own = np.linalg.pinv(columns, rcond=1e-6)[0]  # what each neighbour counts in the surface at the point itself
        left = 1.0 - own[0]
        if left > _LEAST_LEFT:
            off.append((values[at] - own @ values[near]) / np.sqrt(left))
    scatter = 1.4826 * float(np.median(np.abs(off))) if off else 0.0
    return max(scatter, least_noise(signal))


def is_of_grid(values: Array) -> bool:
    """Whether a signal's noise (samples,) is that of the grid on which it lies, and so known without a guess."""
    return _own_noise(values)[1]


_MOST_KNOWN = 256
_known: dict[bytes, tuple[float, bool]] = {}  # by the digests of signals, which for themselves may take a gigabyte


def _own_noise(values: Array) -> tuple[float, bool]:
    """`sample_noise` before a signal's least, and whether it is a grid's.

    Every model of a discovery asks it of the same recordings and of their parts.
    """
    given = np.ascontiguousarray(values, dtype=float)
    digest = hashlib.sha256(given.data).digest()
    found = _known.get(digest)
    if found is None:
        found = _known[digest] = _found_noise(given)
        for oldest in list(_known)[:-_MOST_KNOWN]:
            _known.pop(oldest, None)  # another thread may have done so
    return found


def _found_noise(values: Array) -> tuple[float, bool]:
    """The same of float64 values."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > _ROUNDING * (1.0 + np.max(np.abs(values)))]
    step = float(np.min(steps)) if len(steps) else 0.0
    repeated = len(steps) < 0.9 * (len(values) - 1)  # held values are the mark of quantisation
    if not repeated:
        return _of_grid(white_noise(values), _step(values), len(values))
    pieces = np.array_split(values, max(1, len(values) // _PIECE))
    return _of_grid(float(np.quantile([white_noise(one) for one in pieces], _SLOW)), step, len(values))


def _of_grid(noise: float, step: float, samples: int) -> tuple[float, bool]:
    """s/√12 where a noise on a grid of steps s is that, within 2 σ of what differences tell; and whether it is."""
    grid = step / np.sqrt(12.0)
    most = max(_AT_MOST, _MORE + 2.0 * np.sqrt(SCATTER / samples))
    return (grid, True) if noise < most * grid else (noise, False)


def beating(values: Array, size: int) -> Array:
    """What quantisation leaves in means over size samples beyond s/√(12 size), rms, (means,).

    A signal that goes on by a whole number of steps a sample is off by the same in each, which no mean takes away: at
    a pace of p steps it beats every 1/|p − round(p)| samples.  0 where the pace changes, and without a grid.
    """
    means = values[: len(values) // size * size].reshape(-1, size).mean(axis=1)
    step = _step(values)
    if step == 0.0 or len(means) <= 2 * _AROUND:
        return np.zeros(len(means))
    around = 2 * _AROUND + 1
    smooth = np.convolve(np.pad(means, _AROUND, mode="edge"), np.full(around, 1.0 / around), "valid")
    pace = np.abs(np.gradient(smooth)) / (size * step)
    whole = (np.round(pace) >= 1.0) & (size * np.abs(pace - np.round(pace)) < _BEAT)
    from scipy.ndimage import binary_opening  # takes a third of a second to import, which reading does without

    lasts = binary_opening(whole, np.ones(_LASTS, dtype=bool))
    return np.where(lasts, step * np.sqrt((1.0 - 1.0 / size) / 12.0), 0.0)


def held(values: Array, size: int) -> Array:
    """For how many samples a value stays where it is, in the mean of each of the means over size samples, (means,)."""
    values = values[: len(values) // size * size]
    if not len(values):
        return np.zeros(0)
    new = np.abs(np.diff(values)) > _ROUNDING * (1.0 + np.max(np.abs(values)))
    ends = np.flatnonzero(np.concatenate([[True], new, [True]]))
    lengths = np.diff(ends)
    return np.repeat(lengths, lengths).astype(float).reshape(-1, size).mean(axis=1)


def _step(values: Array) -> float:
    """The step of a grid on which values lie, that all their differences are multiples of; 0 where there is none."""
    steps = np.diff(values)
    changes = np.abs(np.diff(steps))
    changes = changes[changes > _ROUNDING * (1.0 + np.max(np.abs(values)))]
    step = float(np.min(changes, initial=np.inf))
    multiples = steps / step
    return step if np.all(np.abs(multiples - np.round(multiples)) < _ON_GRID) and np.isfinite(step) else 0.0


def least_noise(signal: str) -> float:
    """The least that a signal's noise can be, in its unit; above 0."""
    return _FINEST[SIGNALS[signal].kind]


def white_noise(values: Array) -> float:
    """rms, by the lowest order of differences from which on the next tells the same; by the first where none does."""
    found = [_typical(np.diff(values, order)) / np.sqrt(comb(2 * order, order)) for order in _ORDERS]
    return next((one for one, after in pairwise(found) if after > _LEVEL * one), found[0])


def _typical(differences: Array) -> float:
    """Standard deviation of what is normal about 0: the rms of all that is not far, by the median, which knows no far.

    The median alone scatters by twice as much, and on a grid it is one of few numbers, up to a seventh off.
    """
    size = np.abs(differences)
    near = size <= NEAR * 1.4826 * float(np.median(size))
    return float(np.sqrt(np.mean(size[near] ** 2))) / WITHIN


# --- what a signal's own numbers tell of the sensor -------------------------------------------------------------------
# Quantisation, noise, flat tops; and of two signals: delay, slope.

_MOST_BLOCKS, _BLOCK = 32, 2048  # what is looked at of a long signal
_MOST_FFT = 1 << 18
_FINEST_SHARE = 1e-10  # of the largest value: below it differences are what rounding left of a calculation


def sample_blocks(values: Array, runs: list[slice]) -> list[Array]:
    """Pieces of consecutive samples, spread over all runs; at most some 65000 samples."""
    total = sum(run.stop - run.start for run in runs)
    if total <= _MOST_BLOCKS * _BLOCK:
        return [values[run] for run in runs]
    pieces = []
    for start in np.linspace(0, total - _BLOCK, _MOST_BLOCKS).astype(int):
        for run in runs:
            length = run.stop - run.start
            if start < length:
                pieces.append(values[run.start + start : min(run.start + start + _BLOCK, run.stop)])
                break
            start -= length
    return pieces


def quantisation_step(blocks: list[Array]) -> float:
    """The step that all differences are multiples of, in the signal's unit; 0 where none is seen.

    A decimal fraction written to the file counts as a step too.
    """
    steps = np.concatenate([np.abs(np.diff(block)) for block in blocks] or [np.zeros(0)])
    largest = max((float(np.max(np.abs(block))) for block in blocks if block.size), default=0.0)
    moved = steps[steps > _FINEST_SHARE * largest]
    if moved.size < 10:
        return 0.0
    for candidate in np.unique(np.quantile(moved, [0.0, 0.001, 0.01, 0.05, 0.1, 0.25], method="lower"))[::-1]:
        step = float(candidate)
        for most in (4, 30):  # the first guess is off by rounding, and the more so the larger the multiple
            near = moved[moved < (most + 0.5) * step]
            multiple = np.round(near / step)
            if near.size and (multiple > 0.0).any():
                step = float(near @ multiple / (multiple @ multiple))
        near = moved[moved < 30.5 * step]
        multiple = np.round(near / step)
        off = np.abs(near / step - multiple)
        # A smooth signal has hardly any small differences; a ramp has all the same.
        if (
            near.size >= max(10, 0.2 * moved.size)
            and np.mean(off < 0.15) > 0.98
            and (np.mean(multiple != np.median(multiple)) > 0.02 or moved.size < 0.9 * steps.size)
        ):
            return step
    return 0.0


def noise_rms(blocks: list[Array]) -> float:
    """White noise, rms, from differences of first to fifth order, the tenth with the largest left out.

    Differences take out what is smooth and the trimming what jumps; the least of the orders is taken.
    Filtered noise reads too small; chopping ripple and quantisation are in it.  NaN below 32 samples.
    """
    least = float("inf")
    for order in range(1, 6):
        differences = np.concatenate([np.diff(block, order) for block in blocks if block.size > order] or [np.zeros(0)])
        if differences.size < 32:
            continue
        squares = differences * differences
        kept = np.partition(squares, int(0.9 * squares.size))[: int(0.9 * squares.size)]
        # 0.6229 is the mean of the smallest nine tenths of squared Gaussian numbers.
        least = min(least, float(np.sqrt(np.mean(kept) / 0.6229 / comb(2 * order, order))))
    return least if np.isfinite(least) else float("nan")


def flat_tops(values: Array, noise: float) -> tuple[float, float]:
    """A level that |values| is cut off at, and the share of samples there; (NaN, 0) where there is none.

    At a cut many times more samples lie just below the maximum than in the band under that.
    """
    size = np.abs(values)
    level = float(np.max(size, initial=0.0))
    if level == 0.0 or not np.isfinite(noise):
        return float("nan"), 0.0
    band = min(max(9.0 * noise, 2e-3 * level), 0.2 * level)
    top = np.mean(size > level - band)
    below = np.mean((size <= level - band) & (size > level - 2.0 * band))
    if top > 0.01 and top > 5.0 * below and top < 0.95:
        return level - 0.5 * band, float(top)
    return float("nan"), 0.0


@dataclass(frozen=True)
class Slope:
    """How one signal's changes go with another's: their ratio, and the correlation that says how surely."""

    ratio: float
    correlation: float


def slope(changes: Array, expected: Array) -> Slope:
    """`changes` ≈ ratio·`expected`, both (n,), by least squares through zero; NaN where nothing moves."""
    power = float(expected @ expected)
    own = float(changes @ changes)
    if power <= 0.0 or own <= 0.0:
        return Slope(float("nan"), 0.0)
    product = float(changes @ expected)
    return Slope(product / power, product / np.sqrt(power * own))


def changes_over(values: Array, edges: NDArray[np.intp]) -> Array:
    """The change between consecutive edges, indices of samples; (edges − 1,)."""
    return np.diff(values[edges])


def window_edges(runs: list[slice], windows: int = 1000, least: int = 8) -> list[NDArray[np.intp]]:
    """Indices that cut each run into windows of equal counts of samples, all runs about `windows` in all."""
    total = sum(run.stop - run.start for run in runs)
    width = max(least, total // windows)
    return [np.arange(run.start, run.stop, width) for run in runs if run.stop - run.start > 2 * width]


def integrated(values: Array, time: Array) -> Array:
    """The trapezoidal integral from the first sample on; the same shape."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time)
    return np.concatenate([[0.0], np.cumsum(steps)])


def delay_s(command: Array, response: Array, time: Array) -> tuple[float, float]:
    """How much later the response moves than the command, s, and the correlation of their speeds at that delay.

    The maximum of the cross-correlation, between samples by a parabola; looked for up to a quarter of the
    time, both ways.  (NaN, 0) where one of them does not move.
    """
    samples = min(time.size, _MOST_FFT)
    grid = np.linspace(time[0], time[-1], samples)
    period = (time[-1] - time[0]) / (samples - 1)
    first, second = (np.diff(np.interp(grid, time, signal)) for signal in (command, response))
    # Steps of a coarse encoder are not what to align.
    first, second = first - first.mean(), second - second.mean()
    power = np.sqrt((first @ first) * (second @ second))
    if not power > 0.0:
        return float("nan"), 0.0
    size = 1 << int(2 * first.size - 1).bit_length()
    spectrum = np.conj(np.fft.rfft(first, size)) * np.fft.rfft(second, size)
    correlation = np.fft.irfft(spectrum, size)
    reach = max(2, first.size // 4)
    lags = np.arange(-reach, reach + 1)
    window = correlation[lags]
    sign = 1.0 if window.max() >= -window.min() else -1.0
    best = int(np.argmax(sign * window))
    shift = 0.0
    if 0 < best < window.size - 1:
        before, at, after = sign * window[best - 1 : best + 2]
        curvature = before - 2.0 * at + after
        shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
    return float((lags[best] + shift) * period), float(window[best] / power)


def rotation_order(phases: Array, angle: Array, pole_pairs: float | None) -> tuple[float, float, float, float]:
    """How the three currents turn with the motor: pole pairs, likeness to A-B-C and to A-C-B, rotor offset in rad.

    `phases`: (3, n), A; `angle`: (n,), rad.  The likenesses run from 0 to 1.  Without given pole pairs 1 to 24
    are tried.  The squared current vector is used, in which the torque's sign has no part; the offset is so
    known up to a multiple of π/pole pairs.
    """
    if angle.size > 20_000:
        chosen = np.linspace(0, angle.size - 1, 20_000).astype(int)
        phases, angle = phases[:, chosen], angle[chosen]
    third = 2.0j * np.pi / 3.0
    vector = phases[0] + phases[1] * np.exp(third) + phases[2] * np.exp(-third)
    squared = vector * vector
    total = np.sum(np.abs(squared))
    if not total > 0.0:
        return float("nan"), 0.0, 0.0, float("nan")
    turn = np.exp(-2.0j * (angle - angle[0]))
    tried = [float(pole_pairs)] if pole_pairs else [float(p) for p in range(1, 25)]
    found: dict[float, tuple[float, float, float, float]] = {}
    factor = np.ones_like(turn)
    for pairs in tried:
        factor = np.exp(-2.0j * pairs * (angle - angle[0])) if pole_pairs else factor * turn
        forward = np.sum(squared * factor) / total
        backward = np.sum(squared * np.conj(factor)) / total
        back = forward * np.exp(-2.0j * pairs * angle[0])
        offset = float(np.angle(-back) / (2.0 * pairs))
        found[pairs] = (pairs, float(abs(forward)), float(abs(backward)), offset)
    best = max(found.values(), key=lambda one: max(one[1:3]))
    half = found.get(best[0] / 2.0)
    if half:
        # Currents in blocks carry a fifth harmonic; in the square it turns backward at twice the fundamental.
        opposite = half[1] if best[2] > best[1] else half[2]
        if opposite > 0.5 * max(best[1:3]) and opposite > 2.0 * min(half[1:3]):
            return half
    return best


# --- how much later a speed comes than the position that it is the derivative of, and how sure that is ----------------
# Over a window the position changes as the speed's integral does, moved by the delay d: Δp(t) = a·ΔV(t + d) + b·Δt,
# with the speed's scale and offset in a and b.  Gauss-Newton steps in d have the position's own curvature for an
# instrument: the speed's noise is not in it, and the position's lies evenly about the window's ends, so that neither
# moves d nor makes its interval narrower than it is.  The interval is Student's over blocks of time, which need be
# neither white nor alike inside (a cluster-robust covariance; Cameron and Miller, J. Human Resources 50 (2015)); a
# block counts by its share of the motion.  A drift between two clocks is a delay that grows evenly over the recording,
# d = d₀ + d₁·τ with τ from −½ to ½, and is told in the same way, with the curvature times τ for its instrument.

_MOST = 60_000  # samples that are looked at; of more, means over neighbours, which move neither against the other
_LAG_BLOCKS = 16
_FEWEST = 4.0  # blocks that must have a part in the motion
_STEPS = 12
_ALIKE = 0.5  # correlation of the two changes, below which one is not the other's derivative
_NEAR = 0.3  # of the time in which the speed changes by itself, up to which an interval is told
_RESOLVED = 0.01  # of a period: what interpolation between samples is off by
_SURE = 0.995  # of Student's distribution: a drift is seldom there, so that it takes more to claim one


@dataclass(frozen=True)
class Lag:
    """By how much the speed is later than the position, s, with its 90 % interval."""

    lag_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True)
class Drift:
    """By how much the speed's clock runs fast, s per s of the position's, with its 90 % interval."""

    rate: float
    low: float
    high: float
    is_sure: bool  # zero is outside its 99 % interval


def speed_lag(position: Array, speed: Array, time: Array, stretches: list[slice]) -> Lag | None:
    """The lag of a speed, in any unit, behind its position, (n,) each; None where the motion does not tell one.

    stretches: samples without a gap between them, in order.
    """
    found = _fitted(position, speed, time, stretches, False)
    return found and Lag(found.value, found.value - found.half, found.value + found.half)


def clock_drift(position: Array, speed: Array, time: Array, stretches: list[slice]) -> Drift | None:
    """How much faster the clock of a speed runs than that of its position; as `speed_lag`."""
    found = _fitted(position, speed, time, stretches, True)
    if found is None:
        return None
    rate, half = found.value / found.lasted_s, found.half / found.lasted_s
    return Drift(rate, rate - half, rate + half, abs(found.value) > found.sure_half)


@dataclass(frozen=True)
class _Found:
    """The delay, or what it grows by over the recording, s, and half the widths of its intervals, of 90 and 99 %."""

    value: float
    half: float
    sure_half: float
    lasted_s: float


def _fitted(position: Array, speed: Array, time: Array, stretches: list[slice], drifts: bool) -> _Found | None:
    total = sum(one.stop - one.start for one in stretches)
    parts = [_thinned(position[one], speed[one], time[one], max(1, -(-total // _MOST))) for one in stretches]
    parts = [one for one in parts if one.time.size >= 32]
    if not parts:
        return None
    longest = max(parts, key=lambda one: one.time.size)
    start, _ = delay_s(longest.position, longest.travelled, longest.time)
    if not np.isfinite(start):
        return None
    samples = sum(one.time.size for one in parts)
    windows = [2**i for i in range(1, 16) if 6 * 2**i <= samples // _LAG_BLOCKS]
    with np.errstate(all="ignore"):  # what does not move tells nothing, and is left out
        found = [one for window in windows if (one := _late(parts, window, start, drifts)) is not None]
    # The narrowest of several intervals is narrower than it should be, by its luck.
    return sorted(found, key=lambda one: one.half)[:2][-1] if found else None


@dataclass(frozen=True)
class _Part:
    """A stretch: position, speed and its integral at the same times, (n,) each."""

    position: Array
    speed: Array
    travelled: Array
    time: Array

    def later(self, time: Array) -> tuple[Array, Array]:
        """The integral and the speed at times between samples."""
        at = np.clip(np.searchsorted(self.time, time, "right") - 1, 0, self.time.size - 2)
        since, step = time - self.time[at], self.time[at + 1] - self.time[at]
        gained = since / step * (self.speed[at + 1] - self.speed[at])
        return self.travelled[at] + since * (self.speed[at] + 0.5 * gained), self.speed[at] + gained


def _thinned(position: Array, speed: Array, time: Array, every: int) -> _Part:
    whole = time.size // every * every
    position, speed, time = (values[:whole].reshape(-1, every).mean(axis=1) for values in (position, speed, time))
    return _Part(position, speed, integrated(speed, time), time)


def _late(parts: list[_Part], half_window: int, start: float, drifts: bool) -> _Found | None:
    """By windows of so many samples on either side."""
    period = float(np.median(np.diff(parts[0].time)))
    middle, lasted = 0.5 * (parts[0].time[0] + parts[-1].time[-1]), parts[-1].time[-1] - parts[0].time[0]
    beside = max(1, half_window // 2)
    late = np.array([start, 0.0] if drifts else [start])
    for _ in range(_STEPS):
        rows = [_rows(one, half_window, beside, late, middle, lasted) for one in parts]
        changes, regressors, instruments = (np.concatenate(columns) for columns in zip(*rows))
        if len(changes) < 8 * _LAG_BLOCKS:
            return None
        moments = instruments.T @ regressors
        if not np.linalg.cond(moments / np.abs(moments).max(axis=0, initial=1e-300)) < 1e12:
            return None
        found = np.linalg.solve(moments, instruments.T @ changes)
        step = found[1:-1] / found[0]
        late += step
        if np.all(np.abs(step) < 1e-4 * period):
            break
    else:
        return None
    gain, travelled, told = found[0], regressors[:, 0], late.size  # its column, and place
    curved = regressors[:, told]
    if not np.corrcoef(changes, travelled)[0, 1] ** 2 > _ALIKE**2:
        return None
    left = changes - regressors @ found
    edges = np.linspace(0, len(left), _LAG_BLOCKS + 1).astype(int)[:-1]
    inverse = np.linalg.inv(moments)[told]
    pulls = np.add.reduceat((instruments @ inverse) * left, edges) / gain
    shares = np.add.reduceat((instruments @ inverse) * curved, edges)
    count = 1.0 / float(shares @ shares)
    if not count >= _FEWEST:
        return None
    from scipy.special import stdtrit  # takes a while to import

    spread = float(np.linalg.norm(pulls / (1.0 - shares)))
    half, sure = (float(np.hypot(stdtrit(count - 1.0, p) * spread, _RESOLVED * period)) for p in (0.95, _SURE))
    if not half < _NEAR * np.std(travelled) / np.std(curved):
        return None
    return _Found(float(late[-1]), half, sure, float(lasted))


def _rows(part: _Part, m: int, beside: int, late: Array, middle: float, lasted: float) -> tuple[Array, Array, Array]:
    """The position's changes over windows; what explains them: the integral's, the speed's and time's; instruments.

    late: the delay, and what it grows by over the recording, which lasts so long about its middle.
    """
    reach, time = m + beside, part.time
    i = np.arange(reach, time.size - reach)
    since = (time - middle) / lasted
    shifted = time + late[0] + (late[1] * since if late.size > 1 else 0.0)
    i = i[(shifted[i - m] >= time[0]) & (shifted[i + m] <= time[-1])]
    after, speed_after = part.later(shifted[i + m])
    before, speed_before = part.later(shifted[i - m])
    travelled, spanned = after - before, time[i + m] - time[i - m]
    p = part.position
    curved = p[i + m + beside] - p[i - m + beside] - p[i + m - beside] + p[i - m - beside]
    regressors, instruments = [travelled, speed_after - speed_before], [travelled, curved]
    if late.size > 1:
        regressors.append(speed_after * since[i + m] - speed_before * since[i - m])
        instruments.append(curved * since[i])
    return (
        p[i + m] - p[i - m],
        np.column_stack([*regressors, spanned]),
        np.column_stack([*instruments, spanned]),
    )


# --- a window of a signal in numbers: between two cursors -------------------------------------------------------------


@dataclass(frozen=True)
class Reading:
    """Of a signal between two times, in its unit; NaN where the signal has no values."""

    first: float  # at the earlier time
    last: float  # at the later one
    mean: float  # over time
    rms: float  # over time
    slope: float  # of the straight line that fits best, per second

    @property
    def difference(self) -> float:
        """Last less first."""
        return self.last - self.first


def reading(time_s: Array, values: Array, from_s: float, to_s: float) -> Reading:
    """Time rising, and values, both (n,): straight lines between samples, so that uneven steps weigh by their length.

    Mean and rms are integrals over the window, slope is least squares in it.  Samples that are not finite are left out.
    """
    known = np.isfinite(time_s) & np.isfinite(values)
    time_s, values = time_s[known], values[known]
    low, high = sorted((from_s, to_s))
    if len(time_s) < 2 or not time_s[0] <= low < high <= time_s[-1]:
        return Reading(_at(time_s, values, low), _at(time_s, values, high), np.nan, np.nan, np.nan)
    inside = (time_s > low) & (time_s < high)
    first, last = _at(time_s, values, low), _at(time_s, values, high)
    t = np.concatenate([[low], time_s[inside], [high]])
    y = np.concatenate([[first], values[inside], [last]])
    step, span = np.diff(t), high - low
    mean = float(np.sum(step * (y[1:] + y[:-1]))) / (2.0 * span)
    square = float(np.sum(step * (y[1:] ** 2 + y[1:] * y[:-1] + y[:-1] ** 2))) / (3.0 * span)
    middle = t - 0.5 * (low + high)  # the integral of middle·y over the one of middle²
    a, b = middle[:-1], middle[1:]
    moment = float(np.sum(step * (2.0 * (a * y[:-1] + b * y[1:]) + a * y[1:] + b * y[:-1]))) / 6.0
    return Reading(first, last, mean, float(np.sqrt(square)), moment / (span**3 / 12.0))


def _at(time_s: Array, values: Array, at_s: float) -> float:
    if not len(time_s):
        return np.nan
    return float(np.interp(at_s, time_s, values, left=np.nan, right=np.nan))


# --- its spectrum -----------------------------------------------------------------------------------------------------

_LEAST_SAMPLES = 16  # samples of a spectrum
_MOST_OF_GRID = 2**20  # of its grid, which one sample a long way off would else make endless


def spectrum(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Frequencies, Hz, and amplitudes of the signal's sines there, in its unit; time rising, and values, both (n,).

    About its straight line, with a Hann window, whose broadening keeps a sine's amplitude where it lies on a bin; on
    a grid of the median step, on which an uneven time is interpolated.  InputError: too few samples.
    """
    known = np.isfinite(time_s) & np.isfinite(values)
    time_s, values = time_s[known], values[known]
    if len(time_s) < _LEAST_SAMPLES:
        raise InputError(
            f"a spectrum needs {_LEAST_SAMPLES} samples, this window has {len(time_s)}; choose a longer one"
        )
    step = float(np.median(np.diff(time_s)))
    count = int(np.floor((time_s[-1] - time_s[0]) / step + 0.5)) + 1
    if count > _MOST_OF_GRID:
        raise InputError(f"a spectrum of {count} steps of {step:g} s is too long; choose a shorter window")
    grid = time_s[0] + step * np.arange(count)
    y = np.interp(grid, time_s, values)
    x = np.arange(count) - 0.5 * (count - 1)
    y = y - np.mean(y) - x * (x @ y) / (x @ x)
    window = np.hanning(count + 1)[:-1]
    amplitude: Array = 2.0 * np.abs(np.fft.rfft(window * y)) / float(np.sum(window))
    frequency: Array = np.arange(len(amplitude), dtype=np.float64) / (count * step)
    return frequency[1:], amplitude[1:]


# --- its event --------------------------------------------------------------------------------------------------------

_AT_LEVEL = 0.02  # of the excursion, within which a signal is at its level
_NOISES = 6.0  # standard deviations of its noise, within which it is as well
_ENDS = 0.02  # of the samples, from which a level is known
_AIR = 0.15  # of the event's length, that a window leaves before and after it


def event(time_s: Array, *signals: Array) -> tuple[float, float] | None:
    """From and to when something happens: where any signal leaves its first level, to where all stay at their last.

    Time rising, and signals, all (n,); with some time before and after.  None: nothing happens, or it never ends, as
    of a sine.
    """
    found = [one for one in (_event(time_s, signal) for signal in signals) if one is not None]
    if not found:
        return None
    first, last = min(one[0] for one in found), max(one[1] for one in found)
    air = _AIR * (last - first)
    low, high = max(first - air, float(time_s[0])), min(last + air, float(time_s[-1]))
    return (low, high) if high > low else None


def _event(time_s: Array, values: Array) -> tuple[float, float] | None:
    known = np.isfinite(values)
    time_s, values = time_s[known], values[known]
    few = max(3, int(_ENDS * len(values)))
    if len(values) < 4 * few:
        return None
    ends = values[:few], values[-few:]
    # of neighbours, so that a drift is none; what a level is known by beside it
    noise = min(float(np.std(np.diff(end))) / np.sqrt(2.0) for end in ends)
    near = max(_AT_LEVEL * float(np.ptp(values)), _NOISES * noise)
    start, end = float(values[0]), float(np.median(ends[1]))
    away = np.flatnonzero(np.abs(values - start) > near)
    restless = np.flatnonzero(np.abs(values - end) > near)
    if not len(away) or not len(restless) or restless[-1] >= len(values) - few:
        return None
    first = max(int(away[0]) - 1, 0)
    last = max(int(restless[-1]), int(away[0])) + 1
    return float(time_s[first]), float(time_s[last])
