"""Commands: their shapes, their settings, and what they refuse."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ema_model.commands import COMMANDS, Command, Recorded, command
from ema_model.commands.command import between, jumps
from ema_model.errors import InputError

T = np.linspace(0.0, 1.0, 100_001)
each_command = pytest.mark.parametrize("name", COMMANDS)


def test_the_thesis_commands_come_first():
    assert list(COMMANDS)[:4] == ["step", "ramp", "sine", "chirp"]
    assert "recorded" not in COMMANDS
    assert all(issubclass(cls, Command) and cls.title for cls in COMMANDS.values())


@each_command
def test_defaults_are_finite_and_vectorised(name):
    demand = command(name).at(T)
    assert demand.shape == T.shape and np.all(np.isfinite(demand)) and np.ptp(demand) > 0.0
    np.testing.assert_array_equal(command(name).at(T[5:9]), demand[5:9])


@each_command
def test_settings_round_trip(name):
    settings = command(name).settings()
    assert command(name, settings) == command(name)
    text = {k: "+".join(map(str, v)) if isinstance(v, tuple) else str(v) for k, v in settings.items()}
    assert command(name, text) == command(name)


@each_command
def test_every_setting_changes_the_command(name):
    for setting, value in command(name).settings().items():
        other = (3.0, 7.0) if isinstance(value, tuple) else 0.5 * value + 0.003
        changed = command(name, {setting: other})
        assert np.max(np.abs(changed.at(T) - command(name).at(T))) > 0.0, setting


def test_step():
    step = command("step", {"initial_rad": 0.2, "final_rad": -0.3, "time_s": 0.25})
    np.testing.assert_array_equal(step.at(np.array([0.0, 0.2499, 0.25, 0.9])), [0.2, 0.2, -0.3, -0.3])
    default = command("step").at(np.arange(5) * 0.005)
    np.testing.assert_array_equal(default, [0.0, 0.0, 1.0, 1.0, 1.0])
    # a time that rounding puts just before the step still belongs to it
    assert command("step", {"time_s": 0.3}).at(np.array([0.1 + 0.2 - 1e-13]))[0] == 1.0


def test_ramp():
    ramp = command("ramp", {"slope_rad_s": 2.0, "initial_rad": 1.0, "time_s": 0.5})
    np.testing.assert_allclose(ramp.at(np.array([0.0, 0.5, 0.75])), [1.0, 1.0, 1.5])
    assert command("ramp").at(np.array([1.0]))[0] == pytest.approx(1e-3)


def test_sine():
    sine = command("sine", {"bias_rad": 0.1})
    np.testing.assert_allclose(sine.at(T), 0.1 + 5e-3 * np.sin(2.0 * np.pi * 15.0 * T))


def test_chirp_is_the_thesis_phase_then_holds_its_frequency():
    chirp = command("chirp")
    early = T <= 0.5
    np.testing.assert_allclose(chirp.at(T[early]), 5e-3 * np.sin(2.0 * np.pi * 0.5 * 30.0 * T[early] ** 2), atol=1e-15)
    # after the end time a sine of 15 Hz, without a jump of value or slope
    late = chirp.at(T[~early])
    np.testing.assert_allclose(late[6667:], late[:-6667], atol=5e-3 * 2.0 * np.pi * 15.0 * 4e-6)
    slope = np.gradient(chirp.at(T), T)
    assert np.max(np.abs(np.diff(slope))) < 5e-3 * (2.0 * np.pi * 15.0) ** 2 * 1e-5 * 1.1
    down = command("chirp", {"start_Hz": 15.0, "end_Hz": 0.0})
    rate = np.abs(np.gradient(down.at(T), T))
    assert np.max(rate[T < 0.05]) > 0.4 and np.max(rate[T > 0.55]) < 1e-9


@given(st.lists(st.floats(0.1, 100.0), min_size=1, max_size=6), st.floats(1e-4, 1.0))
def test_multisine_starts_at_zero_and_stays_in_bounds(frequencies, amplitude):
    wave = command("multisine", {"frequencies_Hz": frequencies, "amplitude_rad": amplitude}).at(T[::50])
    assert abs(wave[0]) < 1e-12
    assert np.max(np.abs(wave)) <= 2.0 * amplitude * (1.0 + 1e-12)


def test_multisine_holds_its_frequencies():
    t = np.arange(10_000) / 10_000.0
    spectrum = np.abs(np.fft.rfft(command("multisine", {"frequencies_Hz": "2+6+14"}).at(t))) / 5_000.0
    peaks = {i for i in range(1, len(spectrum)) if spectrum[i] > 1e-6}
    assert peaks == {2, 6, 14}
    np.testing.assert_allclose(spectrum[[2, 6, 14]], 5e-3 / 3.0, rtol=1e-9)


def test_staircase_dwells():
    stairs = command("staircase", {"step_rad": 0.1, "dwell_s": 0.2})
    np.testing.assert_allclose(stairs.at(np.array([0.0, 0.19, 0.2, 0.39, 0.6])), [0.0, 0.0, 0.1, 0.1, 0.3])
    # the dwells' edges are not lost to rounding
    np.testing.assert_allclose(stairs.at(np.arange(20) * 0.2), 0.1 * np.arange(20), atol=1e-12)


def test_recorded_is_linear_between_samples_and_constant_outside():
    recorded = Recorded(np.array([5.0, 5.1, 5.2]), np.array([0.0, 1.0, -1.0]), "run.csv")
    np.testing.assert_allclose(
        recorded.at(np.array([-1.0, 0.0, 0.05, 0.1, 0.15, 9.0])), [0, 0, 0.5, 1, 0, -1], atol=1e-12
    )
    assert recorded.settings() == {"file": "run.csv", "samples": 3}


def test_recorded_jump_comes_with_its_sample():
    time = np.arange(0.0, 0.05, 0.01)
    stepped = Recorded(time, np.array([0.0, 0.0, 1.0, 1.0, 1.0]))
    np.testing.assert_allclose(stepped.at(np.array([0.01, 0.0199, 0.02, 0.03])), [0.0, 0.0, 1.0, 1.0])
    fine = np.arange(50_000) * 1e-6  # sums of rounded steps: none of them moves the jump
    np.testing.assert_array_equal(stepped.at(fine) > 0.5, np.arange(50_000) >= 20_000)
    sloping = Recorded(time, np.array([0.0, 0.5, 1.0, 1.5, 2.0]))
    np.testing.assert_allclose(sloping.at(np.array([0.015])), [0.75])


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("square", {}, "no command 'square'"),
        ("recorded", {}, "no command 'recorded'"),
        ("step", {"height_rad": 1.0}, "step has no setting 'height_rad'; it has initial_rad, final_rad, time_s"),
        ("step", {"final_rad": "far"}, "step: final_rad must be a number, not 'far'"),
        ("step", {"final_rad": None}, "must be a number"),
        ("step", {"time_s": -0.1}, "step: time_s must not be negative"),
        ("sine", {"frequency_Hz": -1}, "must not be negative"),
        ("chirp", {"end_time_s": 0}, "end_time_s must be above 0"),
        ("staircase", {"dwell_s": 0}, "dwell_s must be above 0"),
        ("staircase", {"dwell_s": -1}, "dwell_s must be above 0"),
        ("multisine", {"frequencies_Hz": ""}, "numbers joined by"),
        ("multisine", {"frequencies_Hz": "1++3"}, "numbers joined by"),
        ("multisine", {"frequencies_Hz": 3}, "numbers joined by"),
        ("multisine", {"frequencies_Hz": ()}, "one frequency or more"),
        ("multisine", {"frequencies_Hz": "1+nan"}, "between 0 and 10000"),
        ("multisine", {"frequencies_Hz": "0"}, "between 0 and 10000"),
    ],
)
def test_wrong_settings_are_one_line(name, settings, message):
    with pytest.raises(InputError) as error:
        command(name, settings)
    assert message in str(error.value) and "\n" not in str(error.value)


@each_command
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_settings_must_be_finite(name, value):
    for setting, default in command(name).settings().items():
        with pytest.raises(InputError):
            command(name, {setting: (value,) if isinstance(default, tuple) else value})


def test_a_sampled_command_goes_smoothly_between_its_samples_and_keeps_its_corners():
    time, fine = np.arange(501) / 500.0, np.arange(0.0, 1.0, 1e-4)

    def sine(at):
        return 0.03 * np.sin(2.0 * np.pi * 3.0 * at)

    chord = np.max(np.abs(np.interp(fine, time, sine(time)) - sine(fine)))
    assert np.max(np.abs(between(fine, time, sine(time)) - sine(fine))) < 0.05 * chord
    ramp = np.clip(time - 0.2, 0.0, 0.1)
    np.testing.assert_allclose(between(fine, time, ramp), np.clip(fine - 0.2, 0.0, 0.1), atol=1e-12)
    step = between(fine, time, np.where(time > 0.1, 0.005, 0.0))
    assert set(np.unique(step)) == {0.0, 0.005}


def test_a_log_that_begins_in_mid_motion_and_is_late_goes_on_from_before_its_first_sample():
    time = np.arange(501) / 500.0
    late = np.arange(0.0, 0.5, 1e-4) - 7e-4
    moving = between(late, time, 0.03 * np.sin(20.0 * time), moving=True)
    np.testing.assert_allclose(moving, 0.03 * np.sin(20.0 * late), atol=2e-6)
    speeds = np.diff(moving) / 1e-4
    assert np.ptp(speeds[:20]) < 0.01, "it begins as fast as it goes on, which an acceleration feedforward answers to"
    step = between(late, time, np.where(time > 0.0, 0.005, 0.0), moving=True)
    assert step[0] == 0.0 and set(np.unique(step)) == {0.0, 0.005}


@pytest.mark.parametrize("digits", [None, 9])
def test_how_numbers_are_rounded_is_no_jump(digits):
    """Between two places the command stands at numbers that are not round, and so does what is interpolated there."""
    places = np.array([0.0, math.pi / 7, -0.3 / 7, 1.1 / 3])
    move = np.linspace(0.0, 1.0, 60)
    smooth = move**3 * (10.0 - 15.0 * move + 6.0 * move**2)
    command = np.concatenate([np.concatenate([a + (b - a) * smooth, np.full(50, b)]) for a, b in pairwise(places)])
    command = command if digits is None else command.round(digits)
    time = 0.002 * np.arange(len(command))
    fine = between(np.arange(0.0, time[-1], 1e-4), time, command)
    assert not np.any(jumps(command)) and not np.any(jumps(fine))
    stepped = command.copy()
    stepped[100:] += 1e-3
    assert np.flatnonzero(jumps(stepped)).tolist() == [99]
