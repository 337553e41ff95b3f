"""A motor at a duty of which its speed alone is logged: what is missing is named of it, too."""

from __future__ import annotations

import pytest
from support.duty_bench import Bench, logged

import ema_model as em
from ema_model.discovery import Discovery, discover
from ema_model.recordings import Measurement

FILE = """
[controller]
kind = "open"

[motor]
torque_constant_Nm_A = { value = 0.0105, tolerance = 0.03 }
inertia_kgm2 = { value = 1.7e-6, tolerance = 0.1 }
viscous_friction_Nms_rad = { value = 1.4e-6, tolerance = 0.2 }
dynamic_friction_Nm = { value = 0.00105, tolerance = 0.1 }
static_friction_Nm = 0.0
resistance_Ohm = { value = 4.9, tolerance = 0.05 }

[inverter]
kind = "voltage"
bus_voltage_V = 12.0
"""
CANDIDATES = ("constant_load", "dry_friction", "stribeck_friction", "quadratic_drag", "cogging_torque")


def found_of(folder, bench: Bench) -> Discovery:
    """Two runs fitted, a third held out."""
    (folder / "motor.toml").write_text(FILE, encoding="utf-8")
    actuator = em.load_actuator(folder / "motor.toml")
    runs = [Measurement(logged(bench, seed, rate_Hz=500.0, duration_s=0.9), name=f"run {seed}") for seed in (1, 2, 3)]
    return discover(runs[:2], actuator, holdout=runs[2:], candidates=CANDIDATES)


def test_nothing_is_named_where_nothing_is_missing(tmp_path):
    found = found_of(tmp_path, Bench())
    assert found.verdict == "adequate" and not found.effects


@pytest.mark.parametrize(
    ("hidden", "name", "value"),
    [
        pytest.param({"load_Nm": 8e-4}, "constant_load", 8e-4, marks=pytest.mark.long),
        ({"dry_Nm": 2.6e-3}, "dry_friction", 2.6e-3 - 1.05e-3),
    ],
)
def test_what_is_missing_is_named_with_its_size(tmp_path, hidden, name, value):
    found = found_of(tmp_path, Bench(**hidden))
    assert [one.name for one in [*found.effects, *found.freed]] == [name]
    assert all(one.stands_for == "motor.dynamic_friction_Nm" for one in found.freed)
    assert found.ladder[-1].holdout_rmse < 1.1 < found.ladder[0].holdout_rmse
    (told,) = [*found.effects, *found.freed]
    file = 0.0 if name == "constant_load" else found.calibration.parameters["motor.dynamic_friction_Nm"].value - 1.05e-3
    assert told.parameters["torque_Nm"].value + file == pytest.approx(value, rel=0.05)
