"""A comparison from end to end, on recordings of the three-phase Reference Model."""

from __future__ import annotations

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, plant, recorded

from ema_model.actuator import load_actuator
from ema_model.comparison import compare, regions
from ema_model.comparison.regions import worst_regions
from ema_model.comparison.residuals import Residuals
from ema_model.discovery.transmission import transmission_seen
from ema_model.errors import InputError
from ema_model.recordings import SIGNALS, Measurement, read
from ema_model.recordings.read import prepared

COGGING = {"cogging_torque": {"amplitude_Nm": 0.012}}


@pytest.fixture(scope="module")
def cogged():
    return compare(recorded(1, effects=COGGING), ACTUATOR)


@pytest.mark.parametrize(
    "command, noise",
    [
        (SINE, 0.45),
        (("chirp", {}, 0.5), 0.1),
        (("step", {"final_rad": 0.005}, 0.5), 0.45),
        (("staircase", {}, 1.0), 0.2),
    ],
)
def test_nothing_hidden_is_adequate(command, noise):
    found = compare(recorded(5, commands=[command], noise_A=noise), ACTUATOR)
    assert found.adequate and not found.worst_regions
    assert found.sentences[0].startswith("The model explains the recordings")


@pytest.mark.parametrize(
    "case, variable, modulators",
    [
        ({"extra": {"motor.viscous_friction_Nms_rad": 7e-5}}, "motor_speed", {"1", "sign_speed"}),
        ({"effects": {"hinge_moment": {"stiffness_Nm_rad": 1000.0}}}, "user_position", {"1"}),
        ({"effects": {"load_dependent_friction": {"ratio": 0.15}}, "load": 50.0}, "current", {"sign_speed"}),
    ],
)
def test_hidden_effect_shows_against_its_variable(case, variable, modulators):
    found = compare(recorded(3, **case), ACTUATOR)
    first = found.explained_by[0]
    assert not found.adequate and first.significant
    assert first.variable == variable and first.modulator in modulators
    assert found.worst_regions


def test_cogging_is_named_with_its_order_and_amplitude(cogged):
    assert cogged.explained_by[0].variable == "motor_angle" and not cogged.adequate
    assert cogged.orders[0].order == 12
    # 12 mN·m of torque, of which the loop lets a part through as motion, in amperes at 0.0752 N·m/A
    assert cogged.orders[0].amplitude == pytest.approx(0.012 / 0.0752, rel=0.5)
    assert "12 times a turn" in cogged.sentences[0] and "mN·m" in cogged.sentences[0]
    assert "explained by motor angle" in cogged.sentences[1], "what is missing first, then what bears it out"


def test_error_falls_to_the_floor_once_the_effect_is_in_the_model(cogged):
    added = compare(recorded(1, effects=COGGING), ACTUATOR, effects=COGGING)
    assert added.adequate
    error = added.signals["current_A"]
    assert error.rmse < 1.03 * error.noise_floor < cogged.signals["current_A"].rmse


def test_calibration_finds_the_plant():
    truth = plant(11)
    found = compare(recorded(11, commands=[("chirp", {}, 0.5), SINE]), ACTUATOR).calibration
    assert found is not None and found.converged
    for path in ("motor.inertia_kgm2", "motor.dynamic_friction_Nm", "transmission.backlash_rad"):
        low, high = found.parameters[path].interval90
        width = high - low
        assert low - 2.0 * width < truth.value(path) < high + 2.0 * width
        assert width < 3.3 * ACTUATOR.tolerances[path].sigma, "the data tell more than the file"
    initial = compare(recorded(11), ACTUATOR, calibrate=False)
    assert initial.calibration is None
    position = initial.signals["motor_position_rad"]  # only the start is fitted then
    assert position.rmse == pytest.approx(position.rmse_initial, rel=0.01)


def test_free_parameters_and_faults_are_the_users_choice():
    recordings = recorded(4, noise_A=0.1)
    found = compare(recordings, ACTUATOR, free=["motor.inertia_kgm2", "k1"])
    assert found.calibration is not None and set(found.calibration.parameters) == {"motor.inertia_kgm2", "k1"}
    with pytest.raises(InputError, match=r"motor\.pole_pairs cannot be calibrated"):
        compare(recordings, ACTUATOR, free=["motor.pole_pairs"])
    with pytest.raises(InputError, match="no signal 'speed' to compare"):
        compare(recordings, ACTUATOR, signals=["speed"])


def test_regions_lie_where_their_sentences_say(cogged):
    residuals = cogged.residuals
    for region in cogged.worst_regions:
        values = residuals.variables[region.variable]
        if region.variable == "motor_angle":
            values = np.mod(values, 2.0 * np.pi)
        inside = values[region.blocks]
        assert region.low - 1e-9 <= inside.min() and inside.max() <= region.high + 1e-9
        error = residuals.values[region.signal][region.blocks]
        assert region.rmse == pytest.approx(np.sqrt(np.mean(error**2)))
        assert region.mean == pytest.approx(np.mean(error))
        assert region.sentence.endswith("than the model.")


def regions_of(time_s, speed, error_A, *told):
    """The worst regions of a residual current at a motor's speed, told by variables times modulators."""
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(speed))
    sigma, alike = {"current_A": np.full(len(speed), 1e-3)}, np.zeros(len(speed), dtype=int)
    known = {"motor_speed": speed, "time": time_s}
    values, nothing = {"current_A": error_A + noise}, np.zeros(len(speed), dtype=bool)
    rest = (alike, alike, nothing, time_s[1] - time_s[0], 0.075)
    residuals = Residuals(time_s, values, sigma, sigma, sigma, known, *rest)
    explained = [SimpleNamespace(variable=one, modulator=by, significant=True) for one, by in told]
    return [one.sentence for one in worst_regions(residuals, "current_A", explained, ACTUATOR.axes)]


def test_friction_at_reversals_says_which_way_it_moves():
    time = np.arange(0.0, 4.0, 1e-3)
    speed = 300.0 * np.sin(np.pi * time)
    found = regions_of(time, speed, 0.2 * np.sign(speed) * (np.abs(speed) < 15.0), ("motor_speed", "sign_speed"))
    slow = [one for one in found if "at reversals" in one]
    assert len(slow) == 2 and len(set(slow)) == 2, slow
    assert any("moves forward" in one for one in slow) and any("moves back" in one for one in slow)


def test_regions_that_would_read_alike_say_their_range(monkeypatch):
    def same(*_, details="", **more):
        return f"The motor needs more torque somewhere{f' ({details})' if details else ''} than the model."

    monkeypatch.setattr(regions, "region_sentence", same)
    time = 10_000.0 + np.arange(0.0, 4.0, 1e-3)
    speed = 300.0 * np.sin(np.pi * time)
    found = regions_of(time, speed, 0.2 * np.sign(speed) * (np.abs(speed) < 15.0), ("motor_speed", "sign_speed"))
    assert len(found) > 2 and len(set(found)) == len(found), found
    assert all(" rad/s) than" in one or " s) than" in one for one in found)


def test_json_is_whole_and_plain(cogged):
    document = json.loads(json.dumps(cogged.to_dict(), allow_nan=False))
    assert set(document) >= {"signals", "calibration", "explained_by", "orders", "worst_regions", "adequate"}
    assert set(document["signals"]["current_A"]) >= {"rmse", "nrmse", "noise_floor"}
    parameter = document["calibration"]["parameters"]["motor.inertia_kgm2"]
    assert parameter["unit"] == "kg·m²" and len(parameter["interval90"]) == 2
    assert {"variable", "from", "to", "rmse", "sentence"} <= set(document["worst_regions"][0])


def test_progress_may_stop_it():
    class Stop(Exception):
        pass

    def stop(text: str) -> None:
        if text.startswith("calibrating"):
            raise Stop

    with pytest.raises(Stop):
        compare(recorded(2), ACTUATOR, on_progress=stop)


def test_phase_currents_and_a_turned_rotor_are_enough():
    [recording] = recorded(6, noise_A=0.1)
    bare = {name: recording[name] for name in recording if name != "current_A"}
    bare["motor_position_rad"] = bare["motor_position_rad"] - 0.2  # the encoder's zero is not phase A's
    bare["user_position_rad"] = bare["user_position_rad"] - 0.2 / 500.0
    bare["command_rad"] = bare["command_rad"] - 0.2 / 500.0
    found = compare([Measurement(bare, name="phases")], ACTUATOR.with_values({"motor.rotor_offset_rad": 0.15}))
    [note] = [note for note in found.recordings[0].measurement.notes if "rotor's offset" in note]
    assert float(note.split()[-2]) == pytest.approx(0.2, abs=0.01)
    assert found.signals["current_A"].rmse < 1.2 * found.signals["current_A"].noise_floor


LINEAR = """
name = "linear axis"
[axes]
motor = "linear"
user = "linear"
[controller]
kind = "unknown"
[motor]
force_constant_N_A = 20.0
mass_kg = { value = 2.0, tolerance = 0.2 }
viscous_friction_Ns_m = { value = 3.0, sigma = 2.0 }
static_friction_N = 0.0
dynamic_friction_N = { value = 5.0, sigma = 3.0 }
"""


def test_linear_axis_speaks_of_newtons_and_metres(tmp_path):
    path = tmp_path / "linear.toml"
    path.write_text(LINEAR, encoding="utf-8")
    time = np.arange(0.0, 4.0, 1e-3)
    position = 0.2 * np.sin(2.0 * np.pi * 0.5 * time) + 0.02 * np.sin(2.0 * np.pi * 3.0 * time)
    speed = np.gradient(position, time)
    force = 2.3 * np.gradient(speed, time) + 3.0 * speed + 5.0 * np.sign(speed) + 60.0 * position
    random = np.random.default_rng(0)
    recording = Measurement(
        {
            "time_s": time,
            "motor_position_m": position,
            "current_A": force / 20.0 + 0.02 * random.standard_normal(time.size),
        },
        name="slide",
    )
    found = compare([recording], load_actuator(path))
    assert set(found.signals) == {"current_A"} and set(found.signals) <= set(SIGNALS)
    assert not found.adequate
    assert found.explained_by[0].variable == "user_position" and not found.orders
    assert any(re.search(r" N more force .* m?m than", sentence) for sentence in found.sentences), found.sentences
    assert found.to_dict()["calibration"]["parameters"]["motor.mass_kg"]["unit"] == "kg"


OUTPUT = """
name = "output side"
{axes}
[controller]
kind = "unknown"
[motor]
torque_constant_Nm_A = 0.05
inertia_kgm2 = {{ value = 1e-4, tolerance = 0.3 }}
viscous_friction_Nms_rad = {{ value = 2e-5, sigma = 2e-5 }}
static_friction_Nm = 0.0
dynamic_friction_Nm = {{ value = 0.01, sigma = 0.01 }}
{transmission}
"""
SCREW = '[axes]\nuser = "linear"', "[transmission]\ngear_ratio = 1.5915494309189535e-3"
GEAR = "", "[transmission]\ngear_ratio = 0.02"


@pytest.mark.parametrize(
    ("actuator", "ratio", "columns", "told"),
    [
        (SCREW, 0.01 / (2.0 * np.pi), ("travel [mm]", "rod speed [mm/s]"), "by the screw's lead of 10 mm a turn"),
        (GEAR, 0.02, ("joint angle [deg]", "joint speed [deg/s]"), "by the gear 1:50"),
    ],
    ids=["screw", "gear"],
)
def test_the_output_alone_shows_the_motor(actuator, ratio, columns, told, tmp_path):
    """What was recorded behind a gear of known ratio, from the equation of motion alone, gives inertia and friction."""
    (tmp_path / "output.toml").write_text(OUTPUT.format(axes=actuator[0], transmission=actuator[1]), encoding="utf-8")
    time = np.arange(0.0, 6.0, 1e-3)
    angle, speed, acceleration = np.zeros((3, time.size))
    for size, rate in ((40.0, 0.3), (6.0, 1.7), (1.5, 4.0)):
        w = 2.0 * np.pi * rate
        angle += size * np.sin(w * time)
        speed += size * w * np.cos(w * time)
        acceleration -= size * w * w * np.sin(w * time)
    torque = 1.2e-4 * acceleration + 3e-5 * speed + 0.014 * np.sign(speed)
    noise = np.random.default_rng(4).standard_normal((2, time.size))
    user = ratio * (angle + 1e-4 * noise[0])
    scale = 1e3 if "mm" in columns[0] else 180.0 / np.pi
    table = np.column_stack([time, scale * user, scale * ratio * speed, torque / 0.05 + 0.01 * noise[1]])
    header = ",".join(["time_s", *columns, "iq [A]"])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=header, comments="", fmt="%.9g")
    loaded = load_actuator(tmp_path / "output.toml")
    mapping = [f"{loaded.axes.signal('user_position_rad')}={columns[0]}"]
    recording = read(tmp_path / "a.csv", loaded, mapping)
    np.testing.assert_allclose(recording["motor_position_rad"], angle, atol=1e-3)
    np.testing.assert_allclose(recording["motor_speed_rad_s"], speed, atol=1e-3)
    user_name = loaded.axes.signal("user_position_rad")
    assert f"motor_position_rad is made of {user_name} {told}" in recording.reading.remarks
    found = compare([recording], loaded).calibration.actuator
    assert found.motor.inertia_kgm2 == pytest.approx(1.2e-4, rel=0.02)
    assert found.motor.dynamic_friction_Nm == pytest.approx(0.014, rel=0.03)
    assert found.motor.viscous_friction_Nms_rad == pytest.approx(3e-5, rel=0.1)
    alone = {"time_s": time, user_name: ratio * angle, "current_A": torque / 0.05}
    assert transmission_seen([prepared(Measurement(alone), loaded)], loaded) is None  # it would show itself
