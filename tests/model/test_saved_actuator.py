"""An actuator written to a file is read back the same, whatever its kind."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import Tolerance, load_actuator, save_actuator
from ema_model.effects.user import torque_curve, user_torque
from ema_model.errors import InputError
from ema_model.faults import vector

SHIPPED = sorted((Path(__file__).parents[2] / "assets" / "actuators").glob("*.toml"))
LINEAR = """
name = "ball screw \\"3\\""
[axes]
user = "linear"
[controller]
kind = "position"
gain_1_m = 50.0
[inverter]
kind = "current"
current_limit_A = 5.0
[motor]
torque_constant_Nm_A = 0.1
inertia_kgm2 = { value = 1e-4, tolerance = 0.1 }
viscous_friction_Nms_rad = 0.0
static_friction_Nm = 0.0
dynamic_friction_Nm = 0.01
[transmission]
gear_ratio = 8e-4
backlash_m = { value = 1e-5, tolerance = 0.2, free = false }
[effects.hinge_moment]
stiffness_N_m = 1000.0
offset_N = { value = 0.0, sigma = 5.0 }
"""


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_files_come_back(path, tmp_path):
    actuator = load_actuator(path)
    save_actuator(actuator, tmp_path / "again.toml")
    assert load_actuator(tmp_path / "again.toml") == actuator


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_without_its_controller_it_comes_back_with_all_that_is_read(path, tmp_path):
    """As a discovery that goes on without one saves it, whatever acts in the drive or is told of it."""
    given = load_actuator(path)
    delay = {"computation_delay": {"delay_s": 1e-3}}
    late = {"effects.computation_delay.delay_s": Tolerance(1e-3, True)}
    bare = replace(given, effects={**given.effects, **delay}, tolerances={**given.tolerances, **late})
    bare = replace(bare, step_s=2e-5).without_controller()
    save_actuator(bare, tmp_path / "again.toml")
    again = load_actuator(tmp_path / "again.toml")
    assert again.controller.kind == "unknown" and "computation_delay" not in again.effects
    assert again.leaves_out_reversals and not given.leaves_out_reversals
    assert again.motor.inertia_kgm2 == given.motor.inertia_kgm2 and again.sensors == given.sensors
    assert again.tolerances == bare.tolerances and "motor.inertia_kgm2" in again.tolerances


def test_mixed_axes_and_effects_come_back(tmp_path):
    (tmp_path / "screw.toml").write_text(LINEAR, encoding="utf-8")
    actuator = load_actuator(tmp_path / "screw.toml")
    assert actuator.transmission.backlash_rad == 1e-5 and actuator.effects["hinge_moment"]["stiffness_Nm_rad"] == 1000.0
    save_actuator(actuator, tmp_path / "again.toml")
    text = (tmp_path / "again.toml").read_text(encoding="utf-8")
    assert "backlash_m" in text and "gain_1_m" in text and "stiffness_N_m" in text
    assert load_actuator(tmp_path / "again.toml") == actuator


def test_faults_come_back_beside_effects_of_ones_own(tmp_path):
    curve = torque_curve(np.array([0.1, -0.2, 0.05, 0.1]), 0.0, 1.0, "omega", "1")
    torque = user_torque("c*sin(3*theta)")
    effects = {one.name: {parameter.name: parameter.default for parameter in one.parameters} for one in (curve, torque)}
    faults = {"k1": 0.3, "k6": 0.1 + 0.2, "k7": 0.75, "k8": 0.0}
    actuator = replace(load_actuator(), faults=faults, effects=effects)
    save_actuator(actuator, tmp_path / "again.toml")
    again = load_actuator(tmp_path / "again.toml")
    assert again == actuator and list(again.effects) == list(effects)
    assert np.array_equal(again.k, vector(faults))


@pytest.mark.parametrize(
    "line, says",
    [
        ("k9 = 0.1", "[faults] no fault 'k9'; faults are k1 … k8"),
        ("k1 = 1.5", "[faults] fault k1 = 1.5 is outside 0 … 1"),
        ("k1 = -0.1", "[faults] fault k1 = -0.1 is outside 0 … 1"),
        ("k1 = nan", "[faults] k1 must be a number, not 'nan'"),
        ('k1 = "much"', "[faults] k1 must be a number, not 'much'"),
        ("k1 = true", "[faults] k1 must be a number, not 'True'"),
        ("k1 = { value = 0.1 }", "[faults] k1 must be a number"),
    ],
)
def test_a_mistake_in_the_faults_is_one_clear_line(tmp_path, line, says):
    path = tmp_path / "screw.toml"
    path.write_text(f"{LINEAR}\n[faults]\n{line}\n", encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_actuator(path)
    assert says in str(error.value) and "\n" not in str(error.value)
    path.write_text(f"faults = 3\n{LINEAR}", encoding="utf-8")
    with pytest.raises(InputError, match=r"\[faults\] must be a table"):
        load_actuator(path)


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"must end in \.toml"):
        save_actuator(load_actuator(), tmp_path / "a.txt")
    with pytest.raises(InputError, match="cannot be written"):
        save_actuator(load_actuator(), tmp_path / "none" / "a.toml")


@pytest.mark.parametrize(
    "change, says",
    [
        (('user = "linear"', 'user = "round"'), "[axes] user must be rotary or linear"),
        (('kind = "position"', 'kind = "fuzzy"'), "[controller] kind must be cascade or position or "),
        (('kind = "current"', 'kind = "hysteresis"'), "a position controller needs"),
        (("gain_1_m", "gain_1_rad"), "[controller] has no parameter 'gain_1_rad'"),
        (("[effects.hinge_moment]", "[effects.rust]"), "[effects] no effect 'rust'"),
        (("stiffness_N_m", "stiffness_Nm_rad"), "has no 'stiffness_Nm_rad'"),
        (("stiffness_N_m = 1000.0", "stiffness_N_m = 1e10"), "stiffness_N_m = 1e+10 is outside"),
        (("[axes]", "[recordings]\nmapping = 3\n[axes]"), "mapping must be a list of texts"),
        (("[axes]", "[[recordings.where]]\nset = {}\n[axes]"), "needs match"),
        (("[axes]", '[[recordings.where]]\nmatch = "*"\nset = { "motor.colour" = 1 }\n[axes]'), "no parameter"),
        (("[axes]", "[model]\nstep_s = 5\n[axes]"), "step_s must lie between"),
    ],
)
def test_mistakes_are_one_clear_line(tmp_path, change, says):
    path = tmp_path / "screw.toml"
    assert change[0] in LINEAR
    path.write_text(LINEAR.replace(*change), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_actuator(path)
    assert says in str(error.value) and "\n" not in str(error.value)


def noted(text: str) -> list[str]:
    return [line for line in text.splitlines() if "1 σ of what the fit found" in line]


def test_found_sigmas_are_saved_and_the_others_stay(tmp_path):
    """Of base parameters, effects of the catalogue, expressions and curves alike; a file says each key once."""
    curve = torque_curve(np.array([0.1, -0.2, 0.05, 0.1]), 0.0, 1.0, "omega", "1")
    torques = [user_torque("c*sin(3*theta)"), user_torque("d*omega")]
    (tmp_path / "screw.toml").write_text(LINEAR, encoding="utf-8")
    given = load_actuator(tmp_path / "screw.toml")
    own = {one.name: {p.name: p.default for p in one.parameters} for one in (curve, *torques)}
    free = {f"effects.{name}.{parameter}": Tolerance(0.5, True) for name, its in own.items() for parameter in its}
    given = replace(given, effects={**given.effects, **own}, tolerances={**given.tolerances, **free})
    sigmas = {path: 0.1 * one.sigma * (1.0 + 0.01 * i) for i, (path, one) in enumerate(given.tolerances.items())}
    found = given.with_fitted_sigmas(sigmas | {"k1": 0.1})
    assert {path: one.sigma for path, one in found.tolerances.items()} == sigmas
    save_actuator(found, tmp_path / "found.toml")
    again = load_actuator(tmp_path / "found.toml")
    assert again == found and again.tolerances["transmission.backlash_rad"].free is False
    text = (tmp_path / "found.toml").read_text(encoding="utf-8")
    assert len(noted(text)) == 1 and "1.645" in noted(text)[0]
    save_actuator(again.with_fitted_sigmas({"motor.inertia_kgm2": 1e-7}), tmp_path / "found.toml")
    text = (tmp_path / "found.toml").read_text(encoding="utf-8")
    assert (
        len(noted(text)) == 1 and load_actuator(tmp_path / "found.toml").tolerances["motor.inertia_kgm2"].sigma == 1e-7
    )
    heads = ("name", "inertia_kgm2", "backlash_m", "stiffness_N_m", "offset_N")
    assert [sum(line.startswith(f"{key} =") for line in text.splitlines()) for key in heads] == [1] * 5


@pytest.mark.parametrize("sigma", [0.0, -1e-6, float("nan"), float("inf"), 0.95e-5, 1e-4])
def test_what_is_no_sigma_and_what_a_fit_learned_nothing_of_keeps_the_files_tolerance(sigma, tmp_path):
    (tmp_path / "screw.toml").write_text(LINEAR, encoding="utf-8")
    given = load_actuator(tmp_path / "screw.toml")
    found = given.with_fitted_sigmas({"motor.inertia_kgm2": sigma})
    assert found == given
    save_actuator(found, tmp_path / "found.toml")
    text = (tmp_path / "found.toml").read_text(encoding="utf-8")
    assert "inertia_kgm2 = { value = 1e-4, tolerance = 0.1 }" in text and not noted(text)


def test_a_key_that_a_comment_offers_stands_once(tmp_path):
    """As in the files that are made with comments, in which what stands at its default is a comment."""
    path = tmp_path / "servo.toml"
    actuator = replace(load_actuator(SHIPPED[-1]), text="")
    save_actuator(replace(actuator, tolerances={}), path, with_comments=True)
    offers = [line for line in path.read_text(encoding="utf-8").splitlines() if re.match(r"# \w+ = ", line)]
    assert any(line.startswith("# gear_ratio = 1.0 ") for line in offers) and len(offers) > 5
    given = load_actuator(path).with_values({"transmission.gear_ratio": 0.1507})
    found = replace(given, tolerances={"sensors.current_bias_A": Tolerance(0.5, True)})
    for _ in range(2):
        save_actuator(found, path)
        text = path.read_text(encoding="utf-8")
        sections = [re.findall(r"^(?:# )?(\w+) = ", part, re.M) for part in text.split("\n[")]
        assert all(len(its) == len(set(its)) for its in sections), sections
        assert "how far the user moves" in next(line for line in text.splitlines() if line.startswith("gear_ratio"))
        assert load_actuator(path) == found
