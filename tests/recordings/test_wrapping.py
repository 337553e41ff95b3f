"""Wrapped angles are made continuous, at any speed that can be told, and refused where it cannot."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.errors import InputError
from ema_model.recordings.read import read_measurement

N = 2000
TIME = np.arange(N) * 1e-3
TURN = 2.0 * np.pi
SLOW = 20.0 * np.sin(2.0 * np.pi * 0.8 * TIME) + 3.0 * TIME  # rad
RAMP = TURN * 0.46 * 0.5 * TIME**2 / 2e-3  # to 0.46 of a turn a sample
RANGES = {  # of a sensor: name of its column, what it gives, lowest and one turn of it
    "degrees": ("angle [deg]", 180.0 / np.pi, 0.0),
    "radians": ("angle [rad]", 1.0, -np.pi),
    "counts": ("angle [counts/4096]", 4096.0 / TURN, 0.0),
    "turns, shifted": ("angle [turns]", 1.0 / TURN, -0.2 * TURN),
}


def write(path, angle, name="angle [rad]", scale=1.0, low=0.0, noise=0.0, **more):
    """A recording of an angle wrapped to one turn from `low` on; further columns by name."""
    angle = angle + noise * np.random.default_rng(3).standard_normal(angle.size)
    column = scale * (np.mod(angle - low, TURN) + low)
    if "counts" in name:
        column = np.floor(column)
    columns = {"time_s": TIME[: angle.size], name: column, **more}
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    return [f"motor_position_rad={name}"]


def turns_off(found, angle):
    """By how much a found angle leaves the true one, beside whole turns at its start, rad."""
    return np.max(np.abs(found - angle - TURN * np.round((found[0] - angle[0]) / TURN)))


@pytest.mark.parametrize("sensor", RANGES)
def test_an_angle_within_one_turn_is_made_continuous(sensor, tmp_path):
    name, scale, low = RANGES[sensor]
    mapping = write(tmp_path / "a.csv", SLOW, name, scale, low, noise=1e-3)
    found = read_measurement(tmp_path / "a.csv", mapping)
    assert turns_off(found["motor_position_rad"], SLOW) < 8e-3
    [remark] = found.reading.remarks
    assert remark.startswith("motor_position_rad is wrapped to one turn and is made continuous (")
    assert remark in found.notes and remark in found.reading.told


def test_a_counter_that_begins_again_is_made_continuous(tmp_path):
    counts = np.mod(np.floor(40.0 * SLOW / TURN * 4096.0), 65536)
    table = np.column_stack([TIME, counts])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time_s,enc", comments="")
    found = read_measurement(tmp_path / "a.csv", ["motor_position_rad=enc[counts/4096]"])
    assert turns_off(found["motor_position_rad"], 40.0 * SLOW) < 2e-3
    assert "wrapped to 65536 counts" in found.reading.told


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_nearly_half_a_turn_a_sample_is_followed(noise, tmp_path):
    """With noise single steps pass the half."""
    mapping = write(tmp_path / "a.csv", RAMP, noise=noise)
    found = read_measurement(tmp_path / "a.csv", mapping)
    assert turns_off(found["motor_position_rad"], RAMP) < 5.0 * noise + 1e-9


@pytest.mark.parametrize("angle", [1.6 * RAMP, -1.3 * RAMP, RAMP[::-1] * 1.2, 700.0 * SLOW, 2900.0 * TIME])
def test_faster_than_half_a_turn_a_sample_needs_a_speed(angle, tmp_path):
    mapping = write(tmp_path / "a.csv", angle)
    with pytest.raises(InputError, match="turns cannot be counted; record faster, or record motor_speed_rad_s as well"):
        read_measurement(tmp_path / "a.csv", mapping)
    speed = np.gradient(angle, TIME) + 30.0 * np.random.default_rng(5).standard_normal(N)
    mapping = write(tmp_path / "a.csv", angle, **{"speed [rpm]": speed * 30.0 / np.pi})
    found = read_measurement(tmp_path / "a.csv", [*mapping, "motor_speed_rad_s=speed [rpm]"])
    assert turns_off(found["motor_position_rad"], angle) < 1e-6
    assert "made continuous, by motor_speed_rad_s (" in found.reading.told


def test_a_speed_of_another_unit_is_not_believed(tmp_path):
    mapping = write(tmp_path / "a.csv", RAMP, **{"speed": np.gradient(RAMP, TIME) * 30.0 / np.pi})
    found = read_measurement(tmp_path / "a.csv", [*mapping, "motor_speed_rad_s=speed"])
    assert turns_off(found["motor_position_rad"], RAMP) < 1e-9
    assert "by motor_speed_rad_s" not in found.reading.told


def test_runs_are_counted_by_themselves(tmp_path):
    run = (TIME >= 1.0).astype(float)
    mapping = write(tmp_path / "a.csv", np.where(run == 1.0, 2.0 - SLOW, SLOW), segment=run)
    found = read_measurement(tmp_path / "a.csv", mapping)
    for part, angle in ((run == 0.0, SLOW), (run == 1.0, 2.0 - SLOW)):
        assert turns_off(found["motor_position_rad"][part], angle[part]) < 1e-9


STEPS = np.floor(TIME / 0.25) % 2.0
NOT_WRAPPED = {
    "a step of 200 degrees": 3.5 * STEPS,
    "a step of 300 degrees": 5.2 * STEPS,
    "several turns": SLOW,
    "less than half a turn": 1.5 * np.sin(5.0 * TIME),
    "one turn": np.pi * np.sin(5.0 * TIME),
}


@pytest.mark.parametrize("what", NOT_WRAPPED)
def test_what_is_not_wrapped_stays(what, tmp_path):
    angle = NOT_WRAPPED[what]
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, angle]), delimiter=",", header="time_s,x", comments="")
    found = read_measurement(tmp_path / "a.csv", ["motor_position_rad=x"])
    np.testing.assert_allclose(found["motor_position_rad"], angle)
    assert not found.reading.remarks


def test_a_command_is_wrapped_only_where_the_position_is(tmp_path):
    """A saw tooth of one turn is a command like any other, and so is a square wave of one turn."""
    goal = np.mod(9.0 * TIME, TURN)
    for command, user, is_wrapped in (
        (goal, 0.9 * np.abs(goal - 3.0), False),
        (TURN * STEPS, SLOW % TURN, False),
        (goal, np.mod(9.0 * TIME - 0.2, TURN), True),
    ):
        table = np.column_stack([TIME, command, user])
        np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="time_s,command_rad,user_position_rad", comments="")
        found = read_measurement(tmp_path / "a.csv")["command_rad"]
        np.testing.assert_allclose(found, 9.0 * TIME if is_wrapped else command, atol=1e-9)
