"""Discovery from end to end: a hidden effect is named, added, and the error falls to the floor."""

from __future__ import annotations

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.actuator import load_actuator, save_actuator
from ema_model.comparison import compare
from ema_model.discovery import discover, settings_of
from ema_model.errors import InputError

COMMANDS = [("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5), SINE]
UNSEEN = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)]
# A few that a test has time for; all others stand against them in the study.
NAMES = ("cogging_torque", "stribeck_friction", "hinge_moment", "load_dependent_friction")
CASES = {
    "cogging_torque": {"amplitude_Nm": 0.012, "phase_rad": 0.7},
    "stribeck_friction": {"speed_rad_s": 10.0},
    "hinge_moment": {"stiffness_Nm_rad": 1000.0},
    "load_dependent_friction": {"ratio": 0.15},
}


def found_in(effects, seed=31, names=NAMES):
    recordings = recorded(seed, commands=COMMANDS, effects=effects)
    unseen = recorded(seed, commands=UNSEEN, effects=effects)
    return discover(recordings, ACTUATOR, holdout=unseen, candidates=names)


@pytest.fixture(scope="module")
def cogged():
    return found_in({"cogging_torque": CASES["cogging_torque"]})


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in CASES if name != "cogging_torque"])
def test_hidden_effect_is_found_and_the_error_falls_to_the_floor(name):
    found = found_in({name: CASES[name]})
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [name]
    first, truth = next(iter(CASES[name].items()))
    assert found.effects[0].parameters[first].value == pytest.approx(truth, rel=0.35)
    assert found.ladder[-1].rmse < 1.1 and found.ladder[-1].holdout_rmse < 1.1
    assert found.ladder[-1].rmse < found.ladder[0].rmse


@pytest.mark.long
def test_cogging_with_its_order_and_phase(cogged):
    assert [one.name for one in cogged.effects] == ["cogging_torque"]
    settings = settings_of(cogged)["cogging_torque"]
    assert settings["order"] == 12.0
    assert settings["amplitude_Nm"] == pytest.approx(0.012, rel=0.25)
    assert settings["phase_rad"] == pytest.approx(0.7, abs=0.25)


@pytest.mark.long
def test_score_predicts_what_the_refit_gives(cogged):
    best = cogged.candidates[0]
    assert best.name == "cogging_torque" and best.refitted_drop is not None
    assert best.predicted_drop == pytest.approx(best.refitted_drop, rel=0.2)


def test_nothing_hidden_is_adequate():
    found = found_in(None)
    assert found.verdict == "adequate" and not found.effects and len(found.ladder) == 1


@pytest.mark.long
def test_two_effects_one_after_the_other():
    found = found_in({name: CASES[name] for name in ("cogging_torque", "load_dependent_friction")})
    assert {one.name for one in found.effects} == {"cogging_torque", "load_dependent_friction"}
    rungs = [rung.rmse for rung in found.ladder]
    assert rungs == sorted(rungs, reverse=True) and found.ladder[-1].holdout_rmse < 1.1


@pytest.mark.long
def test_what_is_not_among_the_candidates_is_unknown():
    found = found_in({"hinge_moment": CASES["hinge_moment"]}, names=("stribeck_friction",))
    assert found.verdict == "unknown_effect" and found.unknown is not None
    assert found.unknown.variable == "user_position" and len(found.unknown.curve) > 5


@pytest.mark.long
def test_improved_model_is_saved_loaded_and_adequate(cogged, tmp_path):
    path = tmp_path / "better.toml"
    save_actuator(cogged.actuator, path)
    better = load_actuator(path)
    assert better.effects == {
        name: {parameter: pytest.approx(value) for parameter, value in given.items()}
        for name, given in cogged.actuator.effects.items()
    }
    again = compare(recorded(31, commands=[SINE], effects={"cogging_torque": CASES["cogging_torque"]}), better)
    assert again.adequate


def test_mixed_maps_and_runs_are_refused():
    [run] = recorded(1)
    from dataclasses import replace

    from ema_model.recordings import SideFile

    with pytest.raises(InputError, match="static maps and runs"):
        discover([run, replace(run, side=SideFile(kind="map"))], ACTUATOR)
    assert np.isfinite(run["current_A"]).all()


@pytest.mark.long
def test_parameter_outside_its_tolerance_is_no_missing_physics():
    extra = {"motor.viscous_friction_Nms_rad": 1.5e-4}
    recordings, unseen = (recorded(31, commands=commands, extra=extra) for commands in (COMMANDS, UNSEEN))
    found = discover(recordings, ACTUATOR, holdout=unseen, candidates=(*NAMES, "viscous_friction"))
    assert found.verdict == "adequate" and not found.effects
    assert "motor.viscous_friction_Nms_rad" in found.parameters_outside_tolerance
    assert found.ladder[-1].rmse < 1.1 < found.ladder[0].rmse
