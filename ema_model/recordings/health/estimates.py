"""What a signal's own numbers tell of the sensor: quantisation, noise, flat tops; and of two signals: delay, slope."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_BLOCKS, _BLOCK = 32, 2048  # what is looked at of a long signal
_MOST_FFT = 1 << 18
_FINEST = 1e-10  # of the largest value: below it differences are what rounding left of a calculation


def sample_blocks(values: Array, runs: list[slice]) -> list[Array]:
    """Pieces of consecutive samples, spread over all runs; at most some 65000 samples."""
    total = sum(run.stop - run.start for run in runs)
    if total <= _BLOCKS * _BLOCK:
        return [values[run] for run in runs]
    pieces = []
    for start in np.linspace(0, total - _BLOCK, _BLOCKS).astype(int):
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
    moved = steps[steps > _FINEST * largest]
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
