"""Writes an actuator to a TOML file that `load_actuator` reads back; what somebody noted in its file stays."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit

from ema_model.actuator import keys
from ema_model.actuator.actuator import Actuator
from ema_model.actuator.parameters import SECTIONS, default_of, facts_of, layout, numbers, on_axes
from ema_model.actuator.reference import as_spelt, tables_of
from ema_model.errors import InputError, quoted
from ema_model.files.opened import TEXT_BYTES
from ema_model.files.written import change_file, inline, toml_of, toml_text
from ema_model.quantities import Axes

_COMMENTS_AT = 64  # characters from the left
_HEAD = re.compile(r"\[\s*([\w.-]+)\s*\]\s*(?:#.*)?")
_OFFER = re.compile(r"#\s*(\w+)\s*=\s*(-?\d+(?:\.\d*)?(?:e[-+]?\d+)?)\s*(?:#.*)?")  # an entry that is a comment


def save_actuator(actuator: Actuator, path: str | os.PathLike[str], *, with_comments: bool = False) -> None:
    """Writes all parameters, tolerances, effects and faults, whole or not at all.

    Comments, order and spelling stay those of the file that is replaced, or else of the file that it was read from.
    with_comments: what each key means, instead.  Raises InputError if the file cannot be written.
    """
    target = Path(path)
    if target.suffix != ".toml":
        raise InputError(f"{quoted(target)}: the name of an actuator file must end in .toml")
    try:
        change_file(target, lambda text: commented(actuator) if with_comments else _over(text, actuator), TEXT_BYTES)
    except OSError as error:
        raise InputError(f"{quoted(target)}: cannot be written ({error.strerror}); check the folder") from None


def as_toml(actuator: Actuator) -> str:
    """The file's text, with the comments of the file that it was read from."""
    return _over("", actuator)


def _over(text: str, actuator: Actuator) -> str:
    text = text or actuator.text
    try:
        known = toml_of(text)
    except ValueError:  # what is to be replaced is none
        known, text = {}, actuator.text
    tables = as_spelt(tables_of(actuator), known)
    said = known.get("model")
    for name in keys.TABLES["model"]:  # one that says nothing may stand
        if isinstance(said, Mapping) and said.get(name) == getattr(actuator, name):
            tables["model"][name] = said[name]
    lines = _with_each_key_once(text.split("\n"), known, tables, actuator)
    if actuator.note and (note := f"# {actuator.note}") not in lines:
        lines = [note, *([] if lines[0].startswith("#") else [""]), *lines]
    return toml_text(tables, "\n".join(lines))


def _with_each_key_once(
    lines: list[str], known: Mapping[str, Any], tables: dict[str, Any], actuator: Actuator
) -> list[str]:
    """Lines in which no parameter stands both as an entry and as the comment that offers it at its default.

    A comment whose parameter now has another value or a tolerance becomes the entry; else the comment is enough, and
    tables, what is to be written, lose the entry.
    """
    kept, section, inside = [], "", {}
    for line in lines:
        if head := _HEAD.fullmatch(line.rstrip()):
            section = head[1]
            names = numbers(section) if section in SECTIONS else ()
            inside = {on_axes(path, actuator.axes).name: path for path in (f"{section}.{name}" for name in names)}
        offer = _OFFER.fullmatch(line.rstrip())
        path = inside.get(offer[1]) if offer else None
        if offer is None or path is None or float(offer[2]) != default_of(path):
            kept.append(line)
        elif offer[1] in known.get(section, {}) or offer[1] not in tables[section]:
            kept += [] if offer[1] in tables[section] else [line]
        elif _is_idle(actuator, path):
            del tables[section][offer[1]]
            kept.append(line)
        else:
            kept.append(line.lstrip("# "))
            del inside[offer[1]]
    return kept


def commented(actuator: Actuator) -> str:
    """The file's text with what each key means; what stands at its default is there to be taken, as a comment."""
    whole = tomlkit.document()
    for line in (
        "Each parameter is a number, or a table:",
        *(f"  {key:10} {told}" for key, told in keys.ENTRY.items()),
    ):
        whole.add(tomlkit.comment(line))
    whole.add(tomlkit.nl())
    for name, entry in tables_of(actuator).items():
        whole.add(name, _with_meanings(actuator, name, entry) if name in ("axes", "model", *SECTIONS) else entry)
    return tomlkit.dumps(whole)


def _with_meanings(actuator: Actuator, name: str, entries: dict[str, Any]) -> Any:
    kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
    needed, optional = layout(name, kinds) if name in SECTIONS else ((), ())
    paths = {on_axes(f"{name}.{one}", actuator.axes).name: f"{name}.{one}" for one in (*needed, *optional)}
    meanings = keys.TABLES.get(name, {}) | {key: about(path, actuator.axes) for key, path in paths.items()}
    if name in keys.KINDS:
        meanings["kind"] = keys.KINDS[name][kinds[name]]
    idle = [key for key, path in paths.items() if path.partition(".")[2] in optional and _is_idle(actuator, path)]
    table = tomlkit.table()
    for key, value in entries.items():
        item = inline(value)
        line = f"{key} = {item.as_string()}"
        if key in idle:
            table.add(tomlkit.comment(f"{line:{_COMMENTS_AT - 2}}  # {meanings[key]}"))
            continue
        item.comment(meanings[key])
        item.trivia.comment_ws = " " * (max(_COMMENTS_AT - len(line), 0) + 2)
        table.add(key, item)
    return table


def _is_idle(actuator: Actuator, path: str) -> bool:
    return path not in actuator.tolerances and actuator.value(path) == default_of(path)


def about(path: str, axes: Axes) -> str:
    """'of all that moves, as the motor feels it [kg·m²]': what "section.parameter" means."""
    unit = on_axes(path, axes).unit
    return facts_of(path, axes).meaning + (f" [{unit}]" if unit else "")
