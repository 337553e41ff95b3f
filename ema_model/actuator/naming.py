"""What parameters are called and measured in on an actuator's axes: the owner of each says where it sits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

from ema_model.actuator.parameters import SECTIONS
from ema_model.errors import InputError
from ema_model.quantities.axes import Axes
from ema_model.quantities.sides import MOTOR, USER, Side
from ema_model.quantities.titles import in_sentence, parameter_title, unit_of

# Where the windows of recordings start ("play 0"), and what load a recording bears.
_OF_WINDOWS: dict[str, tuple[str, Side | None]] = {
    "turned": ("rad", MOTOR),
    "play": ("rad", MOTOR),
    "faster": ("rad/s", MOTOR),
    "load": ("N·m", USER),
    "lag": ("s", None),
}


@dataclass(frozen=True)
class Named:
    """A parameter as files and people have it."""

    path: str  # "motor.mass_kg"
    title: str  # "Motor mass"
    unit: str  # "kg"

    @property
    def name(self) -> str:
        """The last part of its path, as it stands in its section."""
        return self.path.rpartition(".")[2]


def on_axes(path: str, axes: Axes) -> Named:
    """How "section.parameter", "effects.name.parameter" or the start of a window is shown on these axes.

    What is none of these, as k1, stays as it is.
    """
    section, _, name = path.partition(".")
    if section == "effects":
        return _of_effect(path, axes)
    known = {one.name: one for one in fields(SECTIONS[section])} if section in SECTIONS else {}
    if name in known:
        side, per = (known[name].metadata.get(key) for key in ("side", "per"))
        shown = f"{section}.{axes.name(name, side)}"
        return Named(shown, parameter_title(shown), axes.unit(unit_of(name), side, per))
    kind, window, _ = path.partition(" ")
    unit, side = _OF_WINDOWS.get(kind, ("", None)) if window else ("", None)
    return Named(path, parameter_title(path), axes.unit(unit, side))


def path_inside(path: str, among: Iterable[str], axes: Axes) -> str:
    """The path inside of one that files and people have, among these; what is none of them stays."""
    return next((one for one in among if on_axes(one, axes).path == path), path)


def _of_effect(path: str, axes: Axes) -> Named:
    from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

    section, effect, name = path.split(".")
    try:
        found = find(effect, axes)
        parameter = next(one for one in found.parameters if one.name == name)
    except (InputError, StopIteration):  # of a user, and not known here
        return Named(path, f"{effect}: {in_sentence(parameter_title(name))}", unit_of(name))
    title = f"{found.title}: {in_sentence(parameter.title)}"
    return Named(f"{section}.{effect}.{parameter.shown}", title, parameter.unit)
