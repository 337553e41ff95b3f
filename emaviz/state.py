"""What the page is set to.  Values are checked here, since a browser may send anything."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.commands import COMMANDS, command
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.identification.objective import FITNESSES
from ema_model.identification.optimisers import OPTIMISERS
from ema_model.simulation import Run

MONITORS = ("healthy", "same faults", "identified")
LONGEST_S = 5.0


@dataclass
class Settings:
    """Everything that the controls set; only the setters below change it."""

    k: NDArray[np.float64] = field(default_factory=lambda: HEALTHY.copy())
    command: str = "chirp"
    command_settings: dict[str, dict[str, Any]] = field(default_factory=lambda: {name: {} for name in COMMANDS})
    duration_s: float = 0.5
    load_torque_Nm: float = 0.0
    monitor: str = "healthy"
    algorithm: str = "hba"
    population: int = 50
    iterations: int = 150
    fitness: str = "filtered"
    seed: int = 0

    def set_fault(self, index: int, value: Any) -> float:
        """One k, kept in [0, 1]; returns what was set."""
        self.k = self.k.copy()
        self.k[index] = min(max(number(value, f"k{index + 1}"), 0.0), 1.0)
        return float(self.k[index])

    def set_command(self, name: Any) -> None:
        """The command's family."""
        self.command = _one_of(name, tuple(COMMANDS), "command")

    def set_command_setting(self, name: str, setting: str, value: Any) -> None:
        """One setting of a command; InputError leaves the old one."""
        tried = {**self.command_settings[name], setting: value}
        command(name, tried)
        self.command_settings[name] = tried

    def set_duration(self, value: Any) -> None:
        """Length of the run, s."""
        duration = number(value, "duration")
        if not 0.01 <= duration <= LONGEST_S:
            raise InputError(f"the duration must lie between 0.01 and {LONGEST_S:g} s here, not {duration:g}")
        self.duration_s = duration

    def set_load(self, value: Any) -> None:
        """Load on the user shaft, N·m."""
        load = number(value, "load torque")
        if abs(load) > 1000.0:
            raise InputError(f"the load torque must lie between −1000 and 1000 N·m, not {load:g}")
        self.load_torque_Nm = load

    def set_monitor(self, value: Any) -> None:
        """Whose faults the monitor model is drawn with."""
        self.monitor = _one_of(value, MONITORS, "monitor model")

    def set_algorithm(self, value: Any) -> None:
        """The optimiser."""
        self.algorithm = _one_of(value, tuple(OPTIMISERS), "algorithm")

    def set_fitness(self, value: Any) -> None:
        """Filtered or raw."""
        self.fitness = _one_of(value, FITNESSES, "fitness")

    def set_population(self, value: Any) -> None:
        """Individuals."""
        self.population = _whole(value, "population", 4, 1000)

    def set_iterations(self, value: Any) -> None:
        """Iterations."""
        self.iterations = _whole(value, "iterations", 1, 5000)

    def set_seed(self, value: Any) -> None:
        """Seed of the random numbers."""
        self.seed = _whole(value, "seed", 0, 2**31 - 1)

    def run(self) -> Run:
        """The run that the page asks for."""
        return Run(
            command(self.command, self.command_settings[self.command]),
            self.duration_s,
            load_torque_Nm=self.load_torque_Nm,
        )


def number(value: Any, what: str) -> float:
    """A finite number, or InputError."""
    try:
        read = float(value)
    except (TypeError, ValueError):
        read = math.nan
    if not math.isfinite(read):
        raise InputError(f"{what} must be a number, not {str(value)[:40]!r}")
    return read


def _whole(value: Any, what: str, low: int, high: int) -> int:
    read = number(value, what)
    if read != round(read) or not low <= read <= high:
        raise InputError(f"{what} must be a whole number from {low} to {high}, not {read:g}")
    return int(read)


def _one_of(value: Any, choices: tuple[str, ...], what: str) -> str:
    if value not in choices:
        raise InputError(f"{what} must be one of {', '.join(choices)}, not {str(value)[:40]!r}")
    return str(value)
