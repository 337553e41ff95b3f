"""The load over time: its shapes, both models under them, and a population that is several single runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.faults import vector
from ema_model.simulation.run import SHAPES, LoadProfile, Run, simulate_monitor, simulate_monitors, simulate_reference

TIME = np.linspace(0.0, 0.4, 4001)


def test_a_shape_is_what_its_name_says():
    assert np.all(LoadProfile().at(TIME) == 1.0)
    step = LoadProfile("step", time_s=0.1).at(TIME)
    assert np.all(step[TIME < 0.0999] == 0.0) and np.all(step[TIME >= 0.1] == 1.0)
    sine = LoadProfile("sine", frequency_Hz=5.0).at(TIME)
    assert np.allclose(sine, np.sin(2.0 * np.pi * 5.0 * TIME))
    rising = LoadProfile("chirp", time_s=0.2, frequency_Hz=40.0).at(TIME)
    crossings = TIME[1:][np.diff(np.sign(rising)) != 0]
    late = np.diff(crossings[crossings > 0.2])
    assert np.allclose(late, 1.0 / 80.0, atol=3e-4), "it stays at its last frequency"
    assert np.diff(crossings[:4])[0] > 1.5 * late[0]


@pytest.mark.parametrize("bad", [{"shape": "square"}, {"time_s": 0.0}, {"frequency_Hz": -1.0}, {"time_s": np.nan}])
def test_what_is_no_load_is_refused(bad):
    with pytest.raises(InputError):
        LoadProfile(**bad)


@pytest.mark.parametrize("shape", SHAPES)
def test_both_models_carry_it_and_say_it(shape):
    run = Run(command("chirp", {}), 0.3, 5000.0, 100.0, LoadProfile(shape, 0.1, 10.0))
    for simulate in (simulate_reference, simulate_monitor):
        found, free = simulate(run, load_actuator()), simulate(replace(run, load_torque_Nm=0.0), load_actuator())
        assert np.allclose(found["load_torque_Nm"], run.load_at(found.time_s)) and "load_torque_Nm" not in free
        carried = np.abs(found["current_A"] - free["current_A"])
        assert carried.max() > 1.0
        if shape == "step":
            assert np.all(carried[found.time_s < 0.0999] == 0.0)


def test_a_population_is_its_single_runs():
    run, actuator = Run(command("chirp", {}), 0.1), load_actuator()
    severities = [vector({"k2": x}) for x in np.linspace(0.0, 1.0, 40)]  # more than one block of lanes
    together = simulate_monitors(run, actuator, severities)
    assert len(together) == 40
    for at in (0, 7, 39):
        alone = simulate_monitor(run, actuator, severities[at])
        assert all(np.array_equal(together[at][name], alone[name]) for name in alone.signals)
