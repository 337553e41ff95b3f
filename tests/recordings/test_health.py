"""Each check of the data health card finds the fault it is for, to a stated accuracy, and is silent on clean data."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.recordings import (
    Measurement,
    SideFile,
    can_have_current,
    with_equivalent_current,
)
from ema_model.recordings.health import Health, health
from ema_model.recordings.measurement import Sensors
from ema_model.recordings.read import prepared
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
PERIOD = 1e-3
COMMANDS = ("chirp", "sine", "staircase", "multisine")


@cache
def reference(kind="chirp", duration=0.5):
    """A perfect recording of the reference model."""
    return simulate_reference(Run(command(kind), duration), ACTUATOR)


def card(measurement, **given):
    return health(measurement, pole_pairs=ACTUATOR.motor.pole_pairs, **given)


def made(time=None, side=None, **signals):
    samples = next(iter(signals.values())).size
    time = np.arange(samples) * PERIOD if time is None else time
    return Measurement({"time_s": time, **signals}, "bench", side=side or SideFile())


def times(samples=4000):
    return np.arange(samples) * PERIOD


def wandering(time, seed=0):
    """A smooth motion that never repeats."""
    rng = np.random.default_rng(seed)
    return sum(rng.normal() / f * np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.0)) for f in (0.5, 1.3, 2.9, 5.7))


# --- silence ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", COMMANDS)
@pytest.mark.parametrize("sensors", [Sensors(), Sensors(current_noise_A=0.1, encoder_bits=14)], ids=["perfect", "rig"])
def test_silent_on_clean_recordings(kind, sensors):
    found = card(sensors.record(reference(kind), seed=3), current_limit_A=22.5)
    # A slow motor gives few counts a sample, so that its speed is coarse; that is worth a word.
    warned = [finding for finding in found.findings if finding.severity == "warning"]
    assert [f.sentence for f in warned if (f.check, f.signal) != ("noise", "motor_speed_rad_s")] == []
    checks = {finding.check for finding in found.findings}
    assert {"duration", "rate", "gaps", "noise", "saturation", "delay", "speed", "gear", "standstill"} <= checks
    gear = found.of("gear")
    assert gear is not None and gear.values["ratio"] == pytest.approx(500.0, rel=0.02)
    speed = found.of("speed")
    assert speed is not None and speed.values["ratio"] == pytest.approx(1.0, abs=0.01)


def test_the_worst_finding_is_the_cards():
    found = card(reference())
    worst = max(("good", "note", "warning").index(finding.severity) for finding in found.findings)
    assert found.severity == ("good", "note", "warning")[worst]
    told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert Health.from_dict(told).to_dict() == told and str(Health.from_dict(told)) == str(found)
    assert all(finding.sentence.endswith(".") and finding.sentence.isprintable() for finding in found.findings)


# --- sampling --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scatter", "severity"), [(0.0, "good"), (0.05, "note"), (0.4, "warning")])
def test_jitter(scatter, severity):
    time = times()
    jittered = time + scatter * PERIOD * np.random.default_rng(1).uniform(-1.0, 1.0, time.size)
    rate = health(made(jittered, duty=np.sin(time))).of("rate")
    assert rate is not None and rate.severity == severity
    assert rate.values["jitter"] == pytest.approx(scatter * np.sqrt(2.0 / 3.0), rel=0.1, abs=1e-6)
    assert rate.values["rate_Hz"] == pytest.approx(1000.0, rel=0.02)


def test_gaps():
    keep = np.ones(4000, bool)
    keep[1000:1050] = keep[3000:3010] = False
    found = health(made(times()[keep], duty=np.sin(times()[keep]))).of("gaps")
    assert found is not None and found.severity == "warning" and found.values["gaps"] == 2.0
    assert found.values["longest_s"] == pytest.approx(51 * PERIOD)
    none = health(made(duty=np.sin(times()))).of("gaps")
    assert none is not None and none.severity == "good" and none.values["gaps"] == 0.0


def test_the_pause_between_segments_is_no_gap():
    time = times()
    time[2000:] += 100.0
    found = health(made(time, duty=np.sin(time), segment=(np.arange(4000) >= 2000) / 1.0))
    gaps, duration = found.of("gaps"), found.of("duration")
    assert gaps is not None and gaps.values["gaps"] == 0.0
    assert (
        duration is not None and duration.values["duration_s"] == pytest.approx(3.998) and "2 runs" in duration.sentence
    )


# --- sensors ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step", [2.0 * np.pi / 2**bits for bits in (8, 10, 12, 14)] + [0.01, 1e-3, 0.05])
@pytest.mark.parametrize("noise", [0.0, 0.7])
def test_quantisation_step(step, noise):
    position = wandering(times()) + noise * step * np.random.default_rng(2).standard_normal(4000)
    found = health(made(motor_position_rad=np.round(position / step) * step)).of("quantisation")
    assert found is not None and found.values["step"] == pytest.approx(step, rel=0.02)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.1])
def test_no_step_where_there_is_none(noise):
    position = wandering(times()) + noise * np.random.default_rng(2).standard_normal(4000)
    assert health(made(motor_position_rad=position)).of("quantisation") is None
    assert health(made(motor_position_rad=np.linspace(0.0, 1.0, 4000))).of("quantisation") is None


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.45])
@pytest.mark.parametrize("kind", COMMANDS)
def test_noise_of_the_reference_models_current(kind, noise):
    ripple = card(reference(kind)).of("noise", "current_A")  # of the chopping, which the sensors' noise adds to
    found = card(Sensors(current_noise_A=noise).record(reference(kind), seed=4)).of("noise", "current_A")
    assert ripple is not None and found is not None
    assert found.values["noise_rms"] == pytest.approx(np.hypot(noise, ripple.values["noise_rms"]), rel=0.2)
    if noise >= 0.2:
        assert found.values["noise_rms"] == pytest.approx(noise, rel=0.2)


@pytest.mark.parametrize("noise", [1e-3, 0.03, 1.0])
def test_noise_on_a_smooth_signal(noise):
    signal = wandering(times()) + noise * np.random.default_rng(5).standard_normal(4000)
    found = health(made(temperature_C=signal)).of("noise")
    assert found is not None and found.values["noise_rms"] == pytest.approx(noise, rel=0.1)
    assert found.severity == ("warning" if noise == 1.0 else "good")


def test_constant_signals_are_named():
    found = health(made(duty=np.sin(times()), bus_voltage_V=np.full(4000, 48.0)))
    constant = found.of("constant")
    assert constant is not None and constant.signal == "bus_voltage_V" and "48.0 V" in constant.sentence


def test_numbers_too_small_to_be_told_apart_are_constant():
    found = card(made(motor_position_rad=np.where(times() < 1.0, 0.0, 2e-317)))
    constant = found.of("constant")
    assert constant is not None and constant.signal == "motor_position_rad"


@pytest.mark.parametrize("limit", [0.5, 0.8, 0.9])
def test_saturation(limit):
    current = np.sin(7.0 * times())
    share = np.mean(np.abs(current) >= 0.98 * limit)
    cut = np.clip(current, -limit, limit)
    for given, side in ((limit, None), (None, SideFile(sensors={"current_limit_A": limit}))):
        found = health(made(current_A=cut, side=side), current_limit_A=given).of("saturation")
        assert found is not None and found.values["share"] == pytest.approx(share, abs=0.01)
        assert found.severity == "warning"
    noisy = cut + 0.005 * limit * np.random.default_rng(6).standard_normal(cut.size)
    seen = health(made(current_A=noisy)).of("saturation")  # without being told the limit
    assert seen is not None and seen.severity == "note"
    assert seen.values["share"] == pytest.approx(np.mean(np.abs(current) >= limit), abs=0.06)
    assert seen.values["limit_A"] == pytest.approx(limit, rel=0.03)
    free = health(made(current_A=wandering(times()))).of("saturation")
    assert free is not None and free.values["share"] == 0.0


# --- two signals -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [0.005, 0.02, 0.1])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_delay(late, noise):
    position = wandering(times() - late) + noise * np.random.default_rng(7).standard_normal(4000)
    found = health(made(command_rad=wandering(times()), user_position_rad=position)).of("delay")
    assert found is not None and found.severity == "good"
    assert found.values["delay_s"] == pytest.approx(late, rel=0.1)


@pytest.mark.parametrize("late", [0.005, 0.03])
def test_delay_added_to_the_reference_models_own(late):
    recording = reference("multisine")
    own = card(recording).of("delay")
    shift = round(late / recording.sample_period_s)
    position = recording["user_position_rad"]
    moved = np.concatenate([np.full(shift, position[0]), position[:-shift]])
    found = card(recording.with_signals(user_position_rad=moved)).of("delay")
    assert own is not None and found is not None and 0.0 < own.values["delay_s"] < 0.01
    assert found.values["delay_s"] - own.values["delay_s"] == pytest.approx(late, rel=0.1)


def test_a_response_before_its_command_is_warned_of():
    found = health(made(command_rad=wandering(times() - 0.05), user_position_rad=wandering(times()))).of("delay")
    assert (
        found is not None and found.severity == "warning" and found.values["delay_s"] == pytest.approx(-0.05, rel=0.1)
    )
    other = health(made(command_rad=wandering(times()), user_position_rad=np.random.default_rng(8).normal(size=4000)))
    unsure = other.of("delay")
    assert unsure is not None and "cannot be told" in unsure.sentence


@pytest.mark.parametrize("kind", COMMANDS)
def test_turned_signs(kind):
    recording = Sensors(current_noise_A=0.1, encoder_bits=14).record(reference(kind), seed=9)
    speed = card(recording.with_signals(motor_speed_rad_s=-recording["motor_speed_rad_s"])).of("speed")
    assert speed is not None and speed.severity == "warning" and "signs disagree" in speed.sentence
    turned = card(recording.with_signals(user_position_rad=-recording["user_position_rad"]))
    gear, delay = turned.of("gear"), turned.of("delay")
    assert gear is not None and gear.severity == "warning" and "against each other" in gear.sentence
    if kind != "staircase":
        assert delay is not None and delay.severity == "warning" and "turn a sign" in delay.sentence


@pytest.mark.parametrize(("factor", "unit"), [(30.0 / np.pi, "rpm"), (180.0 / np.pi, "deg/s"), (0.5 / np.pi, "turns")])
@pytest.mark.parametrize("kind", COMMANDS)
def test_speed_in_another_unit(kind, factor, unit):
    recording = Sensors(encoder_bits=14).record(reference(kind), seed=10)
    wrong = recording.with_signals(motor_speed_rad_s=factor * recording["motor_speed_rad_s"])
    found = card(wrong).of("speed")
    assert found is not None and found.severity == "warning" and unit in found.sentence
    assert found.values["ratio"] == pytest.approx(factor, rel=0.02)


@pytest.mark.parametrize("kind", ["chirp", "sine", "step"])
@pytest.mark.parametrize("known", [True, False], ids=["pairs_known", "pairs_unknown"])
def test_swapped_phases(kind, known):
    recording = Sensors(current_noise_A=0.1, encoder_bits=14).record(reference(kind), seed=11)
    pairs = ACTUATOR.motor.pole_pairs if known else None
    right = health(recording, pole_pairs=pairs).of("phase_order")
    assert right is not None and right.severity == "good" and right.values["pole_pairs"] == 2.0
    b, c = recording["phase_b_current_A"], recording["phase_c_current_A"]
    swapped = health(recording.with_signals(phase_b_current_A=c, phase_c_current_A=b), pole_pairs=pairs)
    wrong = swapped.of("phase_order")
    assert wrong is not None and wrong.severity == "warning" and "swap two" in wrong.sentence


def test_phase_sum():
    recording = Sensors(current_noise_A=0.2).record(reference("sine"), seed=12)
    found = card(recording).of("phase_sum")
    assert found is not None and found.severity == "good"  # noise does not cancel
    off = card(recording.with_signals(phase_a_current_A=recording["phase_a_current_A"] + 1.0)).of("phase_sum")
    assert off is not None and off.severity == "warning" and off.values["sum_rms_A"] == pytest.approx(1.06, rel=0.05)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 0.95])
def test_standstill(share):
    time = times(8000)
    found = health(made(motor_position_rad=np.cumsum(np.where(time < share * time[-1], 0.0, 1.0)))).of("standstill")
    assert found is not None and found.values["share"] == pytest.approx(share, abs=0.02)
    assert found.severity == ("good" if share < 0.5 else "note" if share < 0.9 else "warning")


def test_a_map_has_no_time_to_check():
    angle = np.linspace(0.0, 6.28, 500)
    found = health(made(motor_position_rad=angle, current_A=np.sin(7.0 * angle), side=SideFile(kind="map")))
    assert {finding.check for finding in found.findings} <= {"quantisation", "constant", "saturation"}


# --- the equivalent current ------------------------------------------------------------------------------------------


def test_equivalent_current_from_the_phases():
    recording = reference("sine")
    signals = {name: values for name, values in recording.signals.items() if name != "current_A"}
    bare = Measurement(signals)
    assert can_have_current(bare) and not can_have_current(recording)
    assert with_equivalent_current(recording, 2.0) is recording
    again = with_equivalent_current(bare, ACTUATOR.motor.pole_pairs)
    difference = again["current_A"] - recording["current_A"]
    assert np.sqrt(np.mean(difference**2)) < 0.05 * np.std(recording["current_A"])
    assert "made from the phase currents" in again.notes[-1]


@pytest.mark.parametrize("missing", "abc")
def test_the_third_phase_of_a_star_from_two(missing):
    recording = reference("sine")
    left_out = {"current_A", f"phase_{missing}_current_A"}
    two = Measurement({name: values for name, values in recording.signals.items() if name not in left_out})
    found = prepared(two, ACTUATOR)
    assert found.reading.remarks[0].startswith(f"phase_{missing}_current_A is made of the other two phases' currents")
    difference = found["current_A"] - recording["current_A"]
    assert np.sqrt(np.mean(difference**2)) < 0.05 * np.std(recording["current_A"])
    one = Measurement({name: two[name] for name in two if not name.startswith("phase_") or "c" in name[6]})
    assert "current_A" not in prepared(one, ACTUATOR)


def test_the_output_stands_for_the_motor_with_a_word_on_what_lies_between():
    recording = reference("sine")
    names = [name for name in recording if name.startswith(("time", "command", "user", "phase"))]
    output = Measurement({name: recording[name] for name in names})
    assert "current_A" in prepared(output, ACTUATOR)
    for play, effects, named in ((1e-3, {}, "transmission.backlash_rad"), (0.0, {"torsional_compliance": {}}, "tors")):
        actuator = replace(ACTUATOR, effects=effects, transmission=replace(ACTUATOR.transmission, backlash_rad=play))
        warned = prepared(output, actuator).reading.remarks
        assert any(f"the model has {named}" in one and "between motor and user" in one for one in warned), warned
    # A loop has the user's position; of the motor's side it needs no more than the speed.
    speeds = Measurement({"time_s": output.time_s, "user_position_rad": output["user_position_rad"],
                          "user_speed_rad_s": np.gradient(output["user_position_rad"], output.time_s)})  # fmt: skip
    rigid = replace(ACTUATOR, transmission=replace(ACTUATOR.transmission, backlash_rad=0.0))
    found = prepared(speeds, rigid)
    assert "motor_speed_rad_s" in found and "motor_position_rad" not in found
    assert "motor_speed_rad_s" not in prepared(speeds, actuator)
