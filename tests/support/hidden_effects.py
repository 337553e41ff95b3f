"""Recordings of a plant that nobody knows exactly: the three-phase Reference Model, base parameters off, with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.estimation import default_free
from ema_model.faults import vector
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
SINE = ("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3}, 1.0)  # several turns of the motor, slowly
Command = tuple[str, Mapping[str, Any], float]


def plant(seed: int, extra: Mapping[str, float] | None = None):
    """The actuator with parameters drawn from their tolerances, and `extra` added to some."""
    random = np.random.default_rng(seed)
    drawn = {
        path: ACTUATOR.value(path) + ACTUATOR.tolerances[path].sigma * random.standard_normal()
        for path in default_free(ACTUATOR)
        if not path.startswith("sensors.")
    }
    for path, more in (extra or {}).items():
        drawn[path] += more
    return ACTUATOR.with_values(drawn)


def recorded(
    seed: int,
    *,
    commands: Sequence[Command] = (SINE,),
    effects: Mapping[str, Mapping[str, float]] | None = None,
    faults: Mapping[str, float] | None = None,
    extra: Mapping[str, float] | None = None,
    load: float = 0.0,
    noise_A: float = 0.45,
    plant_seed: int | None = None,
) -> list[Measurement]:
    """Recordings at 10 kHz of one such plant, 12 bits a motor turn; plant_seed: another than the noise's."""
    actuator, sensors = plant(seed if plant_seed is None else plant_seed, extra), Sensors(noise_A, 12)
    return [
        sensors.record(
            simulate_reference(
                Run(command(name, dict(settings)), seconds, load_torque_Nm=load),
                actuator,
                vector(dict(faults or {})),
                effects,
            ),
            seed + 7 * i,
        )
        for i, (name, settings, seconds) in enumerate(commands)
    ]
