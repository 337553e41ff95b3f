"""A recording's motion for inverse dynamics: filtered, with the blocks in which friction's law is known.

It is held to what differentiation can tell.  What the position is off by (quantisation, jitter of its time stamps) acts
on the current through the inertia; after the filter it lasts as long as the filter does, and stands in the floor as
such: a regression that took it for white would be too sure of all that it finds (Janot, Vandanjon and Gautier, IEEE
Trans. Control Syst. Technol. 22 (2014), on noise in the regressors).
About a reversal, friction is no step of the measured speed's sign, and until a stroke is on its way bristles may bend
where the motor seems to slide.  Where the actuator asks for it, as a second opinion does, blocks within the filter's
reach of either are left out, as usual in the identification of robots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, median_filter, uniform_filter1d

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.models.loop_window import CONTEXT
from ema_model.models.model import Window
from ema_model.models.motion import Motion, motion_of
from ema_model.models.sampling import check_period
from ema_model.recordings import Measurement
from ema_model.recordings.noise import NEAR, WITHIN, sample_noise

Array = NDArray[np.float64]

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
    runs = [slice(0, measurement.samples)] if measurement.is_map else parts or measurement.runs
    for run in runs:
        position = measurement["motor_position_rad"][run]
        blocks = position.size // size
        if blocks < 10:
            continue
        motion = _standing(position) if measurement.is_map else motion_of(position, period, actuator.filter_s)
        speed, still, moving = motion.speed, 1e-9, np.arange(blocks)
        if not measurement.is_map:
            steady = actuator.leaves_out_reversals
            own = motion_of(position, period, actuator.filter_s / _SHORT) if steady else motion
            speed, still = own.speed, max(1e-9, _STILL_STEPS * _step_of(position) / (own.kernel.size * period))
            moving = _moving(speed, still, motion.kernel.size, size, steady)
        if moving.size < 10:
            continue
        load = measurement.get("load_torque_Nm")

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
                sensor_noise={target: sample_noise(raw, target) * passed},
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


def _standing(position: Array) -> Motion:
    zero = np.zeros_like(position)
    return Motion(position, zero, zero, np.ones(1))


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
