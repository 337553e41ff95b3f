"""What a flight asks of the actuator: a command and a load, the harder the more it wears."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ema_model.commands import command
from ema_model.lives.life import Life
from ema_model.simulation.run import Run
from ema_model.simulation.sensors import Sensors

SENSORS = Sensors(current_noise_A=0.45, encoder_bits=12)
_LOADS_Nm = (0.0, 8.0, 20.0)  # of the gentle, the usual and the hard flights
_HARD = (0.6, 1.3)  # severities between them


@dataclass(frozen=True)
class Profile:
    """A command with its settings, and a recorded load."""

    command: str
    settings: dict[str, Any]
    load_torque_Nm: float

    @property
    def run(self) -> Run:
        """As it is simulated, 0.5 s at 10 kHz."""
        return Run(command(self.command, self.settings), load_torque_Nm=self.load_torque_Nm)


_COMMANDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("chirp", {}),
    ("multisine", {"amplitude_rad": 8e-3, "frequencies_Hz": (2.0, 6.0, 14.0)}),
    ("sine", {"amplitude_rad": 6e-3, "frequency_Hz": 9.0}),
)
PROFILES = tuple(Profile(name, settings, load) for load in _LOADS_Nm for name, settings in _COMMANDS)


def profiles_of(life: Life) -> np.ndarray:
    """Of each flight, which of PROFILES: the load follows its severity, the command is any."""
    random = np.random.default_rng([life.seed, 42])
    load = np.searchsorted(_HARD, life.severity)
    return load * len(_COMMANDS) + random.integers(len(_COMMANDS), size=life.flights)
