"""One run of a model: a command and a load in, signals out; and beside it the same run with an effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import WITHOUT_LOOP
from ema_model.commands import COMMANDS, Command, command
from ema_model.effects import Effect, find
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.physics.rows import LANES
from ema_model.quantities import ROTARY, USER, Axes, check_number, in_sentence, parameter_title, unit_of
from ema_model.recordings import Measurement
from ema_model.side_by_side import blocks
from ema_model.simulation.pack import (
    initial_reference_state,
    initial_state,
    is_compiled,
    monitor_rows,
    reference_rows,
    stack_at_hand,
    wait_for,
)
from ema_model.stacks import Stack

# --- how the load on the user shaft goes over time: constant, a step, a sine or a chirp (the thesis's load block) -----

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoadProfile:
    """Shares of the run's load torque over time.

    time_s: when a step comes, and how long a chirp's frequency rises; frequency_Hz: of a sine, and where a chirp ends.
    Raises InputError for a shape that does not exist, for what is no number and for numbers that make no sense.
    """

    shape: str = "constant"
    time_s: float = 0.1
    frequency_Hz: float = 5.0

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            like = did_you_mean(self.shape, SHAPES)
            raise InputError(
                f"the load's shape must be one of {', '.join(SHAPES)}, not {quoted(self.shape, 40)!r}{like}"
            )
        for name in ("time_s", "frequency_Hz"):
            value = getattr(self, name)
            check_number(value, f"the load's {name}")
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"the load's {name} must be above 0, not {value:g}")

    def at(self, time_s: NDArray[np.floating]) -> Array:
        """Shares of the torque at these times, −1 … 1, (n,)."""
        return _SHAPES[self.shape](np.asarray(time_s, dtype=float), self)


@dataclass(frozen=True, eq=False)
class RecordedLoad:
    """Shares of the run's load torque as they were recorded, (n,) each; the last one stays."""

    time_s: Array
    shares: Array

    def at(self, time_s: NDArray[np.floating]) -> Array:
        """As `LoadProfile.at`."""
        return np.interp(time_s, self.time_s, self.shares)


def _constant(time_s: Array, _: LoadProfile) -> Array:
    return np.ones_like(time_s)


def _step(time_s: Array, profile: LoadProfile) -> Array:
    return np.where(time_s < profile.time_s - 1e-12, 0.0, 1.0)


def _sine(time_s: Array, profile: LoadProfile) -> Array:
    return np.sin(2.0 * np.pi * profile.frequency_Hz * time_s)


def _chirp(time_s: Array, profile: LoadProfile) -> Array:
    swept = np.minimum(time_s, profile.time_s)
    cycles = profile.frequency_Hz * (0.5 * swept**2 / profile.time_s + time_s - swept)
    return np.sin(2.0 * np.pi * cycles)


SHAPES = ("constant", "step", "sine", "chirp")
_SHAPES: dict[str, Callable[[Array, LoadProfile], Array]] = dict(zip(SHAPES, (_constant, _step, _sine, _chirp)))

# --- a run as a part of a sentence ------------------------------------------------------------------------------------


def run_in_words(command: str, settings: Mapping[str, float], duration_s: float, axes: Axes = ROTARY) -> str:
    """'a sine with amplitude 0.03 rad, frequency 2 Hz, for 0.5 s'."""
    title = COMMANDS[command].title
    named = {axes.name(name, USER): value for name, value in settings.items()}
    parts = (
        f"{in_sentence(parameter_title(name))} {value:.4g} {unit_of(name)}".rstrip() for name, value in named.items()
    )
    article = "an" if title[:1] in "AEIOU" else "a"
    return f"{article} {in_sentence(title)} with {', '.join(parts) or 'its usual settings'}, for {duration_s:g} s"


# --- the Monitor Model's and inverse dynamics' kernels called for a population ----------------------------------------
# The Monitor Model's and inverse dynamics' kernels called for a population, its blocks of lanes side by side.

AnyFloat = NDArray[np.floating]
NOTHING = np.zeros(0)


def traced(
    stack: Stack,
    state: Array,
    rows: Array,
    run: tuple[AnyFloat, AnyFloat, AnyFloat],
    period: int,
    group: int,
    step_s: float,
    before: AnyFloat = NOTHING,
) -> Array:
    """The four signals of `monitor.traces`: (blocks, values, 4, LANES).

    run: command, load and supply at each step; before: the command at those before the start.  state and rows: a block
    of lanes each; state is left as it is at the end.
    """
    wait_for(stack, "traces")
    result = np.empty((len(rows), len(run[0]) // (period * group), 4, LANES))

    def simulate(part: slice) -> None:
        stack.monitor.traces(state[part], rows[part], before, *run, period, group, step_s, result[part])

    blocks(simulate, len(rows))
    return result


def needed_currents(stack: Stack, rows: Array, motion: tuple[Array, Array, Array, Array, Array], still: float) -> Array:
    """The current of `inverse.currents`, A: (blocks, samples, LANES).

    motion: position, speed, acceleration, load and time at each sample; rows: a block of lanes each.
    """
    wait_for(stack, "currents")
    result = np.empty((len(rows), len(motion[0]), LANES))

    def compute(part: slice) -> None:
        stack.inverse.currents(rows[part], *motion, still, result[part])

    blocks(compute, len(rows))
    return result


# --- one run of a model: a command and a load in, signals out ---------------------------------------------------------

Effects = Mapping[str, Mapping[str, float]]

MONITOR_STEP_S = 1e-5
REFERENCE_SUBSTEPS = 10  # of the Reference Model in one step of the Monitor Model
_LONGEST_S = 600.0
SLOWEST_HZ, FASTEST_HZ = 100.0, 1e6  # sampling
MOST_STEPS = 60_000_000  # of the Monitor Model in one run: its longest at its usual step
_MOST_SAMPLES = 10_000_000


@dataclass(frozen=True)
class Run:
    """What is asked of the actuator, and how it is sampled.

    Sample k stands at t = k / sample_rate, k = 0, 1, …; its current is the mean over the period that ends
    there, the other signals are instantaneous.
    """

    command: Command = field(default_factory=lambda: command("chirp"))
    duration_s: float = 0.5
    sample_rate_Hz: float = 10_000.0
    load_torque_Nm: float = 0.0  # on the user shaft, positive opposes positive motion
    load: LoadProfile | RecordedLoad = field(default_factory=LoadProfile)  # how that goes over time

    def __post_init__(self) -> None:
        check_number(self.duration_s, "the duration")
        check_number(self.sample_rate_Hz, "the sample rate")
        check_number(self.load_torque_Nm, "the load torque")
        if not 1e-3 <= self.duration_s <= _LONGEST_S:
            raise InputError(f"the duration must lie between 0.001 and {_LONGEST_S:g} s, not {self.duration_s:g}")
        if not SLOWEST_HZ <= self.sample_rate_Hz <= FASTEST_HZ:
            limits = f"{SLOWEST_HZ:.0f} and {FASTEST_HZ:.0f} Hz"
            raise InputError(f"the sample rate must lie between {limits}, not {self.sample_rate_Hz:g}")
        if not abs(self.load_torque_Nm) <= 1e6:
            raise InputError(f"the load torque must be a number of N·m up to 1e6, not {self.load_torque_Nm:g}")
        if self.duration_s * self.sample_rate_Hz < 1.0:
            raise InputError("the run must last for one sample or more")
        if self.samples > _MOST_SAMPLES:
            asked = f"{self.duration_s:g} s at {self.sample_rate_Hz:g} Hz are {self.samples} samples"
            raise InputError(f"{asked}, and {_MOST_SAMPLES} are the most; shorten the run, or lower the sample rate")

    @property
    def samples(self) -> int:
        """Sampling periods in the run."""
        return round(self.duration_s * self.sample_rate_Hz)

    @property
    def time_s(self) -> Array:
        """Times of the samples, (samples + 1,)."""
        return np.arange(self.samples + 1) / self.sample_rate_Hz

    def load_at(self, time_s: NDArray[np.floating]) -> Array:
        """The load at these times, N·m, (n,)."""
        return self.load_torque_Nm * self.load.at(time_s)


def steps_per_sample(period_s: float, step_s: float = MONITOR_STEP_S) -> int:
    """Monitor steps in a sampling period: as many as keep them at `step_s` or just below."""
    return max(1, int(np.ceil(period_s / step_s - 1e-6)))


def _steps_per_sample(run: Run, step_s: float) -> int:
    """The same for a run; InputError where it is too long for steps that short."""
    period = steps_per_sample(1.0 / run.sample_rate_Hz, step_s)
    if run.samples * period > MOST_STEPS:
        steps = f"{run.samples * period:.2g} steps of the model of {1.0 / run.sample_rate_Hz / period:g} s"
        raise InputError(
            f"{run.duration_s:g} s at {run.sample_rate_Hz:g} Hz are {steps}, and at most {MOST_STEPS:g} are simulated; "
            "take a shorter duration or a lower sample rate"
        )
    return period


def reference_steps(run: Run) -> tuple[NDArray[np.floating], int, float]:
    """The times at which the Reference Model is told its inputs, how many of them a sample, and how far apart, s."""
    period = _steps_per_sample(run, MONITOR_STEP_S)
    dt = 1.0 / run.sample_rate_Hz / period
    return np.arange(run.samples * period + 1) * dt, period, dt


def simulate_reference(
    run: Run,
    actuator: Actuator,
    k: ArrayLike | None = None,
    effects: Effects | None = None,
    *,
    start_rad: float | None = None,
    start_speed_rad_s: float = 0.0,
    start_play_rad: float = 0.0,
    start_integral_Nm: float = 0.0,
    start_time_s: float = 0.0,
    before: Array = NOTHING,
    voltages: bool = False,
) -> Measurement:
    """The three-phase Reference Model's signals; with `voltages`, also the legs' (V, against the bus's middle).

    k: without it, the actuator's own.  It starts at start_rad, a user's angle, or where the command starts; with a
    motor speed, at a place in the play (rad at the motor), with a speed loop's integral action, and so long after the
    recording's start, all 0 unless given.  before: commands up to there, of `reference_steps`, that the drive followed.
    Raises InputError for settings of effects that do not exist, FloatingPointError if the model diverges.
    """
    effects = {name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()}
    if not actuator.has_reference_model:
        raise InputError(
            f"{quoted(actuator.name)}: the reference model is of a cascade with a hysteresis inverter; "
            "use the monitor model"
        )
    stack = stack_at_hand(actuator, effects, "reduced", "run")
    times, period, dt = reference_steps(run)
    demand = run.command.at(times)
    load = run.load_at(times)
    start = float(demand[0]) if start_rad is None else start_rad
    result = np.empty((run.samples, 11))
    wait_for(stack, "run")
    stack.reference.run(
        initial_reference_state(
            actuator, start, start_speed_rad_s, start_play_rad, stack, start_integral_Nm, start_time_s
        ),
        reference_rows(actuator, actuator.k if k is None else k, stack, effects),
        before,
        demand,
        load,
        period,
        REFERENCE_SUBSTEPS,
        dt / REFERENCE_SUBSTEPS,
        result,
    )
    signals = _signals(run, actuator, result, start)
    for column, name in enumerate(
        ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A", "motor_torque_Nm"), 4
    ):
        signals[name] = np.concatenate([[0.0], result[:, column]])
    if voltages:
        for column, name in enumerate(("leg_a_voltage_V", "leg_b_voltage_V", "leg_c_voltage_V"), 8):
            signals[name] = np.concatenate([[0.0], result[:, column]])
    return Measurement(finite(signals, "the reference model", actuator.axes), name="reference model")


def simulate_monitor(
    run: Run,
    actuator: Actuator,
    k: ArrayLike | None = None,
    effects: Effects | None = None,
    circuit: str = "reduced",
    *,
    start_rad: float | None = None,
) -> Measurement:
    """The Monitor Model's signals; raises as `simulate_reference`."""
    return simulate_monitors(
        run, actuator, np.asarray(actuator.k if k is None else k)[None], effects, circuit, start_rad=start_rad
    )[0]


def simulate_monitors(
    run: Run,
    actuator: Actuator,
    k: ArrayLike,
    effects: Effects | None = None,
    circuit: str = "reduced",
    *,
    start_rad: float | None = None,
) -> tuple[Measurement, ...]:
    """The Monitor Model's signals for every k of (n, 8), in one run of the population; as `simulate_monitor`."""
    k = np.atleast_2d(np.asarray(k, dtype=float))
    effects = {name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()}
    if actuator.controller.kind in WITHOUT_LOOP:
        raise InputError(f"{quoted(actuator.name)}: its controller is not known, so that no command can be simulated")
    stack = stack_at_hand(actuator, effects, circuit, "traces")
    period = _steps_per_sample(run, actuator.step_s)
    dt = 1.0 / run.sample_rate_Hz / period
    times = np.arange(run.samples * period) * dt
    demand = run.command.at(times)
    start = float(demand[0]) if start_rad is None else start_rad
    blocks = -(-len(k) // LANES)
    state, rows = initial_state(actuator, blocks, start, stack=stack), monitor_rows(actuator, k, stack, effects)
    result = traced(stack, state, rows, (demand, run.load_at(times), np.ones_like(demand)), period, 1, dt)
    runs = (_signals(run, actuator, result[i // LANES, :, :, i % LANES], start) for i in range(len(k)))
    return tuple(Measurement(finite(one, "the monitor model", actuator.axes), name="monitor model") for one in runs)


def _signals(run: Run, actuator: Actuator, result: Array, start_rad: float) -> dict[str, Array]:
    """The kernels' columns as named signals; sample 0 is the start, at rest."""
    time = run.time_s
    demand = run.command.at(time)
    tau = actuator.transmission.gear_ratio

    def column(index: int, start: float) -> Array:
        return np.concatenate([[start], result[:, index]])

    transmission = actuator.transmission
    theta = float(np.clip(start_rad, transmission.stop_low_rad, transmission.stop_high_rad)) / tau
    signals = {
        "time_s": time,
        "command_rad": demand,
        "user_position_rad": column(3, tau * theta),
        "motor_position_rad": column(2, theta),
        "motor_speed_rad_s": column(1, 0.0),
        "current_A": column(0, 0.0),
    }
    if run.load_torque_Nm:
        signals["load_torque_Nm"] = run.load_at(time)
    return signals


def finite(signals: dict[str, Array], what: str, axes: Axes) -> dict[str, Array]:
    """The same signals, "time_s" among them.  Raises FloatingPointError if one of them is not finite."""
    for name, values in signals.items():
        if not np.all(np.isfinite(values)):
            at = signals["time_s"][int(np.argmin(np.isfinite(values)))]
            raise FloatingPointError(
                f"{what} diverged: {axes.signal(name)} is not finite from {at:g} s on; check the settings"
            )
    return signals


# --- a run with an effect beside the same run without: what it does, and which signal and run show it most ------------

SHOWN = ("current_A", "user_position_rad", "motor_speed_rad_s")
RUNS: dict[str, Run] = {
    "sine of 3 Hz": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5),
    "sine of 3 Hz, loaded": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5, 10_000.0, 200.0),
    "step": Run(command("step", {"final_rad": 0.005}), 0.2),
    "chirp": Run(command("chirp"), 0.5),
}
_SATURATED = "step"  # where the drive stands at its limits, so that a small effect shifts the whole transient
_LEAST = 1e-3  # of a signal's range, rms
_TURN = 2.0 * np.pi
_PERIODS, _LONG_PERIODS = 3, 2  # that are shown; of a period as long as a turn


@dataclass(frozen=True, eq=False)
class WithEffect:
    """What an effect does in a run."""

    name: str
    run: str
    settings: Mapping[str, float]
    with_it: Measurement
    without: Measurement

    def change(self, name: str) -> tuple[float, Array]:
        """What changes in a signal, (samples,), and its rms as a share of the signal's range; 0 for next to nothing."""
        share, change = self._share(name)
        return (share if share > _LEAST else 0.0), change

    def _share(self, name: str) -> tuple[float, Array]:
        change = self.with_it[name] - self.without[name]
        return float(np.sqrt(np.mean(change**2))) / (float(np.ptp(self.without[name])) or 1.0), change

    def against(self, variable: str) -> Array:
        """A variable of `ema_model.quantities.VARIABLES` in the run with the effect, (samples,), in its unit.

        KeyError for one that no run has: a temperature.
        """
        run = self.with_it
        if variable == "acceleration":
            return np.gradient(run["motor_speed_rad_s"], run.time_s)
        if variable == "load":
            return run.get("load_torque_Nm", np.zeros(run.samples))
        return run[_SIGNALS[variable]]

    @property
    def shows(self) -> str:
        """The signal that shows it most."""
        return max(SHOWN, key=lambda name: self.change(name)[0])

    @property
    def visibility(self) -> float:
        """How much of that signal's range changes, rms."""
        return self.change(self.shows)[0]

    @property
    def trace(self) -> float:
        """The same where that is next to nothing."""
        return max(self._share(name)[0] for name in SHOWN)


_SIGNALS = {
    "motor_angle": "motor_position_rad",
    "user_position": "user_position_rad",
    "motor_speed": "motor_speed_rad_s",
    "current": "current_A",
    "time": "time_s",
}


def few_periods(settings: Mapping[str, float]) -> tuple[float, int]:
    """The angle over which an effect with these settings repeats a few times, rad (m of a linear motor), and how often.

    By its order or its period; what has neither repeats once a turn.
    """
    period = settings.get("period_rad", _TURN / settings.get("order", 1.0))
    count = _PERIODS if period < 0.99 * _TURN else _LONG_PERIODS
    return count * period, count


class EffectRuns:
    """An actuator's effects in `RUNS`; the runs without them are simulated once."""

    def __init__(self, actuator: Actuator) -> None:
        self.actuator = actuator
        self._without: dict[str, Measurement] = {}

    def is_compiled(self, name: str) -> bool:
        """Whether a run with that effect begins at once; else its kernel is compiled first."""
        if self.actuator.controller.kind in WITHOUT_LOOP:
            return True  # it is refused at once
        return is_compiled(stack_at_hand(self.actuator, {name}, "reduced", "traces"), "traces")

    def felt(self, name: str, settings: Mapping[str, float], run: str) -> WithEffect:
        """With and without, by the Monitor Model; InputError where the actuator does not stand the effect."""
        try:
            if run not in self._without:
                self._without[run] = simulate_monitor(RUNS[run], self.actuator)
            with_it = simulate_monitor(RUNS[run], self.actuator, effects={name: dict(settings)})
        except FloatingPointError as error:
            raise InputError(f"{find(name).title}: {error}; make it weaker") from None
        return WithEffect(name, run, dict(settings), with_it, self._without[run])

    def clearest(self, effect: Effect) -> WithEffect | None:
        """An effect at its clear severity in the run that shows it most; None where the actuator stands none.

        What follows a variable is looked for in the saturated run last, and what repeats with the motor's angle in runs
        that go through some periods; where none shows it, the largest trace counts.
        """
        found: list[WithEffect] = []
        for run in RUNS:
            with suppress(InputError):
                found.append(self.felt(effect.name, effect.at_severity(1), run))

        def rank(felt: WithEffect) -> tuple[bool, float, float]:
            fits = effect.against == "time" or felt.run != _SATURATED
            if effect.against == "motor_angle":
                fits &= float(np.ptp(felt.against("motor_angle"))) > few_periods(felt.settings)[0]
            return fits and felt.visibility > 0.0, felt.visibility, felt.trace

        return max(found, key=rank, default=None)

    def severities(self, effect: Effect) -> list[WithEffect]:
        """An effect when slight, clear and strong, in the run of `clearest`; none where the actuator stands none.

        Raises InputError where it does not stand the effect when that is strong.
        """
        clear = self.clearest(effect)
        if clear is None:
            return []
        slight, strong = (self.felt(effect.name, effect.at_severity(i), clear.run) for i in (0, 2))
        return [slight, clear, strong]
