"""One run in open loop: a recorded current, torque or force in, the motion out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.models.closed_loop import ClosedLoop
from ema_model.recordings import Measurement

Array = NDArray[np.float64]

_MOTION = ("motor_speed_rad_s", "motor_position_rad", "user_position_rad")


def simulate_open_loop(
    recorded: Measurement,
    actuator: Actuator,
    k: ArrayLike | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
) -> Measurement:
    """The motion that a recording's current, or else its motor torque, brings about; names are those inside.

    Each run of the recording starts from its first sample: at the motor's and the user's position where they were
    recorded, else at zero, and at rest.  What was put in, the load and the run's number stand beside the motion, on
    the recording's time, or an even grid of its own period.  Faults are of k; a recording without a current raises
    InputError, FloatingPointError one with which the model diverges.
    """
    if not any(name in recorded for name in _MOTION):
        recorded = recorded.with_signals(user_position_rad=np.zeros(recorded.samples))
    model = ClosedLoop([recorded], actuator.in_open_loop(), effects=effects, block_s=0.0)
    source = model.measurements[0]
    parts: list[dict[str, Array]] = []
    for place, window in enumerate(model.windows):
        shown = model.signals(place, k=k)
        begins = window.first
        start = window.user_rad / actuator.transmission.gear_ratio
        first = dict(zip(_MOTION, (window.speed_rad_s, start, window.user_rad)))
        first["user_position_rad"] += window.play_rad * actuator.transmission.gear_ratio
        kept = ("time_s", window.input, "load_torque_Nm", "segment")
        rows = slice(begins, begins + window.blocks + 1)
        part = {name: source[name][rows] for name in kept if name in source}
        part |= {name: np.concatenate([[first[name]], shown[name][0]]) for name in _MOTION}
        parts.append(part)
    signals = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    for name in _MOTION:
        if not np.all(np.isfinite(signals[name])):
            at = signals["time_s"][int(np.argmin(np.isfinite(signals[name])))]
            raise FloatingPointError(f"the model diverged from {at:g} s on; check the settings")
    return replace(Measurement(signals), name="open loop")
