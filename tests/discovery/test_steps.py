"""The steps of a discovery, one by one: scores, further orders, repeatability, the next experiment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.commands import command
from ema_model.comparison.compare import weights_of
from ema_model.discovery import discover
from ema_model.discovery.fingerprints import fingerprints
from ema_model.discovery.loop import is_lost, with_divergence
from ema_model.discovery.next_experiment import allowed, next_experiment
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Candidate
from ema_model.discovery.terms import noise_of, scored_terms, terms_of
from ema_model.estimation.model_fit import Fit, fit, gather, with_effect
from ema_model.estimation.noise import floor
from ema_model.models import model_for
from ema_model.recordings import prepared
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

COMMANDS = [("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5)]
ORDERS = {
    "cogging_torque": {"amplitude_Nm": 0.024, "order": 7.0, "phase_rad": 0.4},
    "cogging_torque_2": {"amplitude_Nm": 0.018, "order": 28.0, "phase_rad": -1.0},
}


def data_of(recordings, actuator=ACTUATOR):
    return gather([prepared(one, actuator) for one in recordings], actuator, weights_of(None, actuator), None)


@pytest.fixture(scope="module")
def toothed():
    data = data_of(recorded(41, effects=ORDERS))
    return data, fit(data, ACTUATOR)


@pytest.mark.long
def test_an_effect_may_be_there_twice(toothed):
    found = discover(
        recorded(41, effects=ORDERS),
        ACTUATOR,
        holdout=recorded(41, commands=[("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)], effects=ORDERS),
        candidates=("cogging_torque", "hinge_moment"),
    )
    assert {one.name for one in found.effects} == {"cogging_torque"}
    assert {one.chosen["order"]: one.key for one in found.effects} == {7.0: "cogging_torque", 28.0: "cogging_torque_2"}
    assert found.ladder[-1].rmse < 1.1 and found.ladder[-1].holdout_rmse < 1.1


def scored(data, base, names, orders):
    noise = noise_of(data, base)
    terms = terms_of(data, base, fingerprints(data, base, names, orders), noise, orders)
    return {one.term.name: one for one in scored_terms(base, terms, noise)}


def test_an_order_is_told_apart_from_its_neighbours(toothed):
    data, base = toothed
    found = scored(data, base, ["cogging_torque"], [float(order) for order in range(5, 31)])["cogging_torque"]
    assert found.candidate.settings["order"] == 7.0
    assert found.candidate.settings["phase_rad"] == pytest.approx(0.4, abs=0.25)
    left = base.residual + found.change
    assert left @ left < base.residual @ base.residual - 0.9 * found.candidate.predicted_drop


def test_score_is_not_misled_by_the_amplitude_of_another_actuator(toothed):
    """A hinge moment of hundreds of N·m at a small axis: the fingerprint is taken at a strength that fits."""
    data, base = toothed
    prints = fingerprints(data, base, ["position_sensor_bias"], [])
    quiet = 1e-3 * base.residual
    strong = replace(base, calibration=replace(base.calibration, residual=quiet))
    assert max(np.sqrt(np.mean(one.columns**2)) for one in fingerprints(data, strong, ["hinge_moment"], [])) < 40.0
    assert len(prints) == 3


def test_what_a_parameter_explains_is_no_effect(toothed):
    data, base = toothed
    found = scored(data, base, ["inertia_error", "cogging_torque"], [7.0])
    assert found["cogging_torque"].gain > found["inertia_error"].gain + 100.0


def test_standstill_counts_once():
    data = data_of(recorded(42, commands=COMMANDS))
    chirp, step = data.floors
    assert np.all(chirp.repeats == chirp.repeats[0]) and np.all(chirp.counts == 1.0)
    standing = step.repeats > step.repeats.min()
    assert 0.5 < standing.mean() < 0.95  # a 5 mrad step is done within a tenth of a second
    assert step.counts[standing].sum() == pytest.approx(step.repeats.min(), rel=1e-6)


def test_floor_is_the_greater_of_two():
    data = data_of(recorded(42, commands=COMMANDS))
    plant = model_for(data.measurements, ACTUATOR.varied({"motor.dynamic_friction_Nm": 0.07}))
    other = floor(plant, 1)
    joined = data.floors[1].beside(other)
    for name, values in joined.model.items():
        assert np.all(values >= data.floors[1].model[name]) and np.all(values >= other.model[name])


@pytest.mark.long
def test_a_loop_that_chatters_in_its_play_is_not_repeatable():
    """What the motion needed is compared then, and the effect is still found."""
    chattering = ACTUATOR.with_values({"transmission.backlash_rad": 1e-3, "controller.position_gain_1_s": 5e6})
    run = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 3}), 1.0)
    hidden = {"hinge_moment": {"stiffness_Nm_rad": 2000.0}}
    recording = Sensors(0.1, 16).record(simulate_reference(run, chattering, effects=hidden), 43)
    smooth = data_of(recorded(43, commands=COMMANDS))
    assert not is_lost(with_divergence(smooth, fit(smooth, ACTUATOR))[1])
    found = discover([recording], chattering, candidates=("hinge_moment",))
    assert any("not repeatable" in warning for warning in found.warnings)
    assert found.actuator.controller.kind == "unknown"
    assert [one.name for one in found.effects] == ["hinge_moment"]


def test_a_loop_that_is_not_repeatable_and_has_no_current_is_said_to_be():
    chattering = ACTUATOR.with_values({"transmission.backlash_rad": 1e-3, "controller.position_gain_1_s": 5e6})
    run = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 3}), 0.5)
    whole = simulate_reference(run, chattering)
    bare = replace(whole, signals={name: whole[name] for name in ("time_s", "command_rad", "user_position_rad")})
    found = discover([bare], chattering, candidates=("hinge_moment",))
    assert found.verdict == "not_repeatable" and not found.effects


def rival(name: str, found: Fit) -> Trial:
    return Trial(Candidate(name, {}, 0.0), {}, found, 0.0)


@pytest.mark.long
def test_next_experiment_tells_rivals_apart():
    """In a slow sine a hinge moment and a heavier rotor look alike; a faster or wider one tells them apart."""
    hinge = {"hinge_moment": {"stiffness_Nm_rad": 500.0}}
    data = data_of(recorded(44, commands=[SINE], effects=hinge))
    hinged, heavier = (
        rival(name, fit(data, with_effect(ACTUATOR, name, settings)))
        for name, settings in (*hinge.items(), ("inertia_error", {"ratio": -0.2}))
    )
    found = next_experiment(data, hinged, heavier)
    assert found is not None and found.separates == ("hinge_moment", "inertia_error")
    assert found.expected_chi2 > 25.0 and found.add_signal is None
    assert 0.0 < found.duration_s <= 3.0


@pytest.mark.long
def test_a_test_is_sought_beside_an_effect_of_the_file_too():
    """One rival frees the file's hinge, the other adds an inertia beside it: both hold a hinge."""
    hinged = replace(ACTUATOR, effects={"hinge_moment": {"stiffness_Nm_rad": 500.0}})
    data = data_of(recorded(44, commands=[SINE], effects={"hinge_moment": {"stiffness_Nm_rad": 700.0}}))
    freed = rival("hinge_moment", fit(data, hinged))
    heavier = rival("inertia_error", fit(data, with_effect(hinged, "inertia_error", {"ratio": -0.2})))
    found = next_experiment(data, freed, heavier)
    assert found is None or found.separates == ("hinge_moment", "inertia_error")


def test_allowed_commands_stay_within_what_was_recorded():
    data = data_of(recorded(44, commands=[SINE]))
    base = fit(data, ACTUATOR)
    turns = 4.0 * np.pi * ACTUATOR.transmission.gear_ratio
    for _, settings, seconds in allowed(data, base):
        reach = max(settings.get("amplitude_rad", 0.0), settings.get("final_rad", 0.0))
        assert reach <= max(0.0301, 1.01 * turns)
        assert 0.3 <= seconds <= 3.0


def test_floor_of_a_varying_load_is_the_models_own():
    """Both twins bear the same load: the floor of a load that comes and goes is no larger than that of its mean."""
    [steady] = recorded(45, commands=[SINE], load=10.0)
    wave = 10.0 + 10.0 * np.sin(2.0 * np.pi * 7.0 * steady["time_s"])
    varying = steady.with_signals(load_torque_Nm=wave)
    sigmas = [data_of([one]).floors[0].sigma("current_A") for one in (steady, varying)]
    assert np.mean(sigmas[1] ** 2) == pytest.approx(np.mean(sigmas[0] ** 2), rel=0.1)
