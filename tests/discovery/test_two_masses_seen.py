"""A second mass on the motor's, seen from its torque and its own encoder alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.flexible_drive import LOAD, MOTOR, flexible_drive
from support.unknown_drive import drive_of, logged

from ema_model.discovery import discover
from ema_model.discovery.transmission import two_masses_seen
from emaviz.cli import main

CASE = Path(__file__).parents[3] / "shared" / "cases" / "two_mass"


@pytest.mark.parametrize(("antiresonance_Hz", "damping"), [(14.0, 0.01), (22.0, 0.02), (30.0, 0.05)])
def test_an_antiresonance_and_a_resonance_are_two_masses(tmp_path, antiresonance_Hz, damping):
    seen = two_masses_seen([flexible_drive(3, antiresonance_Hz, damping=damping)], drive_of(tmp_path, False))
    assert seen is not None
    assert seen.antiresonance_Hz == pytest.approx(antiresonance_Hz, rel=0.03)
    assert seen.resonance_Hz == pytest.approx(antiresonance_Hz * np.sqrt(1.0 + LOAD / MOTOR), rel=0.03)
    assert seen.inertia_ratio == pytest.approx(LOAD / MOTOR, rel=0.15)
    assert seen.stiffness == pytest.approx(LOAD * (2.0 * np.pi * antiresonance_Hz) ** 2, rel=0.15)


@pytest.mark.parametrize("hidden", [None, lambda angle, speed: 0.003 * np.sin(3.0 * angle)], ids=["none", "cogging"])
def test_one_mass_is_none(tmp_path, hidden):
    drive = drive_of(tmp_path, False)
    assert two_masses_seen([flexible_drive(3, is_rigid=True)], drive) is None
    assert two_masses_seen([logged(i, hidden=hidden) for i in range(2)], drive) is None


@pytest.mark.long
def test_a_discovery_names_them_where_its_model_holds_one(tmp_path):
    found = discover([flexible_drive(3)], drive_of(tmp_path, False), most_effects=1)
    assert "an antiresonance at 22" in str(found) and "two masses joined by a spring" in str(found).splitlines()[0]
    told = found.to_dict()
    assert told["two_masses_seen"] is not None
    assert told["two_masses_seen"]["resonance_Hz"] == pytest.approx(22.0 * np.sqrt(3.0), rel=0.03)
    barred = {one["name"]: one for one in told["candidates"] if one["cannot_represent"]}
    assert {"torsional_compliance", "encoder_eccentricity", "position_sensor_delay"} <= barred.keys()
    assert not any(one["untestable_reason"] for one in barred.values())
    assert "this model cannot represent it: the controller is unknown" in str(found)


@pytest.mark.long
@pytest.mark.skipif(not CASE.is_dir(), reason="the logs of others are not here")
def test_a_log_of_another_simulator_shows_them(tmp_path):
    out = tmp_path / "found.json"
    log = [str(CASE / "tm_a.csv"), "--holdout", str(CASE / "tm_b.csv")]
    assert main(["discover", *log, "--actuator", str(CASE / "oneM.toml"), "--json", str(out)]) == 0
    seen = json.loads(out.read_text())["two_masses_seen"]
    assert seen["antiresonance_Hz"] == pytest.approx(31.8, rel=0.01)
    assert seen["resonance_Hz"] == pytest.approx(45.0, rel=0.01)
