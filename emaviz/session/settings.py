"""What the page is set to.  Each setting is described once; a browser or a session's file may send anything."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
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
from ema_model.simulation.load_profile import SHAPES, LoadProfile
from ema_model.simulation.plant import FITNESSES
from ema_model.simulation.run import Run
from ema_model.simulation.sensors import Sensors
from emaviz.session.described import checked, number, setting

SLIDERS = ""
MONITORS = ("healthy", "same faults", "identified")
LONGEST_S = 5.0
_SMALL = {"step": {"final_rad": 0.005}, "ramp": {"slope_rad_s": 0.02}}  # as far as the current does not saturate


def _faults(value: Any, _: Axes) -> NDArray[np.float64]:
    """(8,), each kept in [0, 1]."""
    if not isinstance(value, (list, tuple, np.ndarray)) or len(value) != len(HEALTHY):
        raise InputError(f"k must be a list of {len(HEALTHY)} numbers, not {quoted(value, 40)!r}")
    return np.clip([number(one, f"k{i + 1}") for i, one in enumerate(value)], 0.0, 1.0)


def _command_settings(value: Any, _: Axes) -> dict[str, dict[str, Any]]:
    given = {name: dict(settings) for name, settings in _of_names(value, "the commands' settings").items()}
    for name, settings in given.items():
        command(name, settings)
    return {name: {} for name in COMMANDS} | given


def _effects(value: Any, axes: Axes) -> dict[str, dict[str, float]]:
    made = {}
    for name, settings in _of_names(value, "the hidden effects").items():
        effect = find(name, axes)
        made[effect.name] = effect.settings({one: number(x, one) for one, x in settings.items()})
    return made


def _of_names(value: Any, what: str) -> dict[str, dict[str, Any]]:
    if not isinstance(value, dict) or not all(isinstance(one, dict) for one in value.values()):
        raise InputError(f"{what} must be given by name, not {quoted(value, 40)!r}")
    return value


def _algorithms(value: Any, _: Axes) -> tuple[str, ...]:
    """In the order of `ALGORITHMS`; one at least."""
    if not isinstance(value, (list, tuple)):
        raise InputError(f"algorithms must be a list, not {quoted(value, 40)!r}")
    for one in value:
        if one not in tuple(ALGORITHMS):
            raise InputError(f"algorithm must be one of {', '.join(ALGORITHMS)}, not {quoted(one, 40)!r}")
    if not value:
        raise InputError("no algorithm is chosen; tick one at least")
    return tuple(name for name in ALGORITHMS if name in value)


class Settings(msgspec.Struct, eq=False):
    """Everything that the controls set; only `set`, and what goes through it, changes it."""

    axes: Axes = ROTARY  # of the actuator, which are not saved
    k: Annotated[NDArray[np.float64], setting("k", made=_faults)] = msgspec.field(default_factory=HEALTHY.copy)
    command: Annotated[str, setting("command", one_of=COMMANDS)] = "chirp"
    command_settings: Annotated[dict[str, dict[str, Any]], setting("commands", made=_command_settings)] = msgspec.field(
        default_factory=lambda: {name: dict(_SMALL.get(name, {})) for name in COMMANDS}
    )
    duration_s: Annotated[float, setting("the duration", 0.01, LONGEST_S, unit="s")] = 0.5
    load_torque_Nm: Annotated[float, setting("the load", -1000.0, 1000.0, unit="N·m", side=USER)] = 0.0
    load_shape: Annotated[str, setting("the load's shape", one_of=SHAPES)] = "constant"
    load_time_s: Annotated[float, setting("the load's time", 0.001, LONGEST_S, unit="s")] = 0.1
    load_frequency_Hz: Annotated[float, setting("the load's frequency", 0.1, 200.0, unit="Hz")] = 5.0
    current_noise_A: Annotated[float, setting("the current noise", 0.0, 999.0, unit="A rms")] = 0.0
    encoder_bits: Annotated[int, setting("the encoder's bits", 0, 32)] = 0  # per motor turn; 0 is a perfect one
    # Of the user, from where the command starts, for both models.
    start_offset_rad: Annotated[float, setting("the start angle", -0.5, 0.5, unit="rad", side=USER)] = 0.0
    # Of the plant's motor; the monitor starts at rest.
    start_speed_rad_s: Annotated[float, setting("the start speed", -1e3, 1e3, unit="rad/s", side=MOTOR)] = 0.0
    start_side: Annotated[float, setting("the side of the play", -1.0, 1.0)] = 0.0  # where in it the plant starts
    effects: Annotated[dict[str, dict[str, float]], setting("effects", made=_effects)] = msgspec.field(
        default_factory=dict
    )  # hidden in the plant
    monitor: Annotated[str, setting("monitor model", one_of=MONITORS)] = "healthy"  # whose faults it is drawn with
    # What is identified: the plant that the sliders make, or a file of the data folder.
    source: Annotated[str, setting("what to identify")] = SLIDERS
    algorithms: Annotated[tuple[str, ...], setting("algorithms", made=_algorithms)] = ("robust",)  # that search at once
    population: Annotated[int, setting("population", 4, 1000)] = 50
    iterations: Annotated[int, setting("iterations", 1, 5000)] = 150
    fitness: Annotated[str, setting("fitness", one_of=FITNESSES)] = "filtered"
    seed: Annotated[int, setting("seed", 0, 2**31 - 1)] = 0

    def set(self, name: str, value: Any) -> Any:
        """One setting; returns what it is now.  InputError, one line, leaves the old one."""
        made = checked(Settings, name, value, self.axes)
        setattr(self, name, made)
        return made

    def set_fault(self, index: int, value: Any) -> float:
        """One k, kept in [0, 1]; returns what was set."""
        return float(self.set("k", [value if i == index else x for i, x in enumerate(self.k)])[index])

    def set_command_setting(self, name: str, one: str, value: Any) -> None:
        """One setting of a command; InputError leaves the old one."""
        self.set("command_settings", {**self.command_settings, name: {**self.command_settings[name], one: value}})

    def set_effect(self, name: Any, parameter: str | None = None, value: Any = None) -> None:
        """Hides an effect in the plant, or changes one of its parameters; InputError leaves the old one."""
        effect = find(str(name), self.axes)
        changed = {} if parameter is None else {parameter: value}
        self.set("effects", {**self.effects, effect.name: {**self.effects.get(effect.name, {}), **changed}})

    def remove_effect(self, name: str) -> None:
        """Takes an effect out of the plant again."""
        self.set("effects", {key: value for key, value in self.effects.items() if key != name})

    def saved(self) -> dict[str, Any]:
        """Everything, in what JSON can hold."""
        held = msgspec.to_builtins(self, enc_hook=lambda array: array.tolist())
        return {name: held[name] for name in _NAMES}

    def restore(self, saved: Any) -> None:
        """Takes what `saved` gave; InputError, and nothing is changed, if anything in it makes no sense."""
        if not isinstance(saved, dict):
            raise InputError("the session's settings are damaged; save it anew")
        new = Settings(axes=self.axes)
        for name in _NAMES:
            if name in saved:
                new.set(name, saved[name])
        for name in _NAMES:
            setattr(self, name, getattr(new, name))

    @property
    def sensors(self) -> Sensors:
        """Of the plant; the loop does not see their errors."""
        return Sensors(self.current_noise_A, self.encoder_bits)

    def run(self) -> Run:
        """The run that the page asks for."""
        return Run(
            command(self.command, self.command_settings[self.command]),
            self.duration_s,
            load_torque_Nm=self.load_torque_Nm,
            load=LoadProfile(self.load_shape, self.load_time_s, self.load_frequency_Hz),
        )

    def start_rad(self) -> float:
        """The user's angle at the start, rad."""
        return float(self.run().command.at(np.zeros(1))[0]) + self.start_offset_rad

    def start_play_rad(self, actuator: Actuator) -> float:
        """Where the plant starts in its play, rad at the motor."""
        transmission = actuator.transmission
        width = float(physical(self.k).backlash_factor) * transmission.backlash_rad
        return 0.5 * self.start_side * width / transmission.gear_ratio


_NAMES = tuple(name for name in Settings.__struct_fields__ if name != "axes")
