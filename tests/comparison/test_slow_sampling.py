"""Recordings whose time cannot be simulated: one line that says so, before anything is laid out in steps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.comparison import compare
from ema_model.discovery import discover
from ema_model.errors import InputError
from ema_model.identification.search import Objective
from ema_model.models.measured_motion import fit_stretches, on_even_grid
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

THESIS, SERVO = load_actuator(), load_actuator("assets/actuators/xl330.toml")
LOOSE = replace(THESIS, controller=replace(THESIS.controller, kind="unknown"))


def sampled_every(period_s: float, samples: int = 500) -> Measurement:
    angle: Any = 0.1 * np.sin(np.linspace(0.0, 20.0, samples))
    time: Any = period_s * np.arange(samples)
    names = ("command_rad", "user_position_rad", "motor_position_rad", "current_A")
    return Measurement({"time_s": time, **dict.fromkeys(names, angle)}, name="foreign")


@pytest.mark.parametrize(
    "period_s, actuator, says",
    [
        (1e6, THESIS, "sampling period of 1e+06 s is not between 1e-06 and 0.01 s"),
        (1e-9, THESIS, "sampling period of 1e-09 s is not between 1e-06 and 0.01 s"),
        (1e6, SERVO, "4e+11 steps of the model (0.0005 s), and at most 2e+07 are simulated"),
        (1e-9, SERVO, "are too short to compare"),
        (1e6, LOOSE, "far too long to differentiate the motion over 0.012 s"),
    ],
)
def test_a_time_in_another_unit_is_one_line(period_s, actuator, says):
    for start in (compare, discover):
        with pytest.raises(InputError) as error:
            start([sampled_every(period_s)], actuator)
        told = str(error.value)
        assert told.startswith("foreign: ") and says in told and "check the unit of time_s" in told and "\n" not in told


def test_an_identification_takes_recordings_whole_and_no_more_than_can_be_held():
    with pytest.raises(InputError, match=r"foreign: 30000 samples every 0\.01 s take it to 3e\+07 steps"):
        Objective([sampled_every(0.01, 30_000)], THESIS)


def test_a_gap_is_not_filled_with_samples():
    recording = sampled_every(1e-4)
    late = np.where(np.arange(500) < 250, recording.time_s, recording.time_s + 1e6)
    cut = on_even_grid(recording.with_signals(time_s=late))
    assert cut.samples == 500 and cut.runs == [slice(0, 250), slice(250, 500)]
    assert cut.duration_s == pytest.approx(0.0498)
    compared = compare([cut], THESIS, calibrate=False).recordings[0]
    assert np.all((compared.time_s < 0.025) | (compared.time_s > 1e6))


def test_many_gaps_are_told():
    recording = sampled_every(1e-4)
    late = recording.time_s + 100.0 * (np.arange(500) // 20)
    for actuator in (THESIS, SERVO, LOOSE):
        with pytest.raises(InputError, match=r"500 samples, 0\.0001 s apart at the median, last for 2400\.05 s"):
            compare([recording.with_signals(time_s=late)], actuator)


def test_runs_of_one_sample_each_are_told():
    with pytest.raises(InputError, match="no run has two samples"):
        compare([sampled_every(1e-4).with_signals(segment=np.arange(500.0))], THESIS)


@pytest.mark.parametrize("simulate", [simulate_reference, simulate_monitor])
def test_a_run_is_as_long_as_can_be_held(simulate):
    with pytest.raises(InputError, match=r"600 s at 16000 Hz are 6\.7e\+07 steps of the model"):
        simulate(Run(duration_s=600.0, sample_rate_Hz=16_000.0), THESIS)


def test_no_part_of_a_long_recording_reaches_over_a_gap():
    samples = 20_000
    recording = sampled_every(1e-3, samples)
    steps = np.where(np.arange(samples) % 5, 1e-3, 1.5e-3)  # so that the even grid has more samples
    steps[7_300] = 5.0
    time = np.cumsum(steps)
    recording = recording.with_signals(time_s=time)
    parts, runs = fit_stretches([recording], THESIS), on_even_grid(recording).runs
    assert parts is not None and parts[0] is not None and len(parts[0]) > 1 and len(runs) == 2
    for part in parts[0]:
        assert any(run.start <= part.start and part.stop <= run.stop for run in runs)
