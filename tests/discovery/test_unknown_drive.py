"""A drive whose controller nobody knows: what is hidden is named with its size, or told by its variable."""

from __future__ import annotations

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.discovery import Discovery, discover
from ema_model.discovery.words import not_fitted


def found_of(folder, hidden=None, seed: int = 0, leaves_out_reversals: bool = False) -> Discovery:
    """Two moves fitted, another held out, the whole library looked for."""
    fitted, held = (
        [logged(seed + i, hidden=hidden, name=f"move {i}", times=1.0 - 0.15 * i) for i in places]
        for places in ((0, 1), (2,))
    )
    return discover(fitted, drive_of(folder, leaves_out_reversals), holdout=held)


@pytest.mark.parametrize("seed", [0, 10, 20])
@pytest.mark.parametrize("steady", [False, True], ids=["whole", "steady parts"])
def test_where_nothing_is_missing_nothing_is_named(tmp_path, seed, steady):
    found = found_of(tmp_path, seed=seed, leaves_out_reversals=steady)
    assert found.verdict == "adequate" and not found.effects and not found.parameters_outside_tolerance
    low, high = found.calibration.parameters["motor.inertia_kgm2"].interval90
    assert low < 1.05e-4 < high < 1.02 * low
    assert not not_fitted(found)


@pytest.mark.parametrize(
    ("hidden", "name", "parameter", "value"),
    [
        (lambda angle, speed: 0.003 * np.sin(3.0 * angle), "cogging_torque", "amplitude_Nm", 0.003),
        (lambda angle, speed: 6e-5 * angle, "hinge_moment", "stiffness_Nm_rad", 6e-5),
        (
            lambda angle, speed: 0.004 * np.sign(speed) * np.exp(-np.abs(speed) / 12.0),
            "stribeck_friction",
            "speed_rad_s",
            12.0,
        ),
    ],
    ids=["cogging", "spring", "friction at low speed"],
)
def test_what_is_hidden_is_named(tmp_path, hidden, name, parameter, value):
    found = found_of(tmp_path, hidden)
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [name]
    size = found.effects[0].parameters[parameter].value
    print(found.ladder[0].rmse, found.ladder[-1].rmse, size)
    assert size == pytest.approx(value, rel=0.1 if name != "stribeck_friction" else 0.7)


def test_a_law_that_is_not_in_the_library_is_told_by_its_variable(tmp_path):
    found = found_of(tmp_path, lambda angle, speed: 8e-4 * np.sign(speed) * np.sqrt(np.abs(speed)))
    assert found.verdict in ("unknown_effect", "partly_explained") and not found.effects
    assert found.unknown is not None and found.unknown.variable == "motor_speed"


def test_a_model_at_its_floor_that_misses_what_was_not_fitted_says_so(tmp_path):
    """By too little for a verdict of its own, and by more than a true model would."""
    fitted = [logged(i, name=f"move {i}", times=1.0 - 0.15 * i) for i in range(2)]
    held = logged(2, hidden=lambda angle, speed: 0.0012 * np.sin(3.0 * angle), name="held out", times=0.7)
    found = discover(fitted, drive_of(tmp_path, False), holdout=[held])
    print(found)
    assert found.verdict == "adequate" and 1.1 < found.ladder[-1].holdout_rmse < 2.0
    [line] = not_fitted(found)
    assert f"off by {found.ladder[-1].holdout_rmse:.2f} times its floor" in line and line in str(found)
