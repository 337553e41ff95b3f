"""Holds the 3D actuator where it was at one moment of a recording."""

from __future__ import annotations

import numpy as np

from ema_model.comparison.result import Comparison
from ema_model.faults import HEALTHY
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.playback import Playback
from emaviz.session.session import Simulation


def hold(playback: Playback, scene: ActuatorScene, comparison: Comparison, recording: int, time_s: float) -> None:
    """Stops the playing picture, and turns rotor and surface as measured (or, unmeasured, as the model has them)."""
    playback.play(False)
    compared = comparison.recordings[recording]
    at = int(np.argmin(np.abs(compared.time_s - time_s)))
    signals = {**compared.model, **compared.measured}
    motor, user = (signals.get(name) for name in ("motor_position_rad", "user_position_rad"))
    enlarged = 1.0
    if "user_position_rad" in compared.measurement:
        whole = compared.measurement
        enlarged = playback.exaggeration(Simulation(whole, whole, HEALTHY, 0.0))
    scene.pose(0.0 if motor is None else float(motor[at]), 0.0 if user is None else enlarged * float(user[at]))
