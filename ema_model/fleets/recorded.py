"""The recordings of a fleet: the same commands for each unit, as a test bench gives them, and one to hold out.

Each recording starts a little elsewhere in the encoder's step and in the play, so that no two are alike to the last
digit and the chopping's ripple is another in each.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ema_model.actuator import Actuator
from ema_model.commands import command
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_reference
from ema_model.simulation.sensors import Sensors

SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)
_LENGTH_S = 0.4
RUNS = {
    "chirp": Run(command("chirp"), _LENGTH_S),
    "step": Run(command("step", {"final_rad": 0.05}), _LENGTH_S),
    "loaded": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 5.0}), _LENGTH_S, load_torque_Nm=20.0),
}
UNSEEN = {
    "unseen": Run(command("multisine", {"amplitude_rad": 8e-3, "frequencies_Hz": (2.0, 6.0, 14.0)}), _LENGTH_S),
}
_KEPT = ("time_s", "command_rad", "user_position_rad", "motor_position_rad", "current_A", "load_torque_Nm")
_START_RAD = 1e-2  # 1 σ, of the motor


def recorded(
    actuator: Actuator, seed: int, unit: int = 0, runs: Iterable[str] = (*RUNS, *UNSEEN)
) -> dict[str, Measurement]:
    """The recordings of one unit by name; FloatingPointError if the model diverges."""
    every = {**RUNS, **UNSEEN}
    transmission = actuator.transmission
    half_play = 0.5 * transmission.backlash_rad / transmission.gear_ratio
    found = {}
    for number, name in enumerate(every):
        random = np.random.default_rng([seed, 52, unit, number])
        start, play = _START_RAD * random.standard_normal(), half_play * random.uniform(-1.0, 1.0)
        if name in runs:
            clean = simulate_reference(
                every[name],
                actuator,
                start_rad=start * transmission.gear_ratio,
                start_play_rad=play,
            )
            one = SENSORS.record(clean, int(random.integers(2**62)))
            found[name] = Measurement({key: one[key] for key in _KEPT if key in one}, name=name)
    return found
