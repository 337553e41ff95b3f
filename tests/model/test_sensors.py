"""What a rig's sensors do to a recording."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()


@pytest.fixture(scope="module")
def true() -> Measurement:
    return simulate_reference(Run(command("chirp"), 0.5), ACTUATOR)


def test_perfect_sensors_change_nothing(true):
    seen = Sensors().record(true, 0)
    assert set(seen) == set(true)
    for name in true:
        np.testing.assert_array_equal(seen[name], true[name])


def test_noise_is_white_of_the_given_size(true):
    seen = Sensors(current_noise_A=0.45).record(true, 3)
    noise = seen["current_A"] - true["current_A"]
    n = len(noise)
    assert np.std(noise) == pytest.approx(0.45, rel=4.0 / np.sqrt(2 * n))
    assert abs(np.mean(noise)) < 4.0 * 0.45 / np.sqrt(n)
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 4.0 / np.sqrt(n)
    phases = [seen[f"phase_{x}_current_A"] - true[f"phase_{x}_current_A"] for x in "abc"]
    for phase in phases:
        assert np.std(phase) == pytest.approx(0.45, rel=0.1)
        assert abs(np.corrcoef(phase, noise)[0, 1]) < 4.0 / np.sqrt(n), "each sensor has a noise of its own"
    for name in ("command_rad", "user_position_rad", "motor_position_rad", "motor_speed_rad_s", "motor_torque_Nm"):
        np.testing.assert_array_equal(seen[name], true[name])


def test_noise_is_reproduced_by_the_seed(true):
    sensors = Sensors(current_noise_A=0.1)
    a, b, c = (sensors.record(true, seed)["current_A"] for seed in (5, 5, 6))
    np.testing.assert_array_equal(a, b)
    assert np.any(a != c)


def test_encoder_rounds_to_its_steps(true):
    seen = Sensors(encoder_bits=12).record(true, 0)
    step = 2.0 * np.pi / 4096
    counts = seen["motor_position_rad"] / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    error = seen["motor_position_rad"] - true["motor_position_rad"]
    assert 0.3 * step < np.max(np.abs(error)) <= 0.5 * step * (1.0 + 1e-9)
    user = seen["user_position_rad"] / 1e-6
    np.testing.assert_allclose(user, np.round(user), atol=1e-6)
    speed = seen["motor_speed_rad_s"]
    np.testing.assert_allclose(speed[1:], np.diff(seen["motor_position_rad"]) / 1e-4)
    assert speed[0] == true["motor_speed_rad_s"][0] and np.all(np.isfinite(speed))
    np.testing.assert_array_equal(seen["current_A"], true["current_A"])


def test_recording_leaves_the_measurement_alone(true):
    before = {name: true[name].copy() for name in true}
    Sensors(0.5, 8).record(true, 1)
    for name, values in before.items():
        np.testing.assert_array_equal(true[name], values)


@pytest.mark.parametrize(
    "settings",
    [{"current_noise_A": v} for v in (-0.1, np.nan, np.inf, 1e3)] + [{"encoder_bits": v} for v in (-1, 33, 64)],
)
def test_impossible_sensors_are_refused(settings):
    with pytest.raises(InputError, match="must") as error:
        Sensors(**settings)
    assert "\n" not in str(error.value)


def test_encoder_of_a_recording_without_a_motor_angle(true):
    partial = Measurement({name: true[name] for name in ("time_s", "command_rad", "current_A", "user_position_rad")})
    seen = Sensors(encoder_bits=12).record(partial, 0)
    np.testing.assert_allclose(seen["user_position_rad"] / 1e-6, np.round(seen["user_position_rad"] / 1e-6), atol=1e-6)
