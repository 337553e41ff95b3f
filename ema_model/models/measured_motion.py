"""The measured motion as the models take it: even, filtered, later; and a drive that answers late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d

from ema_model.actuator import Actuator, Tolerance
from ema_model.errors import InputError, quoted
from ema_model.files.opened import listed
from ema_model.models.loop_window import BLOCK_S, CONTEXT
from ema_model.models.model import Window
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import ALONG_A_MAP
from ema_model.recordings.signals import NEAR, WITHIN, sample_noise, scatter_of
from ema_model.simulation.run import FASTEST_HZ, SLOWEST_HZ, steps_per_sample

# --- signals a little later than they are, by Taylor's series about each sample ---------------------------------------

Array = NDArray[np.float64]


def later(values: Array, late_s: Array, period_s: float, *, smooth: bool = False) -> Array:
    """Signals (n, samples) so much later, (n, 1): to the first order; of smooth ones to the second."""
    if not np.any(late_s):
        return values
    with np.errstate(invalid="ignore", over="ignore"):  # of one that diverges
        slope = np.gradient(values, period_s, axis=1)
        shifted = values - late_s * slope
        return shifted + 0.5 * late_s**2 * np.gradient(slope, period_s, axis=1) if smooth else shifted


# --- a digital drive answers late: by how much no actuator's file says, so that every comparison looks for it ---------

_DELAY = "computation_delay"
_SENSORS_DELAY = "sensors.delay_s"
_WITHIN_SAMPLE = 12.0**-0.5  # of it: anywhere within a sample
_SERVO_SAMPLE_S = 2e-3  # of a usual position servo


def with_delay_of_drive(actuator: Actuator, measurements: Sequence[Measurement]) -> Actuator:
    """The actuator with a computation delay of 0 that a calibration may move, and the delay of its sensors as well.

    1 σ is about a sample of the recordings, of a position servo no less than its own, however fast it is logged; of the
    sensors' a third: a command and what was measured beside it are of the same sample, but not of the same moment.

    Without them, what the loop loses of its damping is taken for a torque constant or a current sensor that is off.
    As it is where its drive is the three-phase model's, which is not a digital one, or where no drive is simulated.
    """
    if actuator.controller.kind == "open" and not actuator.takes_voltage:
        return _with_late_motion(actuator, measurements)
    is_simulated = actuator.controller.kind in ("cascade", "position") or actuator.takes_voltage
    if not is_simulated or actuator.has_reference_model:
        return actuator
    if _DELAY in actuator.effects or not any(one.free for one in actuator.tolerances.values()):
        return actuator
    own = _SERVO_SAMPLE_S if actuator.controller.kind == "position" else 0.0
    sample = max(one.sample_period_s for one in measurements)
    looked_for = {
        _SENSORS_DELAY: Tolerance(_WITHIN_SAMPLE * sample, True),
        f"effects.{_DELAY}.delay_s": Tolerance(max(own, sample), True),
    }
    return replace(
        actuator,
        effects={**actuator.effects, _DELAY: {"delay_s": 0.0}},
        tolerances={**looked_for, **actuator.tolerances},
    )


def _with_late_motion(actuator: Actuator, measurements: Sequence[Measurement]) -> Actuator:
    """In open loop: a current that was measured is a sample's mean, and one that was asked for holds until the next.

    By which of them, and how long its drive takes, the motion comes later than the model's is not in the log.
    """
    free = [path for path, one in actuator.tolerances.items() if one.free]
    if not free or _SENSORS_DELAY in actuator.tolerances:
        return actuator
    late = Tolerance(max(one.sample_period_s for one in measurements), True)
    return replace(actuator, tolerances={**actuator.tolerances, _SENSORS_DELAY: late})


# --- what of a recording's sampling a model can follow ----------------------------------------------------------------
# What of a recording's sampling a model can follow: checked before anything is laid out in steps of the model.

MOST_STEPS = 20_000_000  # of the model, over all recordings at once: 200 s at 10 µs, half a gigabyte of inputs
_MOST_FILLED = 10.0  # samples on an even grid for each that was recorded, before its time counts as full of gaps
_SLOWEST = 100.0  # half widths of the motion's filter
_ADVICE = "check the unit of time_s"


def on_even_grid(measurement: Measurement) -> Measurement:
    """The measurement on a grid of its own median period; InputError where that would mostly fill gaps."""
    period = measurement.sample_period_s
    if not period > 0.0:  # NaN: every run is one sample
        raise InputError(f"{measurement.name}: no run has two samples; check the column segment")
    if measurement.is_uniform:
        return measurement
    if measurement.duration_s > _MOST_FILLED * measurement.samples * period:
        seen = f"{measurement.samples} samples, {period:g} s apart at the median, last for {measurement.duration_s:g} s"
        raise InputError(f"{measurement.name}: {seen}; {_ADVICE}, or number the runs between gaps in a column segment")
    return measurement.resampled(period)


def check_steps(measurements: Sequence[Measurement], parts: Sequence[list[slice] | None], actuator: Actuator) -> None:
    """Raises InputError where a closed loop cannot be simulated beside recordings on even grids, whole or in parts."""
    total, steps = 0, actuator.step_s
    for measurement, slices in zip(measurements, parts):
        period = measurement.sample_period_s
        if actuator.has_reference_model and not 0.999 / FASTEST_HZ <= period <= 1.001 / SLOWEST_HZ:
            raise InputError(
                f"{measurement.name}: its sampling period of {period:g} s is not between {1.0 / FASTEST_HZ:g} and "
                f"{1.0 / SLOWEST_HZ:g} s, which the reference model can follow; {_ADVICE}, or record at another rate"
            )
        samples = sum(one.stop - one.start for one in slices or measurement.runs)
        total += samples * steps_per_sample(period, steps)
        if total > MOST_STEPS:
            raise InputError(
                f"{measurement.name}: {samples} samples every {period:g} s take it to {total:.2g} steps of the model "
                f"({steps:g} s), and at most {MOST_STEPS:g} are simulated; {_ADVICE}, or take a shorter part"
            )


def check_period(measurement: Measurement, filter_s: float) -> None:
    """Raises InputError where samples are too far apart to tell speed and acceleration."""
    period = measurement.sample_period_s
    if period > _SLOWEST * filter_s:
        seen = f"its sampling period of {period:g} s is far too long to differentiate the motion over {filter_s:g} s"
        raise InputError(f"{measurement.name}: {seen}; {_ADVICE}, or record faster")


# --- which parts of long recordings are simulated: a fit takes seconds, not the hours that a rig can record -----------

_FIT_STEPS = 300_000  # of the model over all recordings, for a calibration: 3 s at 1e-5 s
_FIT_BLOCKS = 16_000  # of a closed loop over all recordings, for a calibration: more tell no more, and take longer
_MOST_STEPS = 12_000_000  # for the evaluation: 120 s
_PARTS = 6  # that a long recording is fitted on
_LEAST_S = 0.05
_STEPS_A_SAMPLE = 2.0


def fit_stretches(measurements: Sequence[Measurement], actuator: Actuator) -> list[list[slice] | None] | None:
    """Parts of each recording to calibrate on, spread over its length; None if all can be taken whole."""
    return _stretches(measurements, actuator, _FIT_STEPS, _PARTS, _FIT_BLOCKS)


def evaluation_stretches(measurements: Sequence[Measurement], actuator: Actuator) -> list[list[slice] | None] | None:
    """Parts of each recording to simulate for the residuals; None, whole, for all but very long ones."""
    return _stretches(measurements, actuator, _MOST_STEPS, 10 * _PARTS)


def _stretches(
    measurements: Sequence[Measurement], actuator: Actuator, budget: int, parts: int, most_blocks: float = np.inf
) -> list[list[slice] | None] | None:
    if any(measurement.is_map for measurement in measurements):
        return None
    measurements = [on_even_grid(measurement) for measurement in measurements]  # whose samples the slices count
    if actuator.controller.kind == "unknown":  # a sample costs as much as some steps of a simulation
        steps = [_STEPS_A_SAMPLE * measurement.samples for measurement in measurements]
        blocks = 0.0
    else:
        steps = [measurement.duration_s / actuator.step_s for measurement in measurements]
        blocks = sum(one.duration_s / max(one.sample_period_s, BLOCK_S) for one in measurements)
    share = min(budget / max(sum(steps), 1.0), most_blocks / max(blocks, 1.0))
    if share >= 1.0:
        return None
    return [_of(measurement, share, parts, actuator) for measurement in measurements]


def _of(measurement: Measurement, share: float, parts: int, actuator: Actuator) -> list[slice]:
    """Stretches of the runs, `share` of their length together; the first starts with the recording."""
    period = measurement.sample_period_s
    wanted = share * measurement.samples
    least = max(200, int(_LEAST_S / period))
    count = int(np.clip(wanted // least, 1, parts))
    length = max(least, int(wanted / count))
    runs = measurement.runs
    starts = np.linspace(0, max(0, measurement.samples - length), count).astype(int)
    found: list[slice] = []
    for start in starts:
        run = next(run for run in runs if start < run.stop)
        first = max(run.start, min(start, run.stop - length))
        piece = slice(int(first), int(min(first + length, run.stop)))
        if not found or piece.start >= found[-1].stop:
            found.append(piece)
    return found


# --- speed and acceleration of a measured position, and the filter that they have passed ------------------------------
# Local parabolas (Savitzky–Golay) give the acceleration; what smoothing that implies is known exactly: the
# acceleration of a motion filtered by h, where h is the twice summed kernel of the second difference. All that is
# held against the acceleration passes the same h, so that a comparison is free of the filter's own error.


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered position (rad), speed (rad/s) and acceleration (rad/s²), (samples,) each, on an even grid."""

    position: Array
    speed: Array
    acceleration: Array
    kernel: Array  # h, sums to 1

    def filtered(self, values: Array) -> Array:
        """Values (…, samples) through h, the ends held."""
        return _convolved(values, self.kernel)


def motion_of(position: Array, period_s: float, half_s: float) -> Motion:
    """The motion of a run, sampled every period_s; half_s: half width of the parabolas, s."""
    from scipy.signal import savgol_coeffs  # takes a third of a second to import

    half = max(2, round(half_s / period_s))
    half = max(1, min(half, (position.size - 1) // 2 - 1))
    size = 2 * half + 1
    second = savgol_coeffs(size, 2, deriv=2, delta=period_s, use="conv")
    kernel = np.cumsum(np.cumsum(second))[:-2] * period_s**2
    kernel /= kernel.sum()
    first = np.convolve([0.5 / period_s, 0.0, -0.5 / period_s], kernel)
    return Motion(
        position=_convolved(position, kernel),
        speed=_convolved(position, first),
        acceleration=_convolved(position, second),
        kernel=kernel,
    )


def _convolved(values: Array, kernel: Array) -> Array:
    """The middle part of a convolution along the last axis; beyond the ends the line goes straight on."""
    from scipy.signal import fftconvolve

    reach = kernel.size // 2
    first, last = values[..., :1], values[..., -1:]
    before = 2.0 * first - values[..., reach:0:-1]
    after = 2.0 * last - values[..., -2 : -reach - 2 : -1]
    padded = np.concatenate([before, values, after], axis=-1)
    shape = (1,) * (values.ndim - 1) + (-1,)
    return fftconvolve(padded, kernel.reshape(shape), mode="valid", axes=-1)


# --- a recording's motion for inverse dynamics: filtered, with the blocks in which friction's law is known ------------
# It is held to what differentiation can tell. What the position is off by (quantisation, jitter of its time stamps)
# acts on the current through the inertia; after the filter it lasts as long as the filter does, and stands in the
# floor as such: a regression that took it for white would be too sure of all that it finds (Janot, Vandanjon and
# Gautier, IEEE Trans. Control Syst. Technol. 22 (2014), on noise in the regressors). About a reversal, friction is no
# step of the measured speed's sign, and until a stroke is on its way bristles may bend where the motor seems to
# slide. Where the actuator asks for it, as a second opinion does, blocks within the filter's reach of either are left
# out, as usual in the identification of robots.

_BLOCKS_PER_FILTER = 6  # compared values in a half width of the motion's filter
_STILL_STEPS = 3.0  # of the encoder within the filter, under which the motor counts as standing
_SLIDES = 0.03  # of a stroke's highest speed, below which bristles may still bend
_SHORT = 4.0  # times that the speed's own filter is shorter, so that what depends on it is filtered once
_LEAST_KEPT = 0.3  # of the moving blocks, which must be left when those about reversals are left out
_NOISE_SAMPLES = 101  # over which a position's noise is taken to stay alike: with jitter it grows with the speed
_RESOLVED = 2e-3  # of a signal's rms, that no rig tells better: a magnet's torque falls by half of it a kelvin


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch(Window):
    """A window with its motion; measured is current_A or motor_torque_Nm, filtered like the model's.

    Blocks at standstill are left out: friction holds any current up to its static limit there.
    """

    motion: Motion
    position: Array  # (samples,), motor, rad
    speed: Array  # (samples,), rad/s, hardly filtered
    load: Array  # (samples,), N·m at the user
    since_s: Array  # (samples,), since the recording's start
    still: float  # rad/s
    sensor_noise: dict[str, float]  # rms per block
    passed: float  # of a sample's white noise, by the filter and the mean over a block
    moving: NDArray[np.intp]  # (blocks,), which of the run's blocks these are

    @property
    def period_s(self) -> float:
        """Between samples."""
        return self.block_s / self.samples_per_block


def stretches_of(
    recorded: Measurement,
    measurement: Measurement,
    actuator: Actuator,
    *,
    recording: int,
    parts: list[slice] | None,
) -> list[Stretch]:
    """The stretches of a recording, as it was recorded and on an even grid; parts: in place of its runs.

    Raises InputError where there is nothing to compare, or too little motion.
    """
    if not measurement.is_map:
        measurement.require("motor_position_rad")
    target = next((name for name in ("current_A", "motor_torque_Nm") if name in measurement), None)
    if target is None:
        wanted = f"current_A or {measurement.shown('motor_torque_Nm')}"
        raise InputError(f"{quoted(measurement.name)}: nothing to compare; {wanted} is needed")
    values = {path: value for rule in actuator.rules_for(measurement.name) for path, value in rule.values.items()}
    period = measurement.sample_period_s
    if not measurement.is_map:
        check_period(measurement, actuator.filter_s)
    size = 1 if measurement.is_map else max(1, round(actuator.filter_s / _BLOCKS_PER_FILTER / period))
    shaken = None if measurement.is_map else _position_noise(recorded, measurement)
    found = []
    if measurement.is_map:
        load, motions = _load_of_map(measurement, target, actuator), [_steady(measurement)]
        runs = [slice(0, measurement.samples)]
    else:
        load, runs = measurement.get("load_torque_Nm"), parts or measurement.runs
        motions = None
    for place, run in enumerate(runs):
        blocks = (run.stop - run.start) // size
        if blocks < 10:
            continue
        position = measurement["motor_position_rad"][run] if motions is None else motions[place].position
        motion = motion_of(position, period, actuator.filter_s) if motions is None else motions[place]
        speed, still, moving = motion.speed, 1e-9, np.arange(blocks)
        if not measurement.is_map:
            steady = actuator.leaves_out_reversals
            own = motion_of(position, period, actuator.filter_s / _SHORT) if steady else motion
            speed, still = own.speed, max(1e-9, _STILL_STEPS * _step_of(position) / (own.kernel.size * period))
            moving = _moving(speed, still, motion.kernel.size, size, steady)
        if moving.size < 10:
            continue

        def means(values: Array, blocks: int = blocks, moving: NDArray[np.intp] = moving) -> Array:
            return values[: blocks * size].reshape(blocks, size).mean(axis=1)[moving]

        raw = measurement[target][run]
        per_acceleration = actuator.motor.inertia_kgm2
        if target == "current_A":
            per_acceleration *= actuator.sensors.current_gain / actuator.motor.torque_constant_Nm_A
        measured = means(motion.filtered(raw))
        passed = _passed(motion.kernel, size)
        lasting = allowed = np.zeros(moving.size)
        if shaken is not None:
            second = np.convolve(motion.kernel, [1.0, -2.0, 1.0]) / period**2
            unsure = per_acceleration * means(shaken[run]) * _passed(second, size)
            allowed = np.full(moving.size, _RESOLVED * np.sqrt(np.mean(measured**2)))
            lasting = np.hypot(unsure, allowed)
        context = {
            "motor_position_rad": means(position),
            "motor_speed_rad_s": means(motion.speed),
            "acceleration_rad_s2": means(motion.acceleration),
            **{name: means(measurement[name][run]) for name in CONTEXT if name in measurement},
        }
        if measurement.is_map and load is not None:
            context["load_torque_Nm"] = means(load)
        found.append(
            Stretch(
                name=measurement.name,
                recording=recording,
                first=run.start,
                time_s=means(measurement.time_s[run]),
                motion=motion,
                position=position,
                speed=speed,
                load=np.zeros_like(position) if load is None else load[run],
                since_s=np.zeros_like(position)
                if measurement.is_map
                else measurement.time_s[run] - measurement.time_s[0],
                still=still,
                command=None,
                measured={target: measured},
                lasting={target: lasting},
                allowed={target: allowed},
                context=context,
                sensor_noise={target: passed * _noise_of(raw, target, position, motion.speed, load)},
                passed=passed,
                alike=1.0 / (size * passed**2),
                moving=moving,
                samples_per_block=size,
                block_s=size * period,
                values=values,
            )
        )
    if not found:
        raise InputError(
            f"{quoted(measurement.name)}: too little motion to compare; {10 * size} samples in motion are needed"
        )
    return found


def _steady(measurement: Measurement) -> Motion:
    """Of a static map: its angles and its constant speeds, 0 where it has none."""
    zero = np.zeros(measurement.samples)
    position, speed = (measurement.get(name, zero) for name in ("motor_position_rad", "motor_speed_rad_s"))
    return Motion(position, speed, zero, np.ones(1))


def _noise_of(raw: Array, target: str, position: Array, speed: Array, load: Array | None) -> float:
    """White noise of a sample, rms; of a table that goes along speed and torque, what its points scatter by."""
    is_table = load is not None and len(load) == len(raw) and not np.ptp(position) and np.ptp(load)
    if not is_table or load is None:
        return sample_noise(raw, target)
    return scatter_of(raw, [one for one in (speed, load) if np.ptp(one)], target)


def _load_of_map(measurement: Measurement, target: str, actuator: Actuator) -> Array | None:
    """What each point of a static map bears, N·m at the user: the load, or a torque measured beside the current.

    A dynamometer holds the motor's shaft by the torque that it reads there.  Raises InputError for a map that goes
    along nothing.
    """
    load = measurement.get("load_torque_Nm")
    if load is None and target == "current_A" and (torque := measurement.get("motor_torque_Nm")) is not None:
        load = torque / actuator.transmission.gear_ratio
    if load is None and not any(name in measurement for name in ("motor_position_rad", "motor_speed_rad_s")):
        along = listed([measurement.shown(name) for name in ALONG_A_MAP])
        raise InputError(f"{quoted(measurement.name)}: a static map goes along one of {along}; it has none beside")
    return load


def _step_of(position: Array) -> float:
    """The smallest step between samples, rad: the encoder's resolution where it is seen."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-9]
    return float(np.quantile(steps, 0.01)) if steps.size else 0.0


def _moving(speed: Array, still: float, reach: int, size: int, steady: bool) -> NDArray[np.intp]:
    """Blocks of `size` samples without standstill, and away from the ends if some are: reach samples, the filter's.

    Beyond the ends nothing was recorded that the filter would need.  Steady ones are away from reversals and from the
    slow parts of strokes as well.
    """
    blocks = speed.size // size
    slow = np.abs(speed) <= still
    moving = np.flatnonzero(~slow[: blocks * size].reshape(blocks, size).any(axis=1))
    left_out = np.zeros(speed.size, bool)
    left_out[[0, -1]] = True
    if steady:
        left_out[:-1] |= np.diff(np.sign(speed)) != 0.0
        begins = np.flatnonzero(np.concatenate([[True], left_out[:-1]]))
        fastest = np.repeat(np.maximum.reduceat(np.abs(speed), begins), np.diff(begins, append=speed.size))
        left_out |= slow | (np.abs(speed) < _SLIDES * fastest)
    near = slow | maximum_filter1d(left_out.astype(np.int8), 2 * reach + 1).astype(bool)
    away = np.flatnonzero(~near[: blocks * size].reshape(blocks, size).any(axis=1))
    return away if away.size >= max(10, _LEAST_KEPT * moving.size) else moving


def _position_noise(recorded: Measurement, even: Measurement) -> Array:
    """White noise of the motor's position about each sample of the even grid, rad, with that of its time stamps.

    From divided differences of the third order as recorded: what was put on another grid is smoother than its noise.
    """
    source = recorded if len(recorded.runs) == 1 else even
    time, position = source.time_s, source["motor_position_rad"]
    points = np.lib.stride_tricks.sliding_window_view(time, 4)
    away = points[:, :, None] - points[:, None, :] + np.eye(4)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = 1.0 / np.prod(away, axis=2)
        weights /= np.sqrt(np.sum(weights**2, axis=1, keepdims=True))
    third = np.nan_to_num(np.sum(weights * np.lib.stride_tricks.sliding_window_view(position, 4), axis=1))
    size = np.abs(third)
    around = min(_NOISE_SAMPLES, size.size)
    near = size <= NEAR * 1.4826 * median_filter(size, around, mode="nearest")  # which on a grid is one of few numbers
    squares, share = (
        uniform_filter1d(one, around, mode="nearest") for one in (np.where(near, size**2, 0.0), near.astype(float))
    )
    local = np.sqrt(np.maximum(squares, 0.0) / np.maximum(share, 1.0 / around)) / WITHIN
    local = np.concatenate([local, local[-1:].repeat(3)])
    if source is not even:
        local = np.interp(even.time_s, time, local)
    least = min(_step_of(position) / np.sqrt(12.0), sample_noise(position, "motor_position_rad"))
    return np.maximum(local, least)


def _passed(kernel: Array, size: int) -> float:
    """Of a sample's white noise, what passes a filter and the mean over a block, rms."""
    return float(np.sqrt(np.sum(np.convolve(kernel, np.full(size, 1.0 / size)) ** 2)))
