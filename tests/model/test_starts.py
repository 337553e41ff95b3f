"""Where a part of a recording that begins in mid-motion starts, by whatever tells it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.models import ClosedLoop
from ema_model.recordings import Measurement

SERVO = load_actuator(Path(__file__).parents[2] / "assets" / "actuators" / "xl330.toml")
STEP = 2.0 * np.pi / 4096.0  # of an encoder at the output


@pytest.mark.parametrize("rate", [100.0, 500.0, 2000.0])
@pytest.mark.parametrize("has_motor", [False, True])
def test_the_speed_is_that_of_the_position(rate, has_motor):
    """A servo's output encoder is coarse: its speed is that of 10 ms on either side, however fast it is logged."""
    time = np.arange(0.0, 4.0, 1.0 / rate)
    true = 0.6 * np.sin(2.0 * np.pi * 0.5 * time)
    speed = 0.6 * 2.0 * np.pi * 0.5 * np.cos(2.0 * np.pi * 0.5 * time)
    tau = SERVO.transmission.gear_ratio
    signals = {"time_s": time, "command_rad": true, "user_position_rad": np.round(true / STEP) * STEP}
    if has_motor:
        signals["motor_position_rad"] = true / tau
    first = time.size // 5
    plant = ClosedLoop([Measurement(signals)], SERVO, stretches=[[slice(0, first), slice(first, time.size)]])
    begins, later = (window.speed_rad_s * tau for window in plant.windows)
    assert begins == 0.0, "a recording begins at rest"
    assert later == pytest.approx(speed[first], abs=0.05)
