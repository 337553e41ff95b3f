"""Logs in the shape of Rhoban/bam's (bam/xl330/record.py and bam/data.bak/raw at commit af22604)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

SERVO_SIGNALS = ("time_s", "command_rad", "user_position_rad", "motor_speed_rad_s")
_LIMIT = 885  # counts of the PWM's limit


def duty_of(signals: Mapping[str, np.ndarray], kp: int) -> np.ndarray:
    """The servo's law: the duty for a position error, cut off at 1; (n,)."""
    error = signals["command_rad"] - signals["user_position_rad"]
    return np.clip(error * kp * (4096 / (2 * np.pi)) / (256 * _LIMIT), -1.0, 1.0)


def write_servo_log(path: Path, signals: Mapping[str, np.ndarray], kp: int, trajectory: str = "sin_sin") -> None:
    """One JSON object as their recorder dumps it: the duty as its register holds it, −1 count being 65535."""
    duty = signals.get("duty", duty_of(signals, kp))
    samples = duty.size
    columns = {
        "position": signals["user_position_rad"].tolist(),
        "speed": signals["motor_speed_rad_s"].tolist(),
        "load": (np.round(duty * _LIMIT).astype(np.int64) % (1 << 16)).tolist(),
        "input_volts": signals.get("bus_voltage_V", np.full(samples, 7.4)).tolist(),
        "temp": signals.get("temperature_C", np.full(samples, 28)).astype(int).tolist(),
        "timestamp": signals["time_s"].tolist(),
        "goal_position": signals["command_rad"].tolist(),
        "torque_enable": signals.get("drive_enabled", np.ones(samples)).astype(bool).tolist(),
    }
    entries = [dict(zip(columns, row)) for row in zip(*columns.values())]
    head = {"mass": 0.49, "length": 0.1, "kp": kp, "vin": 7.4, "motor": "xl330", "trajectory": trajectory}
    path.write_text(json.dumps({**head, "entries": entries}))
