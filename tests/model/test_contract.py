"""What every model beside recordings offers, closed loop and inverse dynamics alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.estimation.noise import DRAWS, floor, twin_error
from ema_model.faults import HEALTHY, vector
from ema_model.models import Model, model_for
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

THESIS = load_actuator()
BLIND = replace(THESIS, controller=replace(THESIS.controller, kind="unknown"))
RUNS = (Run(command("chirp"), 0.2), Run(command("step", {"final_rad": 0.005}), 0.2))


@pytest.fixture(scope="module", params=[THESIS, BLIND], ids=["closed loop", "inverse dynamics"])
def model(request) -> Model:
    recordings = [Sensors(0.1, 14).record(simulate_reference(run, THESIS), seed) for seed, run in enumerate(RUNS)]
    return model_for(recordings, request.param)


def test_windows_say_what_is_compared_and_signals_show_it(model):
    k = np.stack([HEALTHY, vector({"k1": 0.3})])
    for place, window in enumerate(model.windows):
        shown = model.signals(place, None, k)
        assert window.measured and set(window.measured) <= set(shown)
        assert all(values.shape == (2, window.blocks) for values in shown.values())
        assert all(values.shape == (window.blocks,) for values in (*window.measured.values(), window.time_s))
        assert model.measurements[window.recording].name == window.name
        # neighbours in time are a block apart, but for what was left out between them
        assert np.min(np.diff(window.time_s)) == pytest.approx(window.block_s)
        assert (window.command is not None) == model.simulates_commands


def test_a_population_is_single_runs(model):
    inertia = model.actuator.motor.inertia_kgm2 * np.linspace(0.9, 1.1, 19)
    k = np.tile(HEALTHY, (19, 1))
    k[:, 0] = np.linspace(0.0, 0.5, 19)
    together = model.signals(0, model.actuator.varied({"motor.inertia_kgm2": inertia}), k, np.linspace(0.0, 1e-3, 19))
    for i in (0, 7, 18):
        one = model.actuator.varied({"motor.inertia_kgm2": inertia[i]})
        alone = model.signals(0, one, k[i], float(np.linspace(0.0, 1e-3, 19)[i]))
        for name, values in alone.items():
            np.testing.assert_array_equal(values[0], together[name][i])


def test_a_floor_needs_nothing_else(model):
    for place, window in enumerate(model.windows):
        stated = {name: {"noise": 1.0, "accuracy": 2.0} for name in window.measured}
        found, more = floor(model, place), floor(model, place, stated=stated)
        assert set(found.noise) == set(found.model) == set(window.measured)
        for name, values in found.model.items():
            assert found.noise[name] > 0.0 and values.shape == (window.blocks,)
            np.testing.assert_allclose(more.model[name], np.hypot(values, 2.0))
        draws = twin_error(model, place)
        assert (draws != {}) == model.simulates_commands
        assert all(values.shape == (DRAWS, window.blocks) for values in draws.values())
        assert (model.a_sample_late(place) != {}) == (model.simulates_commands and place == 1), "only a step jumps"


def test_a_twin_is_seen_through_the_same_sensors():
    """What a calibrated bias, gain or delay does is no error of the model: its twin has them too."""
    model = model_for([simulate_reference(RUNS[0], THESIS)], THESIS)
    off = THESIS.varied({"sensors.current_bias_A": 0.5, "sensors.current_gain": 1.02})
    plain, sensed = (twin_error(model, 0, one)["current_A"] for one in (THESIS, off))
    np.testing.assert_allclose(sensed, 1.02 * plain, atol=1e-9)
