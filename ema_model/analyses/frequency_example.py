"""A recording to try the frequency response on: a sweep over the resonance of a drive train that yields."""

from __future__ import annotations

from ema_model.actuator import Actuator
from ema_model.commands import command
from ema_model.recordings.measurement import Measurement, Sensors
from ema_model.simulation.run import Run, simulate_reference

_DURATION_S = 6.0
_SWEEP = {"start_Hz": 1.0, "end_Hz": 100.0, "end_time_s": _DURATION_S, "amplitude_rad": 0.002}
_SENSORS = Sensors(current_noise_A=0.1)


def sweep(actuator: Actuator) -> Measurement:
    """Of an actuator whose transmission is elastic, as its model is not."""
    true = simulate_reference(
        Run(command("chirp", _SWEEP), _DURATION_S), actuator, effects={"torsional_compliance": {}}
    )
    return _SENSORS.record(true, seed=0)
