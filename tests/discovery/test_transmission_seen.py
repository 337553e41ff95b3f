"""What only the two positions together show, and no current: an error of the screw, a shaft that gives."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.discovery.transmission_seen import transmission_seen
from ema_model.discovery.verdict import verdict_of
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


def test_a_shaft_that_gives_goes_with_the_acceleration(healthy):
    (one,) = healthy
    acceleration = np.gradient(np.gradient(one["motor_position_rad"], one.time_s), one.time_s)
    smooth = np.convolve(acceleration, np.hanning(401) / np.hanning(401).sum(), mode="same")
    twisted = one["user_position_rad"] - 8e-5 * smooth / np.std(smooth)
    seen = transmission_seen([one.with_signals(user_position_rad=twisted)], ACTUATOR)
    assert seen is not None and seen.cause == "acceleration" and "twist" in seen.sentence(ACTUATOR)


def test_it_needs_both_positions(healthy):
    (one,) = healthy
    alone = replace(
        one, signals={name: one[name] for name in ("time_s", "command_rad", "current_A", "motor_position_rad")}
    )
    assert transmission_seen([alone], ACTUATOR) is None


def test_nothing_is_adequate_beside_it(monkeypatch):
    monkeypatch.setattr("ema_model.discovery.verdict.within_band", lambda data, found: True)
    monkeypatch.setattr("ema_model.discovery.verdict.lasts", lambda data, found: False)
    found = SimpleNamespace(calibration=SimpleNamespace(converged=True))
    named: Any = object()
    story: Any = SimpleNamespace(
        repeatable=True, data=None, current=found, base=found, added=(), transmission_seen=None
    )
    assert verdict_of(story, [], None) == "adequate" and verdict_of(story, [named], None) == "effects_found"
    story.transmission_seen = object()
    assert verdict_of(story, [], None) == "unknown_effect" and verdict_of(story, [named], None) == "partly_explained"


def test_the_headline_says_what_is_explained_and_what_is_not():
    found: Any = SimpleNamespace(
        verdict="unknown_effect", at_floor=True, transmission_seen=object(), controller_seen=None
    )
    found.faults, found.parameters_outside_tolerance, found.effects, found.unknown = {}, [], [], None
    assert headline(found) == "Motion and current are explained; the user's position beyond the motor's is not."
