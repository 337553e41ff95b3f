"""What only the two positions together show, and no current: an error of the screw, a shaft that gives."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.discovery.discover import verdict_of
from ema_model.discovery.transmission import TransmissionSeen, transmission_seen
from ema_model.discovery.words import headline

MOTION = ("multisine", {"amplitude_rad": 0.012, "frequencies_Hz": (2, 5, 9)}, 0.6)
NOISE = 2e-6  # rad of the user, rms


def noisy(one, seed: int = 5):
    """With an encoder of the user that is good enough to see it."""
    random = np.random.default_rng(seed)
    return one.with_signals(
        user_position_rad=one["user_position_rad"] + NOISE * random.standard_normal(one["user_position_rad"].size)
    )


@pytest.fixture(scope="module")
def healthy():
    return [noisy(one) for one in recorded(11, commands=[MOTION])]


def test_a_healthy_gear_with_its_play_shows_nothing(healthy):
    assert ACTUATOR.transmission.backlash_rad > 0.0
    assert transmission_seen(healthy, ACTUATOR) is None


def test_a_zero_and_a_delay_are_no_error_of_the_transmission(healthy):
    (one,) = healthy
    late = np.interp(one.time_s - 1e-3, one.time_s, one["user_position_rad"]) + 0.3
    assert transmission_seen([one.with_signals(user_position_rad=late)], ACTUATOR) is None


def test_an_error_that_repeats_is_told_with_its_period_and_amplitude(healthy):
    (one,) = healthy
    error = 4e-5 * np.sin(3.0 * one["motor_position_rad"] + 0.4)
    seen = transmission_seen([one.with_signals(user_position_rad=one["user_position_rad"] + error)], ACTUATOR)
    assert seen is not None and seen.cause == "position" and seen.error > 5.0 * seen.noise
    assert seen.period == pytest.approx(2.0 * np.pi / 3.0) and seen.amplitude == pytest.approx(4e-5, rel=0.1)
    assert "repeats every 2.09 rad of the motor" in seen.sentence(ACTUATOR)


@pytest.mark.parametrize("swings_at", [40.0, 90.0])  # Hz
def test_a_shaft_that_gives_is_told_by_the_frequency_of_the_user_on_it(healthy, swings_at):
    """J_u α_user = K (τ θ_motor − θ_user), by its transfer function."""
    (one,) = healthy
    motor, user = one["motor_position_rad"], one["user_position_rad"]
    rate = 2.0 * np.pi * np.fft.rfftfreq(4 * motor.size, one.sample_period_s)
    there_and_back = np.concatenate([motor, motor[::-1], motor, motor[::-1]])
    own = 2.0 * np.pi * swings_at
    gain = np.where(rate < 0.5 * own, own**2 / np.maximum(own**2 - rate**2, 1.0), 1.0)
    twist = np.fft.irfft((gain - 1.0) * np.fft.rfft(there_and_back))[2 * motor.size : 3 * motor.size]
    twisted = one.with_signals(user_position_rad=user + ACTUATOR.transmission.gear_ratio * twist)
    seen = transmission_seen([twisted], ACTUATOR)
    assert seen is not None and seen.cause == "acceleration" and "torsional compliance" in seen.sentence(ACTUATOR)
    assert seen.frequency_Hz == pytest.approx(swings_at, rel=0.06)
    assert seen.short == "the user's position leaves the motor's as by the twist of a shaft"


def test_a_user_that_runs_ahead_of_its_acceleration_is_no_shaft(healthy):
    (one,) = healthy
    acceleration = np.gradient(np.gradient(one["motor_position_rad"], one.time_s), one.time_s)
    smooth = np.convolve(acceleration, np.hanning(401) / np.hanning(401).sum(), mode="same")
    ahead = one["user_position_rad"] + 8e-5 * smooth / np.std(smooth)
    seen = transmission_seen([one.with_signals(user_position_rad=ahead)], ACTUATOR)
    assert seen is not None and seen.cause == "bandwidth" and seen.frequency_Hz is None
    assert "two sensors that differ in bandwidth" in seen.sentence(ACTUATOR)


def test_it_needs_both_positions(healthy):
    (one,) = healthy
    alone = replace(
        one, signals={name: one[name] for name in ("time_s", "command_rad", "current_A", "motor_position_rad")}
    )
    assert transmission_seen([alone], ACTUATOR) is None


def test_nothing_is_adequate_beside_it(monkeypatch):
    verdicts = sys.modules[verdict_of.__module__]
    monkeypatch.setattr(verdicts, "explains_all", lambda story: True)
    monkeypatch.setattr(verdicts, "lasts", lambda data, found: False)
    monkeypatch.setattr(verdicts, "silence", lambda *_: "")
    found = SimpleNamespace(calibration=SimpleNamespace(converged=True))
    named: Any = object()
    story: Any = SimpleNamespace(
        repeatable=True, data=None, current=found, base=found, added=(), transmission_seen=None
    )
    assert verdict_of(story, [], None) == "adequate" and verdict_of(story, [named], None) == "effects_found"
    story.transmission_seen = object()
    assert verdict_of(story, [], None) == "unknown_effect" and verdict_of(story, [named], None) == "partly_explained"


@pytest.mark.parametrize(
    ("seen", "at_floor", "said"),
    [
        (
            TransmissionSeen(1e-4, 1e-5, "direction"),
            True,
            "Motion and current are explained; the user's position leaves the motor's as by play.",
        ),
        (
            TransmissionSeen(1e-4, 1e-5, "acceleration", frequency_Hz=32.0),
            True,
            "Motion and current are explained; the user's position leaves the motor's as by the twist of a shaft.",
        ),
        (
            TransmissionSeen(1e-4, 1e-5, "acceleration", frequency_Hz=32.0),
            False,
            "Something is missing that none of the known effects explains: 1.35 times the floor remains, "
            "cause unknown; and the user's position leaves the motor's as by the twist of a shaft.",
        ),
    ],
)
def test_the_headline_says_what_is_explained_and_what_is_not(seen, at_floor, said):
    found: Any = SimpleNamespace(verdict="unknown_effect", at_floor=at_floor, transmission_seen=seen)
    found.faults, found.parameters_outside_tolerance, found.effects, found.unknown = {}, [], [], None
    found.controller_seen, found.curve, found.ladder = None, None, [SimpleNamespace(rmse=1.352, holdout_rmse=None)]
    found.not_claimed, found.loop_lag, found.two_masses_seen = {}, None, None
    assert headline(found) == said
