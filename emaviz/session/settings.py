"""What the page is set to, how each setting is described and checked, and the steps back."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from functools import cache
from typing import Annotated, Any, TypeVar, get_type_hints

import msgspec
import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.commands import COMMANDS, command
from ema_model.effects import find
from ema_model.errors import InputError, quoted
from ema_model.faults import HEALTHY, physical
from ema_model.identification.run import ALGORITHMS
from ema_model.quantities import MOTOR, ROTARY, USER, Axes, Side
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import FITNESSES
from ema_model.simulation.run import SHAPES, LoadProfile, Run

# --- settings described where they stand ------------------------------------------------------------------------------
# What a value is called, its unit, and what it may be; checked here alone.

Kind = TypeVar("Kind")


def setting(
    title: str,
    low: float | None = None,
    high: float | None = None,
    *,
    unit: str = "",
    side: Side | None = None,
    one_of: Iterable[str] = (),
    made: Callable[[Any, Axes], Any] | None = None,
) -> msgspec.Meta:
    """For `Annotated[type, setting(…)]` in a Struct.

    title: in a sentence; unit: on a rotary axis; one_of: all that it may be; made(value, axes): what the value becomes,
    where a type and a range do not say it, InputError for a bad one.
    """
    said = {"unit": unit, "side": side, "one_of": tuple(one_of), "made": made}
    return msgspec.Meta(title=title, ge=low, le=high, extra=said)


def checked(kind: type[msgspec.Struct], name: str, value: Any, axes: Axes = ROTARY) -> Any:
    """A value for the setting of that name as its type has it; one line of InputError says why not."""
    of = _types(kind)[name]
    about: msgspec.Meta = of.__metadata__[0]
    said = about.extra or {}
    if said["made"] is not None:
        return said["made"](value, axes)
    if said["one_of"] and value not in said["one_of"]:
        raise InputError(f"{about.title} must be one of {', '.join(said['one_of'])}, not {quoted(value, 40)!r}")
    try:
        read = msgspec.convert(value, of, strict=False)
    except msgspec.ValidationError:
        read = math.nan
    if isinstance(read, float) and not math.isfinite(read):
        raise InputError(f"{about.title} must {_may(of, axes)}, not {_as_given(value)}")
    return read


def title(kind: type[msgspec.Struct], name: str) -> str:
    """What a setting is called in a sentence."""
    return str(_types(kind)[name].__metadata__[0].title)


def limits(kind: type[msgspec.Struct], name: str) -> dict[str, Any]:
    """From and to, as a control's `min` and `max`."""
    about: msgspec.Meta = _types(kind)[name].__metadata__[0]
    return {key: edge for key, edge in (("min", about.ge), ("max", about.le)) if edge is not None}


def taken(kind: type[Kind] | Any, saved: Any, part: str) -> Any:
    """What a session's file holds as its description has it; InputError names the part that makes no sense."""
    try:
        return msgspec.convert(saved, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"the session's {part} is damaged ({quoted(error, 120)}); save it anew") from None


def number(value: Any, what: str) -> float:
    """A finite number, or InputError."""
    try:
        read = float(value)
    except (TypeError, ValueError, OverflowError):
        read = math.nan
    if not math.isfinite(read):
        raise InputError(f"{what} must be a number, not {quoted(value, 40)!r}")
    return read


def _may(of: Any, axes: Axes) -> str:
    about, base = of.__metadata__[0], of.__origin__
    if base is str:
        return "be a text"
    if base is int:
        return f"be a whole number from {about.ge} to {about.le}"
    low, high = (f"{edge:g}".replace("-", "−") for edge in (about.ge, about.le))
    unit = axes.unit(about.extra["unit"], about.extra["side"])
    return f"lie between {low} and {high} {unit}".rstrip()


def _as_given(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | int) and not isinstance(value, bool) else repr(quoted(value, 40))


@cache
def _types(kind: type[msgspec.Struct]) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


# --- what the page is set to.  Each setting is described once; a browser or a session's file may send anything --------

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


# --- what Explore's controls were set to before -----------------------------------------------------------------------
# A step back for each movement of a slider, not each of its values.
# The model that plays the plant is one of them: another one sets the sliders to its own faults.

_KEPT = (
    "k", "command", "command_settings", "duration_s", "load_torque_Nm", "load_shape", "load_time_s",
    "load_frequency_Hz", "current_noise_A", "encoder_bits", "start_offset_rad", "start_speed_rad_s", "start_side",
)  # fmt: skip
_PLANT = "plant"  # of a step
_ONE_MOVEMENT_S = 0.8  # changes of one control that follow each other so soon
_MOST = 100


class Undo:
    """Steps back of some settings, and of the plant's model: plant() is its name, choose(name) goes back to it."""

    def __init__(
        self,
        settings: Settings,
        plant: Callable[[], str] = lambda: "",
        choose: Callable[[str], object] = lambda name: None,
    ) -> None:
        self._settings, self._plant, self._choose = settings, plant, choose
        self._steps: list[dict[str, Any]] = []
        self._last: tuple[Any, float] = (None, 0.0)

    def __bool__(self) -> bool:
        return bool(self._steps)

    def keep(self, control: Any) -> None:
        """To be called before a change by this control."""
        now, (before, at) = time.monotonic(), self._last
        self._last = control, now
        if control is before and now - at < _ONE_MOVEMENT_S:
            return
        self._steps = [*self._steps[1 - _MOST :], self._now()]

    def back(self) -> bool:
        """Takes the settings back to where they differed last; False where nothing is left."""
        self._last = None, 0.0
        while self._steps:
            step = self._steps.pop()
            if step != self._now():
                if (plant := step.pop(_PLANT)) != self._plant():
                    self._choose(plant)  # before the sliders, which it moves
                self._settings.restore({**self._settings.saved(), **step})
                return True
        return False

    def _now(self) -> dict[str, Any]:
        saved = self._settings.saved()
        return {name: saved[name] for name in _KEPT} | {_PLANT: self._plant()}
