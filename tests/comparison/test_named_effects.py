"""Effects that a comparison is asked for by name: fitted where no values stand beside them, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

import ema_model as em
from ema_model.actuator import save_actuator
from ema_model.recordings.read import write_measurement
from emaviz.cli import main

MOMENT, ANGLE = "effects.pendulum_load.moment_Nm", "effects.pendulum_load.angle_rad"


@pytest.fixture(scope="module")
def arm():
    """An arm of 0.02 N·m that hangs at 0.4 rad, through ± 2 rad."""
    return logged(3, hidden=lambda angle, speed: 0.02 * np.sin(angle - 0.4), reach=2.0 / 56.0, counts=26000.0)


def test_without_values_an_effect_is_fitted(tmp_path, arm):
    drive = drive_of(tmp_path, False)
    found = em.compare(arm, drive, effects={"pendulum_load": {}})
    told = found.calibration.parameters
    for path, true in ((MOMENT, 0.02), (ANGLE, 0.4)):
        low, high = told[path].interval90
        assert told[path].value == pytest.approx(true, rel=0.03) and low < true < high
    assert found.over_floor < 1.1


def test_with_values_it_stays(tmp_path, arm):
    drive = drive_of(tmp_path, False)
    found = em.compare(arm, drive, effects={"pendulum_load": {"moment_Nm": 0.015, "angle_rad": 0.4}})
    assert MOMENT not in found.calibration.parameters and found.over_floor > 1.5
    assert found.calibration.actuator.effects["pendulum_load"] == {"moment_Nm": 0.015, "angle_rad": 0.4}
    plain = em.compare(arm, drive, effects={"pendulum_load": {}}, calibrate=False)
    assert plain.actuator.effects["pendulum_load"]["moment_Nm"] == 0.5, "nothing is fitted: the library's own values"


@pytest.mark.parametrize(
    ("kind", "name", "offer"),
    [
        ("unknown", "torsional_compliance", "an open loop can (--open-loop), or a closed one"),
        ("unknown", "bus_voltage_sag", "a closed loop can"),
        ("open", "current_sensor_bias", "a closed loop can"),
    ],
)
def test_what_a_model_has_no_place_for_is_refused_with_what_could_hold_it(tmp_path, capsys, arm, kind, name, offer):
    drive = drive_of(tmp_path, False, kind)
    with pytest.raises(em.InputError, match="this model cannot represent it"):
        em.compare(arm, drive, effects={name: {}})
    save_actuator(drive, tmp_path / "drive.toml")
    write_measurement(arm, tmp_path / "arm.csv")
    line = ["compare", str(tmp_path / "arm.csv"), "--actuator", str(tmp_path / "drive.toml"), "--effect", name]
    assert main(line) == 2
    [said] = [text for text in capsys.readouterr().err.splitlines() if "effect" in text]
    assert f"effect {name}: this model cannot represent it" in said and offer in said


def test_an_open_loop_takes_what_it_is_offered_for(tmp_path, arm):
    drive = drive_of(tmp_path, False).in_open_loop()
    effects = {"torsional_compliance": {"stiffness_Nm_rad": 5.0, "damping_Nms_rad": 1e-3, "inertia_kgm2": 1e-5}}
    plain, bent = (em.compare(arm, drive, effects=given, calibrate=False) for given in (None, effects))
    assert plain.over_floor != bent.over_floor
