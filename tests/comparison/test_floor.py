"""What a perfect model would still leave: a jump is known to within a sample, a standstill is one error."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.estimation.floor import floor
from ema_model.models import ClosedLoop
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()


def floor_of(name: str, given: dict, rate_Hz: float):
    run = Run(command(name, given), duration_s=0.2, sample_rate_Hz=rate_Hz)
    plant = ClosedLoop([simulate_reference(run, ACTUATOR)], ACTUATOR)
    return plant.windows[0], floor(plant, 0)


def test_a_coarser_sampling_of_a_jump_raises_the_floor_of_its_transient():
    window, coarse = floor_of("step", {"final_rad": 0.005}, 10_000.0)
    _, fine = floor_of("step", {"final_rad": 0.005}, 100_000.0)
    jump = int(np.argmax(np.abs(window.measured["current_A"]) > 1.0))
    at = slice(jump, jump + 2)
    assert np.max(coarse.model["current_A"][at]) > 2.0 * np.max(fine.model["current_A"][at])


@pytest.mark.parametrize("rate_Hz", [10_000.0, 20_000.0])
def test_a_smooth_command_has_no_such_share(rate_Hz):
    _, smooth = floor_of("sine", {"amplitude_rad": 0.005, "frequency_Hz": 3.0}, rate_Hz)
    assert np.max(smooth.model["current_A"]) < 1.0


def test_a_standstill_counts_once():
    window, found = floor_of("step", {"final_rad": 0.002}, 10_000.0)
    stands = np.ptp(window.measured["motor_position_rad"][-100:]) == 0.0
    assert stands and found.repeats[-1] >= 100
    assert found.counts[-1] < 0.5 * np.max(found.counts)
