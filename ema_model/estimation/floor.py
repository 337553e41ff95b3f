"""The floor of a comparison: what a perfect Monitor Model would still differ from a recording by.

Two parts, for each signal and block: the sensors' noise, estimated from the recording itself, and the model
floor, how far the Monitor Model is from its three-phase twin under the same command (MODEL §2).  The twin
differs most in transients, so its floor is local: the rms within 12.5 ms on either side.  Where the motor stands,
friction holds it at any place in a band, and the model's error there is one error, however long it stands.
When a command jumped is known to within a sample, which moves the transient that follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

from ema_model.actuator import Actuator
from ema_model.commands import Recorded
from ema_model.commands.recorded import jumps
from ema_model.models import ClosedLoop, Plant, Stretch, Window
from ema_model.recordings import Measurement
from ema_model.recordings.noise import least_noise, sample_noise
from ema_model.simulation.run import Run, simulate_reference

Array = NDArray[np.float64]

BAND_SIGMAS = 2.0  # σ on either side: 95 of 100 blocks of a perfect model lie within
CORRELATED_S = 0.025  # how long the model's error, and a sensor's inaccuracy, stay alike
_STILL = 8.0  # of a position's noise, within which it stands
_POSITIONS = ("motor_position_rad", "user_position_rad")
_SIGNALS = ("current_A", "motor_speed_rad_s", "motor_position_rad", "user_position_rad", "motor_torque_Nm")


@dataclass(frozen=True, eq=False)
class Floor:
    """Standard deviations per block of one window, by signal, in the signals' units."""

    noise: dict[str, float]  # white
    model: dict[str, Array]  # (blocks,)
    repeats: Array  # (blocks,), over how many blocks the model's error stays alike
    block_s: float

    def sigma(self, signal: str) -> Array:
        """Both together, (blocks,)."""
        return np.hypot(self.noise[signal], self.model[signal])

    def fit_sigma(self, signal: str) -> Array:
        """What to weight a fit by: the correlated part counts as often as it repeats, (blocks,)."""
        return np.hypot(self.noise[signal], np.sqrt(self.repeats) * self.model[signal])

    @property
    def counts(self) -> Array:
        """How much each block counts in a mean over time, (blocks,): 25 ms of motion as much as a whole standstill."""
        return np.min(self.repeats) / self.repeats

    def beside(self, other: Floor) -> Floor:
        """The greater model floor of two, block by block."""
        return replace(self, model={name: np.maximum(self.model[name], other.model[name]) for name in self.model})

    def rms(self, signal: str) -> float:
        """Both together over the whole window."""
        return float(np.sqrt(np.mean(self.sigma(signal) ** 2)))


def floor(
    plant: Plant,
    window: Window | Stretch,
    k: ArrayLike | None = None,
    stated: Mapping[str, Mapping[str, float]] | None = None,
) -> Floor:
    """The floor of one window of a plant.

    k: where the twins are run; without it, at the actuator's own.  stated: what is known of the sensors, by signal:
    "noise" (white, rms per sample) in place of the estimate, "accuracy" (slow, rms) besides it.
    """
    k = plant.actuator.k if k is None else k
    names = [name for name in _SIGNALS if name in window.measured]
    known = {name: (stated or {}).get(name, {}) for name in names}
    if isinstance(window, Stretch):
        noise = dict(window.noise)
        model = {name: np.zeros(window.blocks) for name in names}
    else:
        samples = plant.recorded[window.recording]
        noise = {
            name: max(known[name].get("noise", _of_runs(samples, name)), least_noise(name))
            / np.sqrt(window.samples_per_block)
            for name in names
        }
        assert isinstance(plant, ClosedLoop)
        model = _twins(plant, window, k, names)
        if np.any(jumps(window.command)):
            moved = _a_sample_late(plant, window, k)
            model = {name: np.hypot(model[name], moved[name] / np.sqrt(12.0)) for name in names}
    slow = {name: np.hypot(model[name], known[name].get("accuracy", 0.0)) for name in names}
    return Floor(noise, slow, repeats_of(window, noise), window.block_s)


def twin_error(plant: ClosedLoop, window: Window, actuator: Actuator, k: ArrayLike) -> dict[str, Array]:
    """Reference Model less Monitor Model under the window's command and mean load, by signal, (blocks,) each."""
    count = len(window.command)
    window = replace(window, load=np.full(count, window.load.mean()))
    times = np.arange(count) * window.step_s
    run = Run(
        Recorded(times, window.command),
        duration_s=count * window.step_s,
        sample_rate_Hz=1.0 / (window.steps_per_sample * window.step_s),
        load_torque_Nm=float(window.load[0]),
    )
    twin = simulate_reference(
        run,
        actuator,
        k,
        plant.effects,
        start_rad=window.user_rad,
        start_speed_rad_s=window.speed_rad_s,
        start_play_rad=window.play_rad,
        start_integral_Nm=float(window.integral_Nm(actuator, k)),
    )
    monitor = plant.signals(window, actuator, k)
    return {
        name: twin[name][1:].reshape(-1, window.samples_per_block).mean(axis=1) - monitor[name][0]
        for name in window.measured
    }


def _twins(plant: ClosedLoop, window: Window, k: ArrayLike, names: list[str]) -> dict[str, Array]:
    if not plant.actuator.has_reference_model:
        return {name: np.zeros(window.blocks) for name in names}
    width = max(3, round(CORRELATED_S / window.block_s) | 1)
    error = twin_error(plant, window, plant.actuator, k)
    return {name: np.sqrt(np.maximum(uniform_filter1d(error[name] ** 2, width, mode="nearest"), 0.0)) for name in names}


def _a_sample_late(plant: ClosedLoop, window: Window, k: ArrayLike) -> dict[str, Array]:
    """What the Monitor Model's signals change by if the command comes a sample later, (blocks,) each."""
    steps = window.steps_per_sample
    later = np.concatenate([np.full(steps, window.command[0]), window.command[:-steps]])
    now, then = (plant.signals(one, k=k) for one in (window, replace(window, command=later)))
    return {name: then[name][0] - now[name][0] for name in now}


def repeats_of(window: Window | Stretch, noise: Mapping[str, float]) -> Array:
    """Blocks over which the model's error stays alike: 25 ms, or as long as the motor stands, (blocks,)."""
    repeats = np.full(window.blocks, max(1.0, CORRELATED_S / window.block_s))
    name = next((name for name in _POSITIONS if name in window.measured), None)
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


def _of_runs(measurement: Measurement, name: str) -> float:
    """The noise of a signal over all its runs, of which the longest counts."""
    longest = max(measurement.runs, key=lambda run: run.stop - run.start)
    return sample_noise(measurement[name][longest], name)
