"""The floor of a comparison: what a perfect Monitor Model would still differ from a recording by.

Two parts, for each signal and block: the sensors' noise, estimated from the recording itself, and the model
floor, how far the Monitor Model is from its three-phase twin under the same command (MODEL §2).  The twin
differs most in transients, so its floor is local: the rms within 12.5 ms on either side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d

from ema_model.commands import Recorded
from ema_model.faults import HEALTHY
from ema_model.identification.objective import COMPARED, Objective, Window
from ema_model.measurement import Measurement
from ema_model.simulation import Run, simulate_reference

Array = NDArray[np.float64]

_AROUND_S = 0.0125


@dataclass(frozen=True)
class Floor:
    """Standard deviations per block of one recording, by signal, in the signals' units."""

    noise: dict[str, float]
    model: dict[str, Array]  # (blocks,)

    def sigma(self, signal: str) -> Array:
        """Both together, (blocks,)."""
        return np.hypot(self.noise[signal], self.model[signal])

    def rms(self, signal: str) -> float:
        """Both together over the whole recording."""
        return float(np.sqrt(np.mean(self.sigma(signal) ** 2)))


def floor(objective: Objective, window: Window, measurement: Measurement, k: ArrayLike = HEALTHY) -> Floor:
    """The floor of one recording of the objective; k: where the twins are run (normally healthy)."""
    count = len(window.command)
    times = np.arange(count) * window.step_s
    run = Run(
        Recorded(times, window.command),
        duration_s=count * window.step_s,
        sample_rate_Hz=1.0 / (window.steps_per_sample * window.step_s),
        load_torque_Nm=float(window.load.mean()),
    )
    twin = simulate_reference(run, objective.actuator, k, objective.effects, start_rad=window.user_rad)
    monitor = objective.signals(window, k)
    model, noise = {}, {}
    width = max(3, 2 * round(_AROUND_S / window.block_s) + 1)
    for name in COMPARED:
        if name not in window.measured:
            continue
        means = twin[name][1:].reshape(-1, window.samples_per_block).mean(axis=1)
        difference = means - monitor[name][0]
        model[name] = np.sqrt(uniform_filter1d(difference**2, width, mode="nearest"))
        noise[name] = sample_noise(measurement[name]) / np.sqrt(window.samples_per_block)
    return Floor(noise, model)


def sample_noise(values: Array) -> float:
    """White noise and quantisation of a signal, rms, from its third differences (which a smooth motion lacks).

    The median of their size is blind to steps and reversals; a signal that hardly ever changes gives the
    step of its quantisation, s/√12.
    """
    third = np.diff(values, 3)
    robust = 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0)  # 1 + 9 + 9 + 1
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * (1.0 + np.max(np.abs(values)))]
    repeated = len(steps) < 0.9 * (len(values) - 1)  # held values are the mark of quantisation
    quantum = float(np.min(steps)) / np.sqrt(12.0) if repeated and len(steps) else 0.0
    return max(robust, quantum, 1e-12)
