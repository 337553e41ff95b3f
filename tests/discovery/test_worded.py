"""Warnings are plain words: no path of a parameter and no name of a file of effects stands in them."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from support.discovered import with_cogging

from ema_model.actuator import load_actuator
from ema_model.discovery import words
from ema_model.discovery.result import Change, StoodIn
from ema_model.discovery.words import (
    NOT_REPEATABLE,
    effect_title,
    masked,
    moved,
    of_the_poles,
    rung_label,
    sentences,
    untold,
)
from ema_model.estimation import Calibrated
from ema_model.quantities import ROTARY, Axes, in_sentence
from emaviz.views.report import export

RAW = re.compile(r"[a-z]+\.[a-z_]+_|cogging_torque|torque_ripple|_Nm|_A\b")


@pytest.mark.long
def test_parameters_that_masked_an_effect_are_named_as_on_the_page(tmp_path):
    found = with_cogging()
    (one,) = found.effects
    moved = StoodIn("motor.torque_constant_Nm_A", -2.5, -0.4), StoodIn("friction.dynamic_Nm", 2.0, 0.1)
    later = replace(one, key="cogging_torque_2", stood_in=(StoodIn("motor.torque_constant_Nm_A", -0.4, -0.02),))
    lines = masked([replace(one, stood_in=moved), later], found.actuator.axes)
    assert lines == [
        "Cogging torque had been masked by motor torque constant (−2.5 → +0.0 σ) and friction dynamic (+2.0 → +0.1 σ), "
        "now nearer to their nominal values."
    ]
    told = replace(
        found,
        effects=[replace(one, stood_in=moved), later],
        warnings=[untold("cogging_torque", "torque_ripple"), NOT_REPEATABLE],
    )
    assert lines[0] in told.to_dict()["warnings"] and lines[0] in sentences(told)
    assert not any(RAW.search(line) for line in told.to_dict()["warnings"])
    export(told, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Cogging torque had been masked" in page and "tells cogging torque from torque ripple" in page
    shown = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.S)
    assert "motor.torque_constant" not in shown and "friction.dynamic" not in shown


@pytest.mark.long
def test_an_effect_that_is_a_parameter_does_not_mask_itself():
    found = with_cogging()
    (one,) = found.effects
    itself = replace(
        one,
        name="viscous_friction",
        stands_for="motor.viscous_friction_Nms_rad",
        stood_in=(StoodIn("motor.viscous_friction_Nms_rad", 2.0, 0.0),),
    )
    assert masked([itself], found.actuator.axes) == []


def test_a_parameter_that_an_effect_takes_beyond_its_tolerance_is_told_by_the_effect():
    """Its own value, which stays within, would say the contrary."""
    found = with_cogging()
    [one], path = found.effects, "motor.viscous_friction_Nms_rad"
    within = Calibrated(0.009, 0.008, (0.008, 0.01), "N·m·s/rad", 0.1, False)
    calibration = replace(found.calibration, parameters={**found.calibration.parameters, path: within})
    told = replace(
        found,
        effects=[],
        freed=[replace(one, stands_for=path)],
        calibration=calibration,
        parameters_outside_tolerance=[path],
    )
    assert "Outside its tolerance: motor viscous friction." in sentences(told)
    assert [facts.title for facts in words.added(told)] == [facts.title for facts in words.added(found)]
    rival = next(other.name for other in found.candidates if other.name != one.name)
    rivalled = replace(told, freed=[replace(one, stands_for=path, same_as=(rival,))])
    alike = f"cannot tell a different motor viscous friction from {in_sentence(effect_title(rival))}."
    assert any(alike in sentence for sentence in sentences(rivalled))
    table = words.candidates(rivalled)
    assert table is not None
    remarks = {row[0]: remark for row, remark in zip(table.rows, table.remarks)}
    assert remarks[effect_title(rival)] == f"or {in_sentence(effect_title(one.name))}: not told apart"


def test_orders_along_a_linear_motor_are_pitches():
    change = Change("effect", ("cogging_torque",), (2513.274, 7539.82))
    assert rung_label(change, Axes("linear", "linear")) == "+ cogging_torque of pitches 2.50 mm, 0.833 mm"
    assert rung_label(Change("effect", ("cogging_torque",), (24.0, 4.0)), ROTARY) == "+ cogging_torque of orders 24, 4"


def test_a_refit_that_diverged_is_called_so_and_a_poor_one_has_its_number():
    found = with_cogging()
    one, other, *rest = found.candidates
    told = replace(found, candidates=[replace(one, refitted_drop=-1.4e16), replace(other, refitted_drop=-3.0), *rest])
    table = words.candidates(told)
    assert table is not None
    refitted = {row[0]: row[2] for row in table.rows}
    assert refitted[effect_title(one.name)] == "refit diverged" and refitted[effect_title(other.name)] == "−3"


@pytest.mark.parametrize(
    ("value", "half", "verdict", "said"),
    [
        (0.0213, 0.0002, "adequate", True),
        (0.0213, 0.0002, "partly_explained", False),
        (0.0213, 0.02, "adequate", False),
        (0.0085, 0.0001, "adequate", False),
    ],
    ids=["surely moved", "what is left may have moved it", "not known so well", "hardly moved"],
)
def test_a_parameter_that_is_surely_another_than_the_files_is_told(value, half, verdict, said):
    """Within its tolerance of 0.008 ± 0.008 it is not missing physics, and yet what one wants to know."""
    one = Calibrated(value, 0.008, (value - half, value + half), "N·m·s/rad", (value - 0.008) / 0.008, False)
    found = with_cogging()
    calibration = replace(found.calibration, parameters={"motor.viscous_friction_Nms_rad": one})
    told = moved(replace(found, verdict=verdict, calibration=calibration, parameters_outside_tolerance=[]))
    line = "Within tolerance, but not as the file has it: motor viscous friction 0.02130 ± 0.00020 N·m·s/rad"
    assert [text.startswith(line) for text in told] == [True] * said


@pytest.mark.parametrize(
    ("order", "told"),
    [
        (7.0, "once an electrical turn, as offsets of the phase currents would ripple, too"),
        (14.0, "twice an electrical turn, as phase currents of unequal gain would ripple, too"),
        (42.0, "six times an electrical turn, as the inverter's dead time would ripple, too"),
        (2.0, "twice a turn of the motor, as a strain wave gear's generator would, too"),
        (12.0, ""),
    ],
)
def test_an_order_of_the_poles_or_of_a_wave_generator_is_said_beside_cogging(order, told):
    """Of any drive: an unknown controller's file may say the pole pairs, too."""
    values = {"motor.pole_pairs": 7.0, "transmission.gear_ratio": 1.0 / 101.0}
    for actuator in (load_actuator(), load_actuator().without_controller()):
        assert of_the_poles(order, actuator.with_values(values)) == told
    assert of_the_poles(2.0, load_actuator().with_values(values | {"transmission.gear_ratio": 0.2})) == ""


def test_a_file_without_a_controller_may_say_its_pole_pairs(tmp_path):
    (tmp_path / "joint.toml").write_text(
        '[controller]\nkind = "unknown"\n[motor]\ntorque_constant_Nm_A = 0.1\ninertia_kgm2 = 1e-4\npole_pairs = 7.0\n'
        "viscous_friction_Nms_rad = 1e-5\nstatic_friction_Nm = 0.01\ndynamic_friction_Nm = 0.01\n",
        encoding="utf-8",
    )
    assert load_actuator(tmp_path / "joint.toml").motor.pole_pairs == 7.0


def test_an_error_that_does_not_fall_on_what_was_not_fitted_is_not_said_to_fall():
    assert words.on_unseen(4.35, 1.02) == ", and on what was not fitted from 4.35 to 1.02"
    assert words.on_unseen(2.9, 2.93) == "; on what was not fitted it does not fall, from 2.90 to 2.93"
