"""The three-phase model's run as other loggers would have it: slow, at uneven times, filtered, with samples lost."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import lfilter

from ema_model.actuator import load_actuator
from ema_model.commands import Command, Recorded, command
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_reference
from ema_model.simulation.sensors import Sensors

_STEP_S = 1e-5  # at which the run is known
DURATION_S = 0.5


@dataclass(frozen=True)
class Logger:
    """How a log is taken of a run; each sample is what a sensor showed at that moment."""

    rate_Hz: float
    jitter: float = 0.0  # of a period, from the earliest to the latest
    filter_s: float = 0.0  # of the first order, of all that is measured
    lost: float = 0.0  # of the samples

    def log(self, run: Measurement, seed: int) -> Measurement:
        """Of a run that is known every 10 µs."""
        random = np.random.default_rng(seed)
        period = 1.0 / self.rate_Hz
        times = np.arange(0.0, DURATION_S - 0.5 * period, period)
        times[1:] += self.jitter * period * random.uniform(-0.5, 0.5, times.size - 1)
        kept = random.uniform(size=times.size) >= self.lost
        kept[0] = True
        at = np.round(times[kept] / _STEP_S).astype(int)
        signals = {"time_s": at * _STEP_S}
        for name in ("command_rad", "user_position_rad", "motor_position_rad", "current_A"):
            values = run[name]
            if self.filter_s and name != "command_rad":
                left = np.exp(-_STEP_S / self.filter_s)
                values = lfilter([1.0 - left], [1.0, -left], values, zi=[left * values[0]])[0]
            signals[name] = values[at]
        sensors = Sensors(current_noise_A=0.05, encoder_bits=16)
        return sensors.record(Measurement(signals, name=f"log {seed}"), seed)


def triangle(amplitude_rad: float = 0.03, frequency_Hz: float = 3.0) -> Command:
    """Straight strokes, whose corners fall between samples."""
    time = np.arange(0.0, DURATION_S + 1e-9, _STEP_S)
    return Recorded(time, amplitude_rad * 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * frequency_Hz * time)))


COMMANDS = {
    "chirp": lambda: command("chirp"),
    "multisine": lambda: command("multisine"),
    "sine": lambda: command("sine"),
    "triangle": triangle,
}


@cache
def healthy(name: str) -> Measurement:
    """The actuator of the file, with nothing hidden in it, under one of `COMMANDS`."""
    return simulate_reference(Run(COMMANDS[name](), DURATION_S, sample_rate_Hz=1.0 / _STEP_S), load_actuator())
