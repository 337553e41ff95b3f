"""A drive whose controller nobody knows: what is hidden is named with its size, or told by its variable."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.representative import first_of
from support.unknown_drive import drive_of, logged

import ema_model as em
from ema_model.discovery import Discovery, discover
from ema_model.discovery.words import not_fitted

JOINT = Path(__file__).parents[3] / "shared" / "cases" / "friction_ur10e_j1"


def found_of(folder, hidden=None, seed: int = 0, leaves_out_reversals: bool = False) -> Discovery:
    """Two moves fitted, another held out, the whole library looked for."""
    fitted, held = (
        [logged(seed + i, hidden=hidden, name=f"move {i}", times=1.0 - 0.15 * i) for i in places]
        for places in ((0, 1), (2,))
    )
    return discover(fitted, drive_of(folder, leaves_out_reversals), holdout=held)


@pytest.mark.parametrize("seed", first_of([0, 10, 20]))
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
        (
            lambda angle, speed: 0.005 * np.sign(speed) * np.exp(-np.abs(speed) / 12.0),
            "stribeck_friction",
            "speed_rad_s",
            12.0,
        ),
        pytest.param(
            lambda angle, speed: 0.003 * np.sin(3.0 * angle),
            "cogging_torque",
            "amplitude_Nm",
            0.003,
            marks=pytest.mark.long,
        ),
        pytest.param(
            lambda angle, speed: 6e-5 * angle, "hinge_moment", "stiffness_Nm_rad", 6e-5, marks=pytest.mark.long
        ),
    ],
    ids=["friction at low speed", "cogging", "spring"],
)
def test_what_is_hidden_is_named(tmp_path, hidden, name, parameter, value):
    found = found_of(tmp_path, hidden)
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [name]
    size = found.effects[0].parameters[parameter].value
    print(found.ladder[0].rmse, found.ladder[-1].rmse, size)
    assert size == pytest.approx(value, rel=0.1 if name != "stribeck_friction" else 0.7)


@pytest.mark.long
@pytest.mark.parametrize(
    ("law", "ratio", "half"),
    [
        (lambda speed: 8e-4 * np.sqrt(np.abs(speed)), None, None),
        (lambda speed: 0.01 * np.abs(speed) / (np.abs(speed) + 60.0), 1.0 / 1.1, 60.0),
    ],
    ids=["root of speed", "shear-thinning grease"],
)
def test_friction_that_grows_less_than_linearly_is_named(tmp_path, law, ratio, half):
    """Beside viscous friction, Stribeck's and a zone; ratio, half: what is hidden, of a dry friction of 0.011 N·m."""
    found = found_of(tmp_path, lambda angle, speed: np.sign(speed) * law(speed))
    assert [one.name for one in found.effects] == ["saturating_friction"] and found.verdict == "effects_found"
    assert found.ladder[-1].rmse < 1.1 < found.ladder[0].rmse
    told = found.effects[0].parameters
    for name, true in (("ratio", ratio), ("half_speed_rad_s", half)):
        low, high = told[name].interval90
        assert true is None or low < true < high


@pytest.mark.long
@pytest.mark.parametrize(
    ("hidden", "names"),
    [
        (
            lambda angle, speed: 0.012 * np.sign(speed) * np.abs(speed) / (np.abs(speed) + 40.0),
            {"saturating_friction"},
        ),
        (
            lambda angle, speed: 0.006 * np.sign(speed) * np.clip(1.0 - (angle / 20.0) ** 2, 0.0, 1.0),
            {"quadratic_drag", "friction_zone"},
        ),
    ],
    ids=["by speed", "by place"],
)
def test_back_and_forth_a_place_and_a_speed_are_one(tmp_path, hidden, names):
    """At the ends of one stroke the axis is always slow, in its middle always fast: a zone there is a drag by v².

    A zone is a parabola, which friction that saturates is not.
    """
    strokes = [logged(i, hidden=hidden, strokes=[(20.0, 1.0 - 0.02 * i)]) for i in range(2)]
    tried = ("saturating_friction", "friction_zone", "stribeck_friction", "quadratic_drag")
    [one] = discover(strokes, drive_of(tmp_path, False), candidates=tried).effects
    assert {one.name, *one.same_as} == names


@pytest.mark.long
@pytest.mark.skipif(not JOINT.is_dir(), reason="the logs of others are not here")
@pytest.mark.xfail(strict=True, reason="the law alone is told: what was fitted prefers it by e⁴⁹")
def test_a_robots_joint_names_both(tmp_path):
    """Its place and its speed are one: what was fitted prefers the one law, what was held out the other."""
    drive = em.load_actuator(JOINT / "ur10e_j1.toml")
    columns = ("motor_position_rad=q_rad", "motor_speed_rad_s=qd_rad_s", "current_A=i_A")
    logs = [em.read(JOINT / f"ur1_{part}.csv", drive, columns) for part in "abc"]
    tried = ("friction_zone", "saturating_friction", "stribeck_friction", "hinge_moment")
    [one] = discover(logs[:2], drive, holdout=logs[2:], candidates=tried).effects
    assert {one.name, *one.same_as} == {"saturating_friction", "friction_zone"}


def arm_of(folder, reach: float, hidden, names=None):
    """A discovery of what an axis carries through so many radians to either side."""
    fitted, held = (
        [logged(i, hidden=hidden, times=1.0 - 0.15 * i, reach=reach / 56.0, counts=26000.0) for i in places]
        for places in ((0, 1), (2,))
    )
    return discover(fitted, drive_of(folder, False), holdout=held, candidates=names)


LOADS = ("pendulum_load", "hinge_moment", "cubic_spring", "constant_load", "one_sided_spring")


@pytest.mark.parametrize(
    ("reach", "zero"),
    [(1.0, 2.5), *(pytest.param(*one, marks=pytest.mark.long) for one in ((2.0, 0.4), (2.0, 0.0), (1.0, -1.2)))],
)
def test_an_arms_weight_is_named_where_the_travel_shows_its_sine(tmp_path, reach, zero):
    """It comes before hinge moment and cubic spring, the terms of its series."""
    found = arm_of(tmp_path, reach, lambda angle, speed: 0.02 * np.sin(angle - zero), LOADS)
    [one] = found.effects
    assert one.name == "pendulum_load" and not one.same_as and found.ladder[-1].rmse < 1.1
    for name, true in (("moment_Nm", 0.02), ("angle_rad", zero)):
        assert one.parameters[name].value == pytest.approx(true, abs=0.02)
        low, high = one.parameters[name].interval90
        assert low - 0.01 < true < high + 0.01


@pytest.mark.parametrize("zero", [0.0, pytest.param(0.4, marks=pytest.mark.long)])
def test_over_a_short_travel_it_is_not_told_from_a_spring(tmp_path, zero):
    found = arm_of(tmp_path, 0.1, lambda angle, speed: 0.02 * np.sin(angle - zero), LOADS)
    [one] = found.effects
    assert one.name == "hinge_moment" and one.same_as == ("pendulum_load",)


@pytest.mark.parametrize(
    ("hidden", "name", "parameter"),
    [
        (lambda angle, speed: 0.02 * angle, "hinge_moment", "stiffness_Nm_rad"),
        pytest.param(lambda angle, speed: 0.02 * angle**3, "cubic_spring", "stiffness_Nm_rad3", marks=pytest.mark.long),
    ],
    ids=["spring", "cubic spring"],
)
def test_springs_are_no_weight(tmp_path, hidden, name, parameter):
    found = arm_of(tmp_path, 1.0, hidden, LOADS)
    [one] = found.effects
    assert one.name == name and not one.same_as
    assert one.parameters[parameter].value == pytest.approx(0.02, rel=0.05)


def test_a_law_that_is_not_in_the_library_is_told_by_its_variable(tmp_path):
    """Friction that is greater about one speed."""
    found = found_of(
        tmp_path, lambda angle, speed: 0.006 * np.sign(speed) * np.exp(-(((np.abs(speed) - 150.0) / 40.0) ** 2))
    )
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
