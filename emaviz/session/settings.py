"""What the page is set to.  Values are checked here, since a browser may send anything."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.commands import COMMANDS, command
from ema_model.effects import find
from ema_model.errors import InputError, quoted
from ema_model.faults import HEALTHY, physical
from ema_model.identification.run import ALGORITHMS
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.sides import MOTOR, USER
from ema_model.simulation.plant import FITNESSES
from ema_model.simulation.run import Run
from ema_model.simulation.sensors import Sensors

SLIDERS = ""
MONITORS = ("healthy", "same faults", "identified")
LONGEST_S = 5.0
_LARGEST_OFFSET_RAD = 0.5
_FASTEST_START_RAD_S = 1000.0
# Saved as they are.
_PLAIN = (
    "command", "duration_s", "load_torque_Nm", "start_offset_rad", "start_speed_rad_s", "start_side", "monitor",
    "source", "population", "iterations", "fitness", "seed",
)  # fmt: skip


@dataclass
class Settings:
    """Everything that the controls set; only the setters below change it."""

    axes: Axes = ROTARY  # of the actuator, which are not saved
    k: NDArray[np.float64] = field(default_factory=lambda: HEALTHY.copy())
    command: str = "chirp"
    command_settings: dict[str, dict[str, Any]] = field(default_factory=lambda: {name: {} for name in COMMANDS})
    duration_s: float = 0.5
    load_torque_Nm: float = 0.0
    sensors: Sensors = field(default_factory=Sensors)  # of the plant; the loop does not see their errors
    start_offset_rad: float = 0.0  # of the user, from where the command starts
    start_speed_rad_s: float = 0.0  # of the plant's motor; the monitor starts at rest
    start_side: float = 0.0  # where in its play the plant starts, −1 … 1
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # hidden in the plant
    monitor: str = "healthy"
    source: str = SLIDERS  # of what is identified: the plant that the sliders make, or a file of the data folder
    algorithms: tuple[str, ...] = ("robust",)  # that search at once
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
            raise InputError(f"the load must lie between −1000 and 1000 {self.axes.unit('N·m', USER)}, not {load:g}")
        self.load_torque_Nm = load

    def set_noise(self, value: Any) -> None:
        """Noise of the plant's current sensors, A rms."""
        self.sensors = Sensors(number(value, "current noise"), self.sensors.encoder_bits)

    def set_encoder(self, value: Any) -> None:
        """Bits of the plant's encoder per motor turn; 0 is a perfect one."""
        self.sensors = Sensors(self.sensors.current_noise_A, _whole(value, "encoder", 0, 32))

    def set_start_offset(self, value: Any) -> None:
        """Where both models start, rad of the user from the command's start."""
        self.start_offset_rad = _within(value, "start angle", _LARGEST_OFFSET_RAD, self.axes.unit("rad", USER))

    def set_start_speed(self, value: Any) -> None:
        """Motor speed with which the plant starts, rad/s."""
        self.start_speed_rad_s = _within(value, "start speed", _FASTEST_START_RAD_S, self.axes.unit("rad/s", MOTOR))

    def set_start_side(self, value: Any) -> None:
        """Where in its play the plant starts: −1 and 1 are its two sides."""
        self.start_side = _within(value, "side of the play", 1.0, "")

    def set_effect(self, name: Any, parameter: str | None = None, value: Any = None) -> None:
        """Hides an effect in the plant, or changes one of its parameters; InputError leaves the old one."""
        effect = find(str(name), self.axes)
        tried = dict(self.effects.get(effect.name) or effect.settings({}))
        if parameter is not None:
            tried[parameter] = number(value, parameter)
        self.effects = {**self.effects, effect.name: effect.settings(tried)}

    def remove_effect(self, name: str) -> None:
        """Takes an effect out of the plant again."""
        self.effects = {key: value for key, value in self.effects.items() if key != name}

    def set_monitor(self, value: Any) -> None:
        """Whose faults the monitor model is drawn with."""
        self.monitor = _one_of(value, MONITORS, "monitor model")

    def set_source(self, value: Any) -> None:
        """What is identified: `SLIDERS`, or the name of a file in the data folder."""
        if not isinstance(value, str):
            raise InputError(f"what to identify must be the name of a file, not {quoted(value, 40)!r}")
        self.source = value

    def set_algorithm(self, value: Any) -> None:
        """One optimiser alone."""
        self.algorithms = (_one_of(value, tuple(ALGORITHMS), "algorithm"),)

    def set_algorithms(self, values: Any) -> None:
        """The optimisers that search at once, in the order of `ALGORITHMS`; one at least."""
        if not isinstance(values, (list, tuple)):
            raise InputError(f"algorithms must be a list, not {quoted(values, 40)!r}")
        chosen = {_one_of(value, tuple(ALGORITHMS), "algorithm") for value in values}
        if not chosen:
            raise InputError("no algorithm is chosen; tick one at least")
        self.algorithms = tuple(name for name in ALGORITHMS if name in chosen)

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

    def saved(self) -> dict[str, Any]:
        """Everything, in what JSON can hold."""
        plain = {name: getattr(self, name) for name in _PLAIN}
        return plain | {
            "k": self.k.tolist(),
            "command_settings": {name: dict(given) for name, given in self.command_settings.items() if given},
            "current_noise_A": self.sensors.current_noise_A,
            "encoder_bits": self.sensors.encoder_bits,
            "effects": {name: dict(given) for name, given in self.effects.items()},
            "algorithms": list(self.algorithms),
        }

    def restore(self, saved: Any) -> None:
        """Takes what `saved` gave; InputError, and nothing is changed, if anything in it makes no sense."""
        if not isinstance(saved, dict):
            raise InputError("the session's settings are damaged; save it anew")
        new = Settings(axes=self.axes)
        try:
            for index, value in enumerate(saved.get("k", HEALTHY)):
                new.set_fault(index, value)
            for name, given in dict(saved.get("command_settings", {})).items():
                for setting, value in dict(given).items():
                    new.set_command_setting(_one_of(name, tuple(COMMANDS), "command"), setting, value)
            for name, given in dict(saved.get("effects", {})).items():
                for parameter, value in dict(given).items():
                    new.set_effect(name, parameter, value)
            for name, setter in new._setters().items():
                if name in saved:
                    setter(saved[name])
        except (TypeError, ValueError, IndexError, KeyError):
            raise InputError("the session's settings are damaged; save it anew") from None
        vars(self).update(vars(new))

    def _setters(self) -> dict[str, Callable[[Any], None]]:
        """By the name under which a value is saved."""
        return {
            "command": self.set_command,
            "duration_s": self.set_duration,
            "load_torque_Nm": self.set_load,
            "current_noise_A": self.set_noise,
            "encoder_bits": self.set_encoder,
            "start_offset_rad": self.set_start_offset,
            "start_speed_rad_s": self.set_start_speed,
            "start_side": self.set_start_side,
            "monitor": self.set_monitor,
            "source": self.set_source,
            "algorithms": self.set_algorithms,
            "population": self.set_population,
            "iterations": self.set_iterations,
            "fitness": self.set_fitness,
            "seed": self.set_seed,
        }

    def run(self) -> Run:
        """The run that the page asks for."""
        return Run(
            command(self.command, self.command_settings[self.command]),
            self.duration_s,
            load_torque_Nm=self.load_torque_Nm,
        )

    def start_rad(self) -> float:
        """The user's angle at the start, rad."""
        return float(self.run().command.at(np.zeros(1))[0]) + self.start_offset_rad

    def start_play_rad(self, actuator: Actuator) -> float:
        """Where the plant starts in its play, rad at the motor."""
        transmission = actuator.transmission
        width = float(physical(self.k).backlash_factor) * transmission.backlash_rad
        return 0.5 * self.start_side * width / transmission.gear_ratio


def number(value: Any, what: str) -> float:
    """A finite number, or InputError."""
    try:
        read = float(value)
    except (TypeError, ValueError):
        read = math.nan
    if not math.isfinite(read):
        raise InputError(f"{what} must be a number, not {quoted(value, 40)!r}")
    return read


def _whole(value: Any, what: str, low: int, high: int) -> int:
    read = number(value, what)
    if read != round(read) or not low <= read <= high:
        raise InputError(f"{what} must be a whole number from {low} to {high}, not {read:g}")
    return int(read)


def _within(value: Any, what: str, most: float, unit: str) -> float:
    read = number(value, what)
    if abs(read) > most:
        raise InputError(f"{what} must lie between −{most:g} and {most:g} {unit}".rstrip() + f", not {read:g}")
    return read


def _one_of(value: Any, choices: tuple[str, ...], what: str) -> str:
    if value not in choices:
        raise InputError(f"{what} must be one of {', '.join(choices)}, not {quoted(value, 40)!r}")
    return str(value)
