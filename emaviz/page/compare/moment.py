"""A compared recording on the 3D actuator: as measured, the screw glowing where the model fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ema_model.actuator import Actuator
from ema_model.comparison.result import Compared, Comparison
from ema_model.faults import HEALTHY
from ema_model.recordings import Measurement
from emaviz.scene.motion import Motion, motion

_FULL = 4.0  # times its floor, at which a residual glows fully


def motion_of(comparison: Comparison, compared: Compared, actuator: Actuator) -> Motion | None:
    """What was measured of it, and of the model what was not; None without a motor position, as of a static map."""
    signals = {**compared.model, **compared.measured}
    motor = signals.get("motor_position_rad")
    if motor is None or comparison.residuals.is_map or len(compared.time_s) < 2:
        return None
    still = np.zeros_like(motor)
    time_s = compared.time_s
    run = Measurement(
        {
            "time_s": time_s,
            "current_A": signals.get("current_A", still),
            "motor_position_rad": motor,
            "motor_speed_rad_s": np.gradient(motor, time_s),
            "user_position_rad": signals.get("user_position_rad", actuator.transmission.gear_ratio * motor),
        },
        compared.name,
    )
    shown = motion(run, HEALTHY, actuator)
    name = comparison.primary
    if name not in compared.measured:
        return shown
    error = np.abs(compared.measured[name] - compared.model[name]) / compared.sigma[name]
    glow = np.clip((error - 1.0) / (_FULL - 1.0), 0.0, 1.0)
    return replace(shown, heat=glow, says=f"Screw red where the model fails (full from {_FULL:g} × floor).")
