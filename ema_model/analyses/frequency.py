"""Frequency response: the measured transfer function beside the model's, with coherence, resonance and delay.

By Welch's method, with half overlapping pieces under Hann's window: H₁ = S_xy/S_xx, and the coherence
γ² = |S_xy|²/(S_xx S_yy) says how much of the output follows the input linearly.  Of n averages the relative error of
|H|, and that of the phase in rad, is √((1 − γ²)/(2 n γ²)) (Bendat and Piersol, Random Data, 2010, ch. 9).  A sweep
passes each frequency but once: of long pieces neighbouring frequencies are averaged, too, and n is (Σ P)²/Σ P² of the
input's power P in all that is averaged, so that what holds all the power counts once.  The model is simulated on what
the recordings put in, and its signals go through the same estimator: what the window and the closed loop do to one they
do to the other.

Resonance, antiresonance and delay are those of a rational function that is fitted to the logarithm of H:

    H(s) = K s^m e^(−s T) / (1 + s/p) · (s² + 2ζ_a ω_a s + ω_a²)/ω_a² · ω_r²/(s² + 2ζ_r ω_r s + ω_r²)

with as many of its last factors as the data pay for (Pintelon and Schoukens, System Identification, 2012, ch. 9).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import CURRENT_INPUTS, VOLTAGE_INPUTS
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.files.opened import listed
from ema_model.models import ClosedLoop
from ema_model.models.loop_window import LoopWindow
from ema_model.quantities import HALF_90
from ema_model.recordings import SIGNALS, Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.result import Result
from ema_model.simulation.run import Run, simulate_reference

Array = NDArray[np.float64]
Complex = NDArray[np.complexfloating[Any, Any]]

# --- what is stated of it, as literals --------------------------------------------------------------------------------

TITLE = "Frequency response"
HELP = "show the measured frequency response beside the model's: resonance, damping, delay, coherence"
PLACE = 6.5
OPTIONS = {
    "input": {
        "title": "Input",
        "help": "the signal that excites; auto takes what is put into the model",
        "choices": {
            "auto": "What is put in",
            "command": "Command",
            "current": "Current or torque",
            "voltage": "Voltage or duty",
        },
    },
    "output": {
        "title": "Output",
        "help": "the signal that answers; auto takes the position of a command, else the motor's speed",
        "choices": {
            "auto": "By the input",
            "user": "User position",
            "motor": "Motor position",
            "speed": "Motor speed",
            "current": "Current",
        },
    },
}
_INPUTS = {"command": ("command_rad",), "current": CURRENT_INPUTS, "voltage": VOLTAGE_INPUTS}
_OUTPUTS = {
    "user": "user_position_rad",
    "motor": "motor_position_rad",
    "speed": "motor_speed_rad_s",
    "current": "current_A",
}
_DERIVATIVE = {"position": 0, "speed": 1, "current": 2, "torque": 2, "voltage": 1, "ratio": 1}  # of a position, about

# --- the numbers that decide ------------------------------------------------------------------------------------------

_PIECE_S = (4.0, 2.0, 1.0, 0.5, 0.25)  # lengths of Welch's pieces
_NEIGHBOURS = (1, 3, 5, 9)  # frequencies that are averaged beside the pieces: a sweep passes each but once
_LEAST_EVENTS = 4.0  # of the shortest pieces that the input's energy is spread over: two steps lie in four
_LEAST_SAMPLES = 64  # of a piece
_ENOUGH = 3.0  # averages that most frequencies need
_ABOUT_ALL = 0.8  # of the frequencies that any way to average shows
_WEAKEST = 1e-6  # of the input's largest power, below which a frequency holds what others leak
_LEAST_AVERAGES = 2.0  # that a frequency needs to count
_OVERLAP = 0.95  # independent averages in each piece, half overlapping ones under Hann's window
_COHERENT = 0.5  # γ², from which on a frequency counts
_BETWEEN = 0.15  # the same between two that count, as at an antiresonance
_CHANCE = 0.05  # with which noise alone seems coherent
_LEAST_LINES = 10  # frequencies that count
_BEYOND = 1.2  # times the last of them, to which responses are shown
_LEAST_ERROR = 0.02  # of ln H: what the pieces leave of a sharp peak
_UNKNOWN = 5.0  # of a logarithm: an interval as wide as that means anything
_SHARP = 0.35  # damping, up to which it is a resonance: a peak of 3 dB
_PAID = 10.0  # of χ², beyond its own parameters' price, that a factor of H must take away
_BETTER = 0.7  # times, that it must leave of χ²
_ALIKE_LINES = 1.5  # neighbouring lines under Hann's window that tell one thing
_MOST_TRIALS, _FIRST_TRIALS = 200, 30  # of a fit, and of one that begins
_MOST_EXTREMES = 3  # peaks and dips at which a fit begins
_FITS = 4.0  # χ² over its degrees of freedom, up to which a delay is told
_RESEMBLES = 10.0  # the same for a resonance, which is seen in the magnitude as well
_EDGE = 2  # lines at each end of the band, in which no resonance is told
_EARLY = 2.0  # steps between compared values, by which a delay may be less than none
_FAR = 30.0  # of the gain's logarithm, from its start
_LEAST_DAMPING, _MOST_DAMPING = math.log(1e-4), 0.5  # logarithms
_SHARP_START = math.log(0.05)  # of the damping's logarithm, with which it does
_GO_ON = 3  # of the fits that have begun
_APART = 3.0  # standard errors, from which on two magnitudes differ
_LEAST_BAND = 3  # lines in a row that must


# --- the answer -------------------------------------------------------------------------------------------------------

Interval = tuple[float, float]


@dataclass(frozen=True)
class Estimate:
    """A number with its scatter."""

    value: Annotated[float, Meta(description="in the unit that the name above says")]
    interval90: Annotated[Interval, Meta(description="the ends of its 90 % interval")]

    @property
    def half(self) -> float:
        """Half the width of the interval."""
        return 0.5 * (self.interval90[1] - self.interval90[0])

    def differs(self, other: Estimate, least: float = 0.0) -> bool:
        """Whether both are apart by more than their scatter, at 90 %, and by more than `least`."""
        return abs(self.value - other.value) > max(math.hypot(self.half, other.half), least)


@dataclass(frozen=True)
class Mode:
    """A resonance or an antiresonance."""

    frequency_Hz: Annotated[Estimate, Meta(description="Hz, undamped")]
    damping: Annotated[Estimate, Meta(description="damping ratio ζ")]


@dataclass(frozen=True, eq=False)
class Response:
    """A transfer function, measured or of the model."""

    magnitude_dB: Annotated[Array, Meta(description="dB, of output's unit per input's; null: nothing was excited")]
    phase_deg: Annotated[Array, Meta(description="degrees, continuous over the frequencies that count")]
    coherence: Annotated[Array, Meta(description="γ², 0 … 1: how much of the output follows the input linearly")]
    sigma: Annotated[Array, Meta(description="1 σ of the magnitude, relative, and of the phase, rad")]
    resonance: Annotated[Mode | None, Meta(description="null: none is seen")]
    antiresonance: Annotated[Mode | None, Meta(description="null: none is seen")]
    delay_s: Annotated[Estimate | None, Meta(description="s: of the phase, what grows with frequency; null: not known")]
    fitted_dB: Annotated[Array, Meta(description="dB, of the fitted function that resonance and delay are of")]
    fitted_deg: Annotated[Array, Meta(description="degrees, of the same")]


@dataclass(frozen=True)
class Apart:
    """Frequencies at which both magnitudes differ by more than their scatter."""

    from_Hz: Annotated[float, Meta(description="Hz")]
    to_Hz: Annotated[float, Meta(description="Hz")]
    most_dB: Annotated[float, Meta(description="dB, the measured magnitude over the model's where they differ most")]
    at_Hz: Annotated[float, Meta(description="Hz, where that is")]


@dataclass(frozen=True, eq=False, repr=False)
class FrequencyResponse(Result):
    """The measured frequency response beside the model's."""

    actuator: Annotated[str, Meta(description="the model's name")]
    recordings: Annotated[tuple[str, ...], Meta(description="their names")]
    input: Annotated[str, Meta(description="the signal that excites, by its name in files")]
    output: Annotated[str, Meta(description="the signal that answers, by its name in files")]
    reason: Annotated[str | None, Meta(description="why no response is told; null where one is")]
    sample_s: Annotated[float, Meta(description="s, of the recordings; delays closer than that are not told apart")]
    piece_s: Annotated[float, Meta(description="s, the length of the pieces that are averaged")]
    averages: Annotated[float, Meta(description="independent ones that excite a frequency that counts, the median")]
    frequency_Hz: Annotated[Array, Meta(description="Hz, of every list below")]
    counts: Annotated[tuple[bool, ...], Meta(description="by frequency: whether excitation and coherence suffice")]
    measured: Annotated[Response | None, Meta(description="null: see reason")]
    model: Annotated[
        Response | None,
        Meta(description="the model's, by the same estimate; null: its own input excites too few frequencies"),
    ]
    differs: Annotated[tuple[Apart, ...], Meta(description="where the magnitudes differ, the largest first")]

    @property
    def answer(self) -> Annotated[tuple[str, ...], Meta(description="what is found, in sentences")]:
        """As the terminal has them."""
        return tuple(self.lines)

    @property
    def band(self) -> NDArray[np.bool_]:
        """(lines,) whether a frequency counts."""
        return np.array(self.counts, dtype=bool)


RESULT = FrequencyResponse


def analyse(
    recordings: Sequence[Measurement],
    actuator: Actuator,
    *,
    input: str = "auto",
    output: str = "auto",
    on_progress: Callable[[str], None] | None = None,
) -> FrequencyResponse:
    """The frequency response of recordings of one actuator, all together, beside its model's.

    input, output: of the choices that `OPTIONS` states.  Raises InputError for recordings without such signals, or
    of several sample rates; where excitation does not suffice the answer says so and has no response.
    """
    say = on_progress or (lambda text: None)
    say("simulating the model")
    beside = _model(recordings, actuator)
    channel = _channel(beside, input, output)
    simulated = [
        {name: values[0] for name, values in beside.signals(place).items()} for place in range(len(beside.windows))
    ]
    pairs = {
        "measured": [_pair(beside, window, window.measured, channel) for window in beside.windows],
        "model": [_pair(beside, window, shown, channel) for window, shown in zip(beside.windows, simulated)],
    }
    if not all(np.all(np.isfinite(values)) for pair in pairs["model"] for values in pair):
        raise InputError(f"the model of {actuator.name} diverges on these recordings; check its file, and their units")
    say("estimating the frequency response")
    axes = actuator.axes
    facts = {
        "actuator": actuator.name,
        "recordings": tuple(one.name or f"recording {i}" for i, one in enumerate(recordings, 1)),
        "input": axes.signal(channel[0]),
        "output": axes.signal(channel[1]),
        "sample_s": max(one.sample_period_s for one in beside.measurements),
    }
    step_s = beside.windows[0].block_s
    found = _finest_that_shows(pairs["measured"], step_s)
    reason = _why_not(found, pairs["measured"], step_s)
    if found is None or reason is not None:
        none = {"frequency_Hz": np.zeros(0), "counts": (), "measured": None, "model": None, "differs": ()}
        return FrequencyResponse(**facts, reason=reason, piece_s=0.0, averages=0.0, **none)
    power = _order(channel[1]) - _order(channel[0]) + (channel[0] in CURRENT_INPUTS)
    ours = _spectrum(_pieces(pairs["model"], found.size), found.size, step_s, found.neighbours)
    found, ours = (_at_its_time(one, channel, beside.measurements) for one in (found, ours))
    say("fitting resonance and delay")
    kept = found.frequency_Hz <= _BEYOND * found.frequency_Hz[found.lines][-1]
    counts = found.lines[kept]
    measured = _first(_response(found, found.lines, power), kept)
    both = found.lines & ours.lines
    model = _first(_response(ours, both, power), kept) if both.sum() >= _LEAST_LINES else None
    return FrequencyResponse(
        **facts,
        reason=None,
        piece_s=found.piece_s,
        averages=found.usual_averages,
        frequency_Hz=found.frequency_Hz[kept],
        counts=tuple(counts.tolist()),
        measured=measured,
        model=model,
        differs=() if model is None else _apart(found.frequency_Hz[kept], both[kept], measured, model),
    )


# --- which signals, of which model ------------------------------------------------------------------------------------


def _model(recordings: Sequence[Measurement], actuator: Actuator) -> ClosedLoop:
    """The recordings beside the closed loop, or where no command or controller is known, beside the open one."""
    if any(one.is_map for one in recordings):
        raise InputError("a static map has no frequency response; take recordings over time")
    signals = set.intersection(*(set(one.signals) for one in recordings)) if recordings else set()
    is_commanded = actuator.controller.kind not in ("unknown", "open") and "command_rad" in signals
    if not is_commanded:
        actuator = actuator.in_open_loop(signals)
    model = ClosedLoop(recordings, actuator)
    rates = sorted({round(1.0 / one.block_s, 3) for one in model.windows})
    if len(rates) > 1:
        raise InputError(f"the recordings are of several rates ({listed(f'{one:g} Hz' for one in rates)}); take one")
    return model


def _channel(model: ClosedLoop, input: str, output: str) -> tuple[str, str]:
    """The input's and the output's names inside; InputError where a recording lacks one."""
    window = model.windows[0]
    first = window.input
    if input != "auto":
        own = [name for name in _INPUTS[input] if name == window.input or all(name in m for m in model.measurements)]
        for one in model.measurements:
            one.require(own[0] if own else _INPUTS[input][0], without="or choose another input")
        first = own[0]
        if first != window.input and first != "current_A":
            raise InputError(f"the model is driven by {model.actuator.axes.signal(window.input)}, which leaves no "
                             f"{model.actuator.axes.signal(first)} of its own; choose another input")  # fmt: skip
    wanted = ("user", "motor", "speed") if first == "command_rad" else ("speed", "motor", "user")
    known = [_OUTPUTS[one] for one in (wanted if output == "auto" else (output,))]
    there = [name for name in known if name != first and all(name in one.measured for one in model.windows)]
    if not there:
        for one in model.measurements:
            one.require(known[0], without="or choose another output")
        raise InputError(f"the output {model.actuator.axes.signal(known[0])} is the input; choose another output")
    return first, there[0]


def _order(name: str) -> int:
    """How often a position is differentiated for such a signal, about; a current's last pole is the friction's."""
    return 0 if name == "command_rad" else _DERIVATIVE[SIGNALS[name].kind]


def _pair(
    model: ClosedLoop, window: LoopWindow, shown: dict[str, Array], channel: tuple[str, str]
) -> tuple[Array, Array]:
    """Input and output of a window as means of blocks, (blocks,) each; what is put in is as it was recorded."""
    first, second = channel
    samples = model.measurements[window.recording][first] if first == window.input else None
    if samples is None:
        return shown[first], shown[second]
    per = window.samples_per_block
    start = window.first + 1
    return samples[start : start + window.blocks * per].reshape(window.blocks, per).mean(axis=1), shown[second]


# --- the estimate -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """H₁ of one channel; arrays (lines,), a line for each band of frequencies."""

    frequency_Hz: Array
    response: Complex
    coherence: Array
    averages: Array  # independent ones, as the input's power is spread over pieces and neighbours
    power: Array  # of the input, over its largest
    size: int  # samples of a piece
    step_s: float
    neighbours: int  # frequencies of a piece that a band takes together

    @property
    def piece_s(self) -> float:
        return self.size * self.step_s

    @property
    def covered_Hz(self) -> float:
        """Width of all bands that count."""
        return float(self.lines.sum()) * self.neighbours / self.piece_s

    @property
    def usual_averages(self) -> float:
        """The median of those that count."""
        return float(np.median(self.averages[self.lines]))

    @property
    def sigma(self) -> Array:
        """Relative standard error of |H|, and of the phase in rad."""
        gamma = np.clip(self.coherence, 1e-6, 1.0)
        own = np.sqrt((1.0 - gamma) / (2.0 * np.maximum(self.averages, 1.0) * gamma))
        return np.hypot(own, _LEAST_ERROR)

    @property
    def lines(self) -> NDArray[np.bool_]:
        """Those that count: excited more than once, coherent beyond chance; and less coherent ones between them."""
        excited = (self.averages > _LEAST_AVERAGES) & (self.power > _WEAKEST)
        chance = 1.0 - _CHANCE ** (1.0 / np.maximum(self.averages - 1.0, 1e-3))
        strong = excited & (self.coherence > np.maximum(_COHERENT, chance))
        at = np.flatnonzero(strong)
        between = np.zeros_like(strong)
        if at.size:
            between[at[0] : at[-1] + 1] = True
        return strong | (between & excited & (self.coherence > np.maximum(_BETWEEN, chance)))


def _pieces(pairs: Sequence[tuple[Array, Array]], size: int) -> tuple[Complex, Complex]:
    """Fourier transforms of input and output, (pieces, lines): half overlapping, without their straight lines."""
    from scipy.signal import detrend, windows  # takes a while to import

    window = windows.hann(size, sym=False)

    def transformed(values: Array) -> Complex:
        cut = np.lib.stride_tricks.sliding_window_view(values, size)[:: size // 2]
        return np.fft.rfft(window * detrend(cut))[:, 1:-1]

    long = [pair for pair in pairs if pair[0].size >= size]
    first, second = (np.concatenate([transformed(pair[side]) for pair in long]) for side in (0, 1))
    return first, second


def _spectrum(pieces: tuple[Complex, Complex], size: int, step_s: float, neighbours: int) -> _Spectrum:
    """H₁ over all pieces, of so many neighbouring frequencies together."""
    x, y = pieces
    count = x.shape[1] // neighbours

    def summed(values: NDArray) -> NDArray:
        whole = np.sum(values, axis=0)[: count * neighbours]
        return whole.reshape(count, neighbours).sum(axis=1)

    power = np.abs(x) ** 2
    cross, first2, second2, spread = (summed(each) for each in (np.conj(x) * y, power, np.abs(y) ** 2, power**2))
    tiny = 1e-300
    coherence = np.minimum(np.abs(cross) ** 2 / np.maximum(first2 * second2, tiny), 1.0)
    averages = first2**2 / np.maximum(spread, tiny) * (_OVERLAP if neighbours == 1 else 1.0 / _ALIKE_LINES)
    middle = np.arange(count) * neighbours + 1.0 + 0.5 * (neighbours - 1)
    frequency = middle / (size * step_s)
    return _Spectrum(
        frequency,
        np.asarray(cross / np.maximum(first2, tiny), dtype=complex),
        coherence,
        averages,
        first2 / max(float(np.max(first2, initial=0.0)), tiny),
        size,
        step_s,
        neighbours,
    )


def _at_its_time(one: _Spectrum, channel: tuple[str, str], measurements: Sequence[Measurement]) -> _Spectrum:
    """A current that is the mean over the sample before its time is half a sample older than that: taken off."""
    first = measurements[0]
    if first.side.sampling == "instantaneous":
        return one
    older = 0.5 * first.sample_period_s * ((channel[0] in CURRENT_INPUTS) - (channel[1] in CURRENT_INPUTS))
    return replace(one, response=one.response * np.exp(-2j * np.pi * one.frequency_Hz * older))


def _finest_that_shows(pairs: Sequence[tuple[Array, Array]], step_s: float) -> _Spectrum | None:
    """As fine in frequency as shows about all that any shows, from enough averages.  None: the recordings are short."""
    longest = max(one.size for one, _ in pairs)
    sizes = [2 * round(0.5 * piece_s / step_s) for piece_s in _PIECE_S]
    cut = {size: _pieces(pairs, size) for size in sizes if _LEAST_SAMPLES <= size <= longest // 2}
    ways = sorted((neighbours / size, neighbours, size) for size in cut for neighbours in _NEIGHBOURS)
    found = [_spectrum(cut[size], size, step_s, neighbours) for _, neighbours, size in ways]
    if not found:
        return None
    most = max(one.covered_Hz for one in found)
    for one in found:
        if one.covered_Hz >= _ABOUT_ALL * most and one.lines.sum() >= _LEAST_LINES and one.usual_averages >= _ENOUGH:
            return one
    return max(found, key=lambda one: int(one.lines.sum()))


def _why_not(found: _Spectrum | None, pairs: Sequence[tuple[Array, Array]], step_s: float) -> str | None:
    """Why no response is told; None where there is one."""
    if found is None:
        return f"the recordings are too short: {_LEAST_EVENTS * _PIECE_S[-1]:g} s or more are needed"
    size = 2 * round(0.5 * _PIECE_S[-1] / step_s)
    energy = np.sum(np.abs(_pieces(pairs, size)[0]) ** 2, axis=1)
    if float(energy.sum() ** 2 / max(float(np.sum(energy**2)), 1e-300)) < _LEAST_EVENTS:
        return (
            "the input moves once or twice only, as steps do, so that nothing tells scatter from response; "
            "a chirp, a multisine or noise of some seconds would do"
        )
    count = int(found.lines.sum())
    if count >= _LEAST_LINES:
        return None
    return (
        f"the excitation does not suffice: the output follows the input coherently in {count or 'no'} "
        f"band{'' if count == 1 else 's'} of frequencies, and {_LEAST_LINES} are needed"
    )


# --- resonance, antiresonance and delay of a transfer function --------------------------------------------------------

_SUB = 0.5  # frequencies of a piece: between places at which a shape is asked


def _looks(neighbours: int) -> tuple[Array, Array]:
    """Where a band looks, in frequencies of a piece about its middle, and how strongly: Hann's window of each.

    The power of its transform is sinc²(u)/(1 − u²)², 1/4 at u = 1 (Harris, Proc. IEEE 66(1), 1978).
    """
    near = np.arange(-1.5, 1.51, _SUB)
    beside = np.isclose(np.abs(near), 1.0)
    weights = np.where(beside, 0.25, np.sinc(near) ** 2 / np.where(beside, 1.0, (1.0 - near**2) ** 2))
    comb = np.zeros(2 * neighbours - 1)
    comb[::2] = 1.0
    weights = np.convolve(weights, comb)
    places = _SUB * (np.arange(weights.size) - 0.5 * (weights.size - 1))
    return places.astype(float), weights / float(weights.sum())


@dataclass(frozen=True, eq=False)
class _Shape:
    """The rational function of this file's head, with or without its last factors."""

    power: int
    sign: float
    has_resonance: bool = False
    has_antiresonance: bool = False

    def at(self, x: Array, frequency_Hz: Array) -> Complex:
        """x: ln K, ln p, T, then ln ω and ln ζ of the resonance and of the antiresonance."""
        s = 2j * np.pi * frequency_Hz
        made = self.sign * np.exp(x[0] - s * x[2]) * s**self.power / (1.0 + s / np.exp(x[1]))
        if self.has_resonance:
            made = made / _pair_of_roots(s, x[3], x[4])
        return made * _pair_of_roots(s, x[5], x[6]) if self.has_antiresonance else made

    def seen(self, x: Array, spectrum: _Spectrum, lines: NDArray[np.bool_]) -> Complex:
        """The same as the estimate shows it, which takes each band together."""
        places, weights = _looks(spectrum.neighbours)
        spacing = 1.0 / spectrum.piece_s
        every = np.maximum(spectrum.frequency_Hz[lines, None] + spacing * places, 0.1 * spacing)
        return self.at(x, every) @ weights


def _pair_of_roots(s: Complex, log_omega: float, log_damping: float) -> Complex:
    omega, damping = math.exp(log_omega), math.exp(log_damping)
    return (s / omega) ** 2 + 2.0 * damping * s / omega + 1.0


@dataclass(frozen=True, eq=False)
class _Fit:
    """A shape's parameters and their covariance."""

    shape: _Shape
    x: Array
    chi2: float
    freedom: float  # degrees of
    covariance: Array
    inside: tuple[float, float]  # Hz, of the lines but the outermost ones
    earliest_s: float  # to which the delay was sought

    def estimate(self, place: int, *, is_log: bool) -> Estimate:
        value, half = float(self.x[place]), HALF_90 * math.sqrt(max(float(self.covariance[place, place]), 0.0))
        if is_log:
            half = min(half, _UNKNOWN)
            return Estimate(math.exp(value), (math.exp(value - half), math.exp(value + half)))
        return Estimate(value, (value - half, value + half))

    @property
    def delay(self) -> Estimate | None:
        """None where the response is not of such a shape: far off it, or before its input."""
        found = self.estimate(2, is_log=False)
        fits = self.chi2 < _FITS * self.freedom and found.half * self.inside[1] < 0.5  # of a period
        return found if fits and found.value > 0.9 * self.earliest_s else None

    @property
    def is_sharp(self) -> bool:
        """Whether each pair of roots is a resonance or an antiresonance, and known."""
        return all(self.mode(place) is not None for place in range(3, self.x.size, 2))

    def mode(self, place: int) -> Mode | None:
        """Of the two parameters from this place on; None where it is no sharp one, or at the band's edge."""
        damping, omega = self.estimate(place + 1, is_log=True), self.estimate(place, is_log=True)
        low, high = (2.0 * np.pi * end for end in self.inside)
        is_inside = low < omega.interval90[0] and omega.interval90[1] < high
        if not is_inside or damping.value > _SHARP or self.chi2 > _RESEMBLES * self.freedom:
            return None
        hertz = Estimate(omega.value / (2.0 * np.pi), tuple(end / (2.0 * np.pi) for end in omega.interval90))  # type: ignore[arg-type]
        return Mode(hertz, damping)


def _response(seen: _Spectrum, lines: NDArray[np.bool_], power: int) -> Response:
    """What a spectrum shows at the lines that count."""
    fit = _fitted(seen, lines, power)
    has = fit.shape
    shown = has.seen(fit.x, seen, np.ones_like(lines))
    known = seen.frequency_Hz[lines]
    measured = np.interp(seen.frequency_Hz, known, np.unwrap(_angle(seen.response[lines])))
    fitted = _turned_to(measured, _angle(shown))
    phase = np.where(lines, _turned_to(fitted, _angle(seen.response)), np.nan)
    first = phase[lines][0] - _turned_to(np.zeros(1), phase[lines][:1])[0]  # whole turns, that mean nothing
    with np.errstate(divide="ignore"):
        magnitude, of_fit = (20.0 * np.log10(np.abs(one)) for one in (seen.response, shown))
    return Response(
        magnitude_dB=np.where(lines, magnitude, np.nan),
        phase_deg=np.degrees(phase - first),
        coherence=seen.coherence,
        sigma=np.where(lines, seen.sigma, np.nan),
        resonance=fit.mode(3) if has.has_resonance else None,
        antiresonance=fit.mode(5) if has.has_antiresonance else None,
        delay_s=fit.delay,
        fitted_dB=of_fit,
        fitted_deg=np.degrees(fitted - first),
    )


def _angle(values: Complex) -> Array:
    return np.asarray(np.angle(values), dtype=float)


def _turned_to(near: Array, angle: Array) -> Array:
    """Angles, rad, by as many whole turns more or less as bring them next to others."""
    return angle + 2.0 * np.pi * np.round((near - angle) / (2.0 * np.pi))


def _fitted(seen: _Spectrum, lines: NDArray[np.bool_], power: int) -> _Fit:
    """The simplest shape that the lines do not ask more of.

    Each begins at several places, as if a line were a frequency, and the best ones go on as the estimate shows them.
    """
    frequency, response = seen.frequency_Hz[lines], seen.response[lines]
    omega = 2.0 * np.pi * frequency
    middle = float(np.median(np.log(np.abs(response) / omega**power)))
    slope = float(np.polyfit(omega, np.unwrap(np.angle(response)), 1)[0])
    poles = [math.log(one) for one in (0.3 * omega[0], math.sqrt(omega[0] * omega[-1]))]
    delays = [0.0, max(-slope, 0.0)]
    plain = [
        one
        for sign in (1.0, -1.0)
        if (one := _best(seen, lines, [(_Shape(power, sign), np.array([middle, pole, delay]))
                                       for pole in poles for delay in delays]))
    ]  # fmt: skip
    found = min(plain, key=lambda one: one.chi2)
    over = np.log(np.abs(response) / np.abs(found.shape.at(found.x, frequency)))
    tops, lows = (
        [[math.log(omega[at]), _SHARP_START] for at in _extremes(sign * over)[:_MOST_EXTREMES]] for sign in (1.0, -1.0)
    )
    begins = [
        (one.shape.sign, np.array([*one.x[:2], delay]))
        for one in plain
        for delay in dict.fromkeys((0.0, max(float(one.x[2]), 0.0)))
    ]
    with_peak = [(_Shape(power, sign, True), np.concatenate([x, top])) for sign, x in begins for top in tops]
    both = [
        (_Shape(power, sign, True, True), np.concatenate([x, top, low]))
        for sign, x in begins
        for top in tops
        for low in lows
    ]
    for more in (with_peak, both):
        best = _best(seen, lines, more)
        if best is None:
            continue
        price = (best.x.size - found.x.size) * math.log(2.0 * frequency.size) + _PAID
        if best.chi2 < found.chi2 - price and best.chi2 < _BETTER * found.chi2:
            found = best
    return found


def _best(seen: _Spectrum, lines: NDArray[np.bool_], starts: Sequence[tuple[_Shape, Array]]) -> _Fit | None:
    """The best fit of those that begin there; None where no root of one is sharp."""
    coarse = sorted((_least(seen, lines, *one, bands=False) for one in starts), key=lambda one: one.chi2)
    fine = [_least(seen, lines, one.shape, one.x) for one in coarse[:_GO_ON]]
    return min((one for one in fine if one.is_sharp), key=lambda one: one.chi2, default=None)


def _extremes(values: Array) -> list[int]:
    """Places of the local maxima, the highest first."""
    smooth = np.convolve(np.pad(values, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    inner = np.flatnonzero((smooth[1:-1] >= smooth[:-2]) & (smooth[1:-1] > smooth[2:])) + 1
    return sorted(inner.tolist(), key=lambda at: -smooth[at])


def _least(seen: _Spectrum, lines: NDArray[np.bool_], shape: _Shape, start: Array, *, bands: bool = True) -> _Fit:
    """Least squares of ln H, robust against single lines; χ² counts what neighbouring lines tell once.

    bands: whether a line is the band that it is, else the frequency in its middle.
    """
    from scipy.optimize import least_squares  # takes a while to import

    frequency, response = seen.frequency_Hz[lines], seen.response[lines]
    weight = 1.0 / seen.sigma[lines]

    def left(x: Array) -> Array:
        apart = np.log(response / (shape.seen(x, seen, lines) if bands else shape.at(x, frequency)))
        apart = np.real(apart) + 1j * np.angle(np.exp(1j * np.imag(apart)))
        return np.concatenate([np.real(apart) * weight, np.imag(apart) * weight])

    low, high = math.log(2.0 * np.pi * frequency[0]), math.log(2.0 * np.pi * frequency[-1])
    bounds = [(start[0] - _FAR, start[0] + _FAR), (low - 5.0, high + 5.0), (-_EARLY * seen.step_s, 0.5 * seen.piece_s)]
    bounds += [(low, high), (_LEAST_DAMPING, _MOST_DAMPING)] * ((start.size - 3) // 2)
    lower, upper = np.array(bounds).T
    start = np.clip(start, lower + 1e-9, upper - 1e-9)
    scale = np.array([1.0, 1.0, 1e-3, *([0.05, 0.5] * ((start.size - 3) // 2))])
    most, close = (_MOST_TRIALS, 1e-8) if bands else (_FIRST_TRIALS, 1e-3)
    fit = least_squares(
        left, start, bounds=(lower, upper), loss="soft_l1", x_scale=scale, max_nfev=most, ftol=close, xtol=close
    )
    normal = fit.jac.T @ fit.jac
    chi2 = 2.0 * float(fit.cost) / _ALIKE_LINES
    freedom = max(2.0 * frequency.size / _ALIKE_LINES - start.size, 1.0)
    covariance = np.linalg.pinv(normal) * _ALIKE_LINES * max(chi2 / freedom, 1.0)
    inside = float(frequency[_EDGE]), float(frequency[-1 - _EDGE])
    return _Fit(shape, fit.x, chi2, freedom, covariance, inside, float(lower[2]))


# --- where both differ ------------------------------------------------------------------------------------------------


def _first(one: Response, kept: NDArray[np.bool_]) -> Response:
    """Without the lines behind the band."""
    arrays = {name: value[kept] for name, value in vars(one).items() if isinstance(value, np.ndarray)}
    return replace(one, **arrays)


def _apart(frequency_Hz: Array, counts: NDArray[np.bool_], measured: Response, model: Response) -> tuple[Apart, ...]:
    """Stretches of frequencies at which the magnitudes differ beyond their scatter, the largest first."""
    over = measured.magnitude_dB - model.magnitude_dB
    scatter = 20.0 / math.log(10.0) * np.hypot(measured.sigma, model.sigma)
    with np.errstate(invalid="ignore"):
        far = counts & (np.abs(over) > _APART * scatter)
    at = np.flatnonzero(counts)  # neighbours among those that count
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.where(far[at], np.sign(over[at]), 0.0), [0]])))
    found = []
    for start, stop in pairwise(edges):
        part = at[start:stop]
        if part.size >= _LEAST_BAND and far[part].all():
            top = part[int(np.argmax(np.abs(over[part])))]
            ends = float(frequency_Hz[part[0]]), float(frequency_Hz[part[-1]])
            found.append(Apart(*ends, float(over[top]), float(frequency_Hz[top])))
    return tuple(sorted(found, key=lambda one: -abs(one.most_dB)))


# --- a recording to try it on: a sweep over the resonance of a drive train that yields --------------------------------

_DURATION_S = 6.0
_SWEEP = {"start_Hz": 1.0, "end_Hz": 100.0, "end_time_s": _DURATION_S, "amplitude_rad": 0.002}
_SENSORS = Sensors(current_noise_A=0.1)


def sweep(actuator: Actuator) -> Measurement:
    """Of an actuator whose transmission is elastic, as its model is not."""
    true = simulate_reference(
        Run(command("chirp", _SWEEP), _DURATION_S), actuator, effects={"torsional_compliance": {}}
    )
    return _SENSORS.record(true, seed=0)
