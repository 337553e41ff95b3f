"""Writes an actuator to a TOML file that `load_actuator` reads back."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from ema_model.actuator import keys
from ema_model.actuator.actuator import Actuator
from ema_model.actuator.layout import KINDS, WITHOUT_DRIVE, layout
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import SECTIONS, default_of, facts_of
from ema_model.actuator.unread import unread
from ema_model.errors import InputError, quoted
from ema_model.files.whole_file import whole_file
from ema_model.quantities.axes import Axes

if TYPE_CHECKING:
    from ema_model.effects.user import UserEffect


_COMMENTS_AT = 64  # characters from the left


def save_actuator(actuator: Actuator, path: str | os.PathLike[str], *, with_comments: bool = False) -> None:
    """Writes all parameters, tolerances, effects and faults, whole or not at all.

    with_comments: what each key means.  Raises InputError if the file cannot be written.
    """
    target = Path(path)
    if target.suffix != ".toml":
        raise InputError(f"{quoted(target)}: the name of an actuator file must end in .toml")
    try:
        with whole_file(target) as draft:
            draft.write_text(commented(actuator) if with_comments else as_toml(actuator), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{quoted(target)}: cannot be written ({error.strerror}); check the folder") from None


def commented(actuator: Actuator) -> str:
    """The file's text with what each key means; what stands at its default is there to be taken, as a comment."""
    text = as_toml(actuator, with_comments=True)
    about = "\n".join(f"#   {key:10} {meaning}" for key, meaning in keys.ENTRY.items())
    return f"# Each parameter is a number, or a table:\n{about}\n\n{text}"


def as_toml(actuator: Actuator, *, with_comments: bool = False) -> str:
    """The file's text."""
    axes = actuator.axes
    kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
    silent = unread(**kinds)
    lines = ["schema = 1", f"name = {_text(actuator.name)}", f"description = {_text(actuator.description)}"]
    model = {"step_s": actuator.step_s, "filter_s": actuator.filter_s, "torque_known": actuator.torque_known}
    for table, values in (("axes", {"motor": axes.motor, "user": axes.user}), ("model", model)):
        lines += ["", f"[{table}]"]
        for key, value in values.items():
            entry = f"{key} = {json.dumps(value)}"
            lines.append(f"{entry:{_COMMENTS_AT}}  # {keys.TABLES[table][key]}" if with_comments else entry)
    for section in SECTIONS:
        lines += ["", f"[{section}]"]
        if section in KINDS and not (section == "inverter" and kinds["controller"] in WITHOUT_DRIVE):
            entry = f"kind = {_text(kinds[section])}"
            meaning = keys.KINDS[section][kinds[section]]
            lines.append(f"{entry:{_COMMENTS_AT}}  # {meaning}" if with_comments else entry)
        needed, optional = layout(section, kinds)
        for name in (*needed, *optional):
            value = float(getattr(getattr(actuator, section), name))
            path = f"{section}.{name}"
            if not math.isfinite(value) or path in silent:
                continue
            entry = _entry(actuator, path, on_axes(path, axes).name, value)
            if with_comments:
                is_idle = name in optional and path not in actuator.tolerances and value == default_of(path)
                entry = f"{'# ' if is_idle else ''}{entry}".ljust(_COMMENTS_AT) + f"  # {about(path, axes)}"
            lines.append(entry)
    lines += _effects(actuator)
    if actuator.faults:
        lines += ["", "[faults]", *(f"{name} = {float(value)!r}" for name, value in actuator.faults.items())]
    if actuator.mapping or actuator.rules:
        lines += ["", "[recordings]", f"mapping = [{', '.join(_text(text) for text in actuator.mapping)}]"]
    for rule in actuator.rules:
        lines += ["", "[[recordings.where]]", f"match = {_text(rule.match)}", f"kind = {_text(rule.kind)}"]
        if rule.values:
            given = ", ".join(
                f"{_text(on_axes(path, axes).path)} = {float(value)!r}" for path, value in rule.values.items()
            )
            lines.append(f"set = {{ {given} }}")
    return "\n".join([*lines, ""])


def about(path: str, axes: Axes) -> str:
    """'of all that moves, as the motor feels it [kg·m²]': what "section.parameter" means."""
    unit = on_axes(path, axes).unit
    return facts_of(path, axes).meaning + (f" [{unit}]" if unit else "")


def _effects(actuator: Actuator) -> list[str]:
    """The tables of its effects; a user's are numbered where there are several of a kind."""
    from ema_model.effects import find  # the kernels need not be loaded for an actuator without effects
    from ema_model.effects.user import UserEffect

    lines: list[str] = []
    kinds: list[str] = []
    for name, settings in actuator.effects.items():
        effect = find(name)
        if isinstance(effect, UserEffect):
            kinds.append(effect.kind)
            count = kinds.count(effect.kind)
            lines += ["", f"[effects.{effect.kind}{f'_{count}' if count > 1 else ''}]"]
            lines += _users(actuator, effect)
        else:
            lines += ["", f"[effects.{name}]"]
            lines += [
                _entry(actuator, path, on_axes(path, actuator.axes).name, float(value))
                for path, value in ((f"effects.{name}.{one}", value) for one, value in settings.items())
            ]
    return lines


def _users(actuator: Actuator, effect: UserEffect) -> list[str]:
    """The entries of a user's effect, as `ema_model.effects.user.entries` reads them."""
    lines = [f"{key} = {_text(v) if isinstance(v, str) else repr(v)}" for key, v in effect.definition.items()]
    values = {name: float(value) for name, value in actuator.effects[effect.name].items()}
    path = f"effects.{effect.name}"
    if effect.kind == "torque_curve":
        knots = [f"    {_value(actuator, f'{path}.{name}', value)}," for name, value in values.items()]
        return [*lines, "values = [", *knots, "]"]
    from ema_model.effects.user.entries import parameter_ranges

    ranges = parameter_ranges(effect)
    for name, value in values.items():
        lines.append(f"{name} = {_value(actuator, f'{path}.{name}', value, ranges.get(name))}")
    return lines


def _entry(actuator: Actuator, path: str, shown: str, value: float) -> str:
    return f"{shown} = {_value(actuator, path, value)}"


def _value(actuator: Actuator, path: str, value: float, limits: tuple[float, float] | None = None) -> str:
    """A number, or a table of it with its tolerance and its limits, where it has some."""
    tolerance = actuator.tolerances.get(path)
    parts = [f"value = {value!r}"]
    if tolerance is not None:
        parts += [f"sigma = {float(tolerance.sigma)!r}"] + ([] if tolerance.free else ["free = false"])
    if limits is not None:
        parts += [f"low = {limits[0]!r}", f"high = {limits[1]!r}"]
    return repr(value) if len(parts) == 1 else f"{{ {', '.join(parts)} }}"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
