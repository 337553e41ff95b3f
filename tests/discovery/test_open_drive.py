"""A motor under a current that nobody controls: that current's noise adds up in its motion, and is no effect."""

from __future__ import annotations

import numpy as np
import pytest
from support.pushed import pushed
from support.representative import first_of
from support.unknown_drive import drive_of

from ema_model.comparison import compare
from ema_model.comparison.residuals import OPEN_LOOP
from ema_model.discovery import Discovery, discover
from ema_model.discovery.words import OPEN_LOOP_LEFT


def found_of(folder, hidden=None, noise_A: float = 0.05, seed: int = 0) -> Discovery:
    """Two pushes fitted, another held out, the whole library looked for."""
    fitted = [pushed(seed + i, noise_A, hidden, f"push {i}") for i in range(2)]
    held = [pushed(seed + 2, noise_A, hidden, "held out")]
    return discover(fitted, drive_of(folder, False, "open"), holdout=held)


@pytest.mark.parametrize("noise_A", first_of([0.1, 0.02]))
def test_where_nothing_is_missing_nothing_is_named(tmp_path, noise_A):
    found = found_of(tmp_path, None, noise_A)
    assert found.verdict == "adequate" and not found.effects and OPEN_LOOP_LEFT in found.warnings
    low, high = found.calibration.parameters["motor.inertia_kgm2"].interval90
    assert low < 1.05e-4 < high < 1.02 * low
    again = compare(found.data.measurements, found.actuator)
    assert again.adequate and again.over_floor == pytest.approx(found.ladder[-1].rmse, rel=0.02)


@pytest.mark.parametrize(
    ("hidden", "name", "parameter", "value"),
    [
        (lambda angle, speed: 0.003 * np.sin(3.0 * angle), "cogging_torque", "amplitude_Nm", 0.003),
        pytest.param(
            lambda angle, speed: 2e-4 * angle, "hinge_moment", "stiffness_Nm_rad", 2e-4, marks=pytest.mark.long
        ),
    ],
    ids=["cogging", "spring"],
)
def test_what_is_hidden_is_named(tmp_path, hidden, name, parameter, value):
    found = found_of(tmp_path, hidden)
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [name]
    assert found.effects[0].parameters[parameter].value == pytest.approx(value, rel=0.06)


def test_a_comparison_of_the_motion_says_what_its_floor_leaves_out(tmp_path):
    found = compare([pushed(0)], drive_of(tmp_path, False, "open"))
    assert OPEN_LOOP in found.warnings and set(found.signals) == {"motor_position_rad"}
