"""Sensors that are off, friction by place, time, direction, saturation, bent springs: named, at their values."""

from __future__ import annotations

import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.commands import command
from ema_model.discovery import discover
from ema_model.discovery.fingerprints import variants
from ema_model.discovery.words import sentences
from ema_model.effects import CATALOGUE, find
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

CHIRP = ("chirp", {}, 0.5)
SINE = ("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}, 1.0)
# What is hidden, and what it is mistaken for most.
CASES = {
    "friction_zone": ({"ratio": 1.2, "begin_rad": 0.004, "end_rad": 0.02}, "hinge_moment", "load_dependent_friction"),
    "encoder_eccentricity": ({"amplitude_rad": 5e-3, "phase_rad": 0.8}, "screw_lead_error", "cogging_torque"),
    "position_sensor_gain": ({"ratio": 2e-3}, "position_sensor_eccentricity", "position_sensor_bias"),
    "position_sensor_nonlinearity": ({"curvature_1_rad": 0.1}, "position_sensor_gain", "position_sensor_bias"),
    "position_dependent_friction": ({"ratio": 0.4, "order": 2.0, "phase_rad": 0.5}, "cogging_torque", "torque_ripple"),
    "friction_drift": ({"rate_1_s": 0.8}, "viscous_friction", "stribeck_friction"),
    "torque_saturation": ({"saturation_1_A": 0.015}, "demagnetisation", "current_sensor_gain"),
    "cubic_spring": ({"stiffness_Nm_rad3": 2e6}, "hinge_moment", "one_sided_spring"),
    "one_sided_spring": ({"stiffness_Nm_rad": 4000.0, "contact_rad": -0.01}, "hinge_moment", "cubic_spring"),
}


LOADED = {"torque_saturation": 200.0}  # N·m: without a load the motor works too little to saturate


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_it_is_named_at_its_values(name):
    values, *rivals = CASES[name]
    found = discover(
        recorded(83, commands=[CHIRP, SINE], effects={name: values}, load=LOADED.get(name, 0.0)),
        ACTUATOR,
        candidates=[name, *rivals],
        most_effects=1,
    )
    [one] = found.effects
    assert one.name == name
    for parameter, value in values.items():
        if parameter in one.parameters:
            low, high = one.parameters[parameter].interval90
            assert one.parameters[parameter].value == pytest.approx(value, rel=0.1) or low <= value <= high
        else:
            assert one.chosen[parameter] == value


@pytest.mark.long
def test_a_sagging_bus_is_named_where_the_drive_is_at_its_voltage():
    """Of the whole library; a dead time takes as much voltage away, and is named with it."""
    steps = [("step", {"final_rad": rad}, 0.5) for rad in (0.05, 0.03)]
    seen = recorded(83, commands=[CHIRP, *steps], effects={"bus_voltage_sag": {"drop_V": 6.0}})
    found = discover(seen, ACTUATOR)
    [one] = found.effects
    assert {one.name, *one.same_as} == {"bus_voltage_sag", "dead_time"} and found.verdict == "effects_found"
    assert found.ladder[-1].rmse < 1.1 < 0.5 * found.ladder[0].rmse
    (low, high), volts = one.parameters.popitem()[1].interval90, 6.0
    assert 0.8 * volts < high and low < 1.2 * volts


def test_a_place_is_looked_for_along_the_recordings():
    spring = find("one_sided_spring")
    places = [one["contact_rad"] for [one] in variants(spring, [], ranges={"user_position": (-2.0, 2.0)})]
    assert len(places) == len(spring.placed["contact_rad"]) and min(places) < -1.0 and max(places) > 1.0
    assert variants(spring, []) == [], "the user's position is not known"
    zone = find("friction_zone")
    for [one] in variants(zone, [], ranges={"user_position": (0.0, 1.0)}):
        assert 0.0 <= one["begin_rad"] < one["end_rad"] <= 1.0


@pytest.mark.long
def test_viscous_friction_that_differs_by_direction_is_asymmetric():
    """Its Coulomb part alone would be a current sensor's bias; thick grease shows the other."""
    thick = ACTUATOR.with_values({"motor.viscous_friction_Nms_rad": 1e-4})
    hidden = {"asymmetric_friction": {"ratio": 0.0, "viscous_part_Nms_rad": 2.5e-5}}
    runs = [Run(command("chirp"), 0.5), Run(command("sine", SINE[1]), 1.0)]
    seen = [
        Sensors(0.45, 12).record(simulate_reference(run, thick, effects=hidden), 7 + i) for i, run in enumerate(runs)
    ]
    found = discover(seen, thick, candidates=["asymmetric_friction", "current_sensor_bias", "friction_drift"])
    [one] = found.effects
    assert one.name == "asymmetric_friction" and found.ladder[-1].rmse < 1.1 < found.ladder[0].rmse
    low, high = one.parameters["viscous_part_Nms_rad"].interval90
    assert low <= 2.5e-5 <= high


def test_an_order_beyond_an_effects_own_is_not_tried():
    highest = next(one.high for one in find("position_dependent_friction").parameters if one.name == "order")
    tried = variants(find("position_dependent_friction"), [1.0, highest, highest + 1.0])
    assert [pair[0]["order"] for pair in tried] == [1.0, highest]


@pytest.mark.parametrize("name", [name for name, effect in CATALOGUE.items() if effect.placed])
def test_places_are_the_effects_own_parameters(name):
    effect = CATALOGUE[name]
    assert set(effect.placed) <= {one.name for one in effect.parameters}
    assert len({len(shares) for shares in effect.placed.values()}) == 1
    assert effect.against in ("user_position", "motor_speed", "time")


@pytest.mark.long
def test_what_only_steps_show_is_named_beside_a_sine_that_was_held_out():
    """At small angles the drive never asks for more acceleration than its limit."""
    hidden = {"acceleration_limit": {"ramp_s": 0.01}}
    fitted = recorded(83, commands=[CHIRP, ("step", {"final_rad": 0.005}, 0.5), SINE], effects=hidden)
    held = recorded(
        84, plant_seed=83, commands=[("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}, 0.5)], effects=hidden
    )
    found = discover(fitted, ACTUATOR, holdout=held)
    [one] = found.effects
    assert one.name == "acceleration_limit" and found.verdict == "effects_found"
    assert one.parameters["ramp_s"].value == pytest.approx(0.01, rel=0.1)
    assert found.ladder[-1].rmse < 1.1 < 2.0 < found.ladder[0].rmse
    assert "what was not fitted hardly shows it" in " ".join(sentences(found))
