"""A load that came on, a sensor that jumped: dated where they happened, and nothing is dated where nothing did."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, plant, recorded
from support.representative import first_of

from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.comparison.regions import _at_once
from ema_model.discovery import discover
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import LoadProfile, Run, simulate_reference

WHEN_S = 0.23
CHIRP = ("chirp", {}, 0.5)


def loaded(seed: int, torque_Nm: float) -> Measurement:
    """A chirp in whose course a load comes on that nobody recorded."""
    run = Run(command("chirp"), 0.5, load_torque_Nm=torque_Nm, load=LoadProfile("step", time_s=WHEN_S))
    shown = Sensors(0.45, 12).record(simulate_reference(run, plant(seed)), seed)
    kept = {name: values for name, values in shown.signals.items() if name != "load_torque_Nm"}
    return replace(shown, signals=kept, name="chirp")


def jumped(seed: int, signal: str, by: float) -> Measurement:
    """A chirp in whose course a sensor's zero moves."""
    [shown] = recorded(seed, commands=[CHIRP])
    moved = np.where(shown.time_s > WHEN_S, shown[signal] + by, shown[signal])
    return replace(shown, signals={**shown.signals, signal: moved}, name="chirp")


@pytest.mark.parametrize("torque_Nm", [40.0, -80.0])
def test_a_load_that_comes_on_is_dated(torque_Nm):
    found = compare([loaded(3, torque_Nm)], ACTUATOR)
    [event] = found.events
    assert event.time_s == pytest.approx(WHEN_S, abs=5e-3) and event.signal == "current_A" and not event.by_direction
    expected = torque_Nm * ACTUATOR.transmission.gear_ratio / ACTUATOR.motor.torque_constant_Nm_A
    assert event.change == pytest.approx(expected, rel=0.2)
    assert not found.adequate and found.sentences[0] == event.sentence
    assert found.to_dict()["events"][0]["time_s"] == event.time_s


@pytest.mark.parametrize(("signal", "by"), [("current_A", 2.0), ("motor_position_rad", 0.05)])
def test_a_sensor_that_jumps_is_dated(signal, by):
    [event] = compare([jumped(4, signal, by)], ACTUATOR).events
    assert event.time_s == pytest.approx(WHEN_S, abs=5e-3) and event.signal == signal
    assert event.change == pytest.approx(by, rel=0.2)


@pytest.mark.parametrize(("gap_s", "seen"), [(0.0, 1.0), (0.095, 0.0)])
def test_what_changed_while_nothing_was_known_was_not_seen_at_once(gap_s, seen):
    """As about a standstill, where an inverse model says nothing: no moment can be named."""
    time = 5e-4 * np.arange(400) + gap_s * (np.arange(400) >= 200)
    assert _at_once(time, 1.0 * (np.arange(400) >= 200), np.ones(400), 199, drives=True) == pytest.approx(seen)


def test_a_zero_that_swings_is_not_dated():
    """A step explains 80 % of one period, and far more than a drift does."""
    [shown] = recorded(4, commands=[CHIRP])
    moved = shown["motor_position_rad"] + 0.05 * np.sin(4.0 * np.pi * (shown.time_s - WHEN_S))
    swinging = replace(shown, signals={**shown.signals, "motor_position_rad": moved}, name="chirp")
    assert not compare([swinging], ACTUATOR).events


@pytest.mark.parametrize(
    "effects",
    [
        {},
        {"cogging_torque": {"amplitude_Nm": 0.02}},
        *first_of(
            [
                {"friction_drift": {"rate_1_s": 0.8}},
                {"hinge_moment": {"stiffness_Nm_rad": 2000.0}},
                {"asymmetric_friction": {"ratio": 0.25}},
                {"one_sided_spring": {"stiffness_Nm_rad": 3000.0}},
            ]
        ),
    ],
    ids=lambda effects: next(iter(effects), "nothing"),
)
def test_what_lasts_is_no_event(effects):
    for commands in ([CHIRP], [("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3}, 1.0)]):
        assert not compare(recorded(83, commands=commands, effects=effects), ACTUATOR).events


@pytest.mark.long
def test_a_load_that_comes_on_is_given_no_effects_name():
    found = discover([loaded(6, 40.0)], ACTUATOR)
    [event] = found.events
    assert event.time_s == pytest.approx(WHEN_S, abs=5e-3)
    assert not found.effects and found.verdict != "adequate"
    assert event.sentence in found.warnings
