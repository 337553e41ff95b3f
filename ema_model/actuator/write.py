"""Writes an actuator to a TOML file that `load_actuator` reads back."""

from __future__ import annotations

import json
import math
import os
import tempfile
from pathlib import Path

from ema_model.actuator.layout import KINDS, layout
from ema_model.actuator.parameters import SECTIONS, Actuator
from ema_model.errors import InputError


def save_actuator(actuator: Actuator, path: str | os.PathLike[str]) -> None:
    """Writes all parameters, tolerances and effects, whole or not at all; InputError if the file cannot be written."""
    target = Path(path)
    if target.suffix != ".toml":
        raise InputError(f"{target}: the name of an actuator file must end in .toml")
    try:
        handle, draft = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}-")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(as_toml(actuator))
        os.chmod(draft, 0o644)
        os.replace(draft, target)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); check the folder") from None


def as_toml(actuator: Actuator) -> str:
    """The file's text."""
    axes = actuator.axes
    kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
    lines = ["schema = 1", f"name = {_text(actuator.name)}", f"description = {_text(actuator.description)}"]
    lines += ["", "[axes]", f"motor = {_text(axes.motor)}", f"user = {_text(axes.user)}"]
    lines += ["", "[model]", f"step_s = {actuator.step_s!r}", f"filter_s = {actuator.filter_s!r}"]
    lines += [f"torque_known = {str(actuator.torque_known).lower()}"]
    for section in SECTIONS:
        lines += ["", f"[{section}]"]
        if section in KINDS and not (section == "inverter" and kinds["controller"] == "unknown"):
            lines.append(f"kind = {_text(kinds[section])}")
        needed, optional = layout(section, kinds)
        for name in (*needed, *optional):
            value = float(getattr(getattr(actuator, section), name))
            if math.isfinite(value):
                lines.append(_entry(actuator, f"{section}.{name}", axes.parameter(name), value))
    for effect, settings in actuator.effects.items():
        lines += ["", f"[effects.{effect}]"]
        lines += [_entry(actuator, f"effects.{effect}.{n}", axes.parameter(n), float(v)) for n, v in settings.items()]
    if actuator.mapping or actuator.rules:
        lines += ["", "[recordings]", f"mapping = [{', '.join(_text(text) for text in actuator.mapping)}]"]
    for rule in actuator.rules:
        lines += ["", "[[recordings.where]]", f"match = {_text(rule.match)}", f"kind = {_text(rule.kind)}"]
        if rule.values:
            given = ", ".join(f"{_text(axes.path(path))} = {float(value)!r}" for path, value in rule.values.items())
            lines.append(f"set = {{ {given} }}")
    return "\n".join([*lines, ""])


def _entry(actuator: Actuator, path: str, shown: str, value: float) -> str:
    tolerance = actuator.tolerances.get(path)
    if tolerance is None:
        return f"{shown} = {value!r}"
    free = "" if tolerance.free else ", free = false"
    return f"{shown} = {{ value = {value!r}, sigma = {float(tolerance.sigma)!r}{free} }}"


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
