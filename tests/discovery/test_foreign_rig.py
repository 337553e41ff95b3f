"""Recordings of rigs that nobody here wrote, with nothing hidden: the study is in test_foreign_rigs_study.py."""

from __future__ import annotations

import pytest
from support.foreign_rigs import actuator_of, measured, recorded

from ema_model.actuator import load_actuator, save_actuator
from ema_model.comparison import compare
from ema_model.comparison.thresholds import BAND
from ema_model.discovery import discover


@pytest.mark.long
@pytest.mark.parametrize("rig", ["hobby", "gearservo"])
def test_a_healthy_rig_is_adequate_or_unknown_and_nothing_is_named(rig, tmp_path):
    recorded(rig, 2, tmp_path, programmes=["chirp"])
    actuator = actuator_of(rig)
    found = discover(
        measured(tmp_path, actuator, ["chirp"]), actuator, candidates=("asymmetric_friction", "torsional_compliance")
    )
    assert found.verdict in ("adequate", "unknown_effect") and not found.effects
    assert found.ladder[-1].rmse <= BAND or found.verdict == "unknown_effect"
    assert not any(one.at_bound for one in found.calibration.parameters.values())


@pytest.mark.long
def test_what_a_coarse_position_sensor_holds_is_no_missing_physics(tmp_path):
    """Twelve bits of a turn: between moves the reading stays the same for hundreds of samples."""
    recorded("hobby", 19, tmp_path, programmes=["random"])
    actuator = actuator_of("hobby")
    assert compare(measured(tmp_path, actuator, ["random"]), actuator).adequate


@pytest.mark.long
def test_a_model_that_went_on_without_its_controller_compares_as_it_was_discovered(tmp_path):
    recorded("gearservo", 3, tmp_path, programmes=["chirp"])
    actuator = actuator_of("gearservo")
    logged = measured(tmp_path, actuator, ["chirp"])
    found = discover(logged, actuator, candidates=("asymmetric_friction", "torsional_compliance"))
    assert found.actuator.controller.kind == "unknown"
    save_actuator(found.actuator, tmp_path / "found.toml")
    again = compare(logged, load_actuator(tmp_path / "found.toml"), calibrate=False)
    assert again.over_floor == pytest.approx(found.ladder[-1].rmse, rel=0.02)
    assert again.floor_band == pytest.approx(found.floor_band, abs=0.01)


@pytest.mark.long
@pytest.mark.parametrize("rate", ["1000", "2000"])
def test_a_servo_that_is_logged_faster_is_as_near_to_its_floor(rate, tmp_path):
    """Long enough to be fitted on parts, that begin in mid-motion, of which no motor's signal tells the speed."""
    recorded("hobby", 51, tmp_path, programmes=["chirp", "random"], options=["--rate", rate])
    actuator = actuator_of("hobby")
    assert compare(measured(tmp_path, actuator, ["chirp", "random"]), actuator).over_floor <= 1.1
