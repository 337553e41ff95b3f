"""A recording as a logger with a buffer for each channel writes it: the motor's speed with a clock of its own, late."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ema_model.recordings import Measurement

_PERIOD_S = 1e-3


def write_two_clocks(path: Path, measurement: Measurement, delay_s: float) -> None:
    """Each channel beside its own time; the speed every millisecond, its time so much later than it was."""
    time, position = measurement.time_s, measurement["motor_position_rad"]
    true = np.arange(time[0] + _PERIOD_S, time[-1] - _PERIOD_S, _PERIOD_S)
    ends = (np.interp(true + half, time, position) for half in (-0.5 * _PERIOD_S, 0.5 * _PERIOD_S))
    channels = {name: (time, measurement[name]) for name in ("command_rad", "motor_position_rad", "current_A")}
    channels["motor_speed_rad_s"] = true + delay_s, np.subtract(*ends) / -_PERIOD_S
    columns = [[f"{value:.9g}" for value in values] for both in channels.values() for values in both]
    rows = [";".join(column[i] if i < len(column) else "" for column in columns) for i in range(time.size)]
    path.write_text("\n".join([";".join(f"time_s;{name}" for name in channels), *rows]), encoding="utf-8")
