"""Reads an actuator from its TOML file and writes one that is read back; a mistake in it gives one line."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import tomlkit

from ema_model.actuator.actuator import LONGEST_S, SHORTEST_S, Actuator, reader_step
from ema_model.actuator.parameters import (
    CHOICES,
    ENTRY,
    HEAD,
    INVERSE,
    KINDS,
    SECTIONS,
    TABLES,
    USUAL,
    Rule,
    Tolerance,
    check_stops,
    check_value,
    check_value_is_read,
    default_of,
    facts_of,
    idle,
    layout,
    numbers,
    on_axes,
    settings_read,
    unread,
)
from ema_model.actuator.reference import as_spelt, tables_of
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.faults import vector
from ema_model.files.opened import TEXT_BYTES, open_user_file, shipped_folder
from ema_model.files.written import change_file, inline, toml_of, toml_text
from ema_model.quantities import KINDS as AXIS_KINDS
from ema_model.quantities import Axes, as_number

# --- whether all that an actuator's file says is read by a model of its kind ------------------------------------------

# In the Reference Model alone (MODEL: T 3.3): known well enough by their values, but no fit could learn of them.
_REFERENCE_ONLY = ("inverter.hysteresis_band_A", "transmission.viscous_friction_Nms_rad")

_OF_INVERSE = "it is of inverse dynamics, for an unknown controller"
_OF_SETTINGS = {
    "step_s": f"{INVERSE} takes no steps",
    "filter_s": _OF_INVERSE,
    "leaves_out_reversals": _OF_INVERSE,
}


def check_all_is_read(actuator: Actuator, where: str) -> None:
    """Raises InputError with the reason for whatever an actuator's file says that no model of its kind would read.

    That is of values, tolerances, recordings' values, effects and settings.
    """
    for section in SECTIONS:
        for one in fields(SECTIONS[section]):
            if one.name != "kind":
                path = f"{section}.{one.name}"
                _check_value(actuator, path, getattr(getattr(actuator, section), one.name), where)
    for rule in actuator.rules:
        for path, value in rule.values.items():
            _check_value(actuator, path, value, f"{where}: recordings.where {rule.match}")
    for path in set(actuator.tolerances) & set(unread(actuator.controller.kind, actuator.inverter.kind)):
        raise InputError(
            f"{where}: {on_axes(path, actuator.axes).path}: no model reads it, so that it cannot have a tolerance"
        )
    for name in actuator.effects:
        _check_effect_acts(actuator, name, where)
    read = settings_read(actuator.controller.kind)
    for name, reason in _OF_SETTINGS.items():
        if name not in read and getattr(actuator, name) != getattr(Actuator, name):
            raise InputError(f"{where}: model.{name}: {reason}; leave it out")
    if actuator.has_reference_model:
        _check_reference_only(actuator, where)


def _check_reference_only(actuator: Actuator, where: str) -> None:
    for path in _REFERENCE_ONLY:
        if path in actuator.tolerances:
            shown = on_axes(path, actuator.axes).path
            raise InputError(f"{where}: {shown}: the fitted model leaves it out, so that it cannot have a tolerance")
    path = "transmission.viscous_friction_Nms_rad"
    if actuator.value(path) > max(actuator.motor.viscous_friction_Nms_rad, 0.0):
        shown, motor = (on_axes(one, actuator.axes).path for one in (path, "motor.viscous_friction_Nms_rad"))
        raise InputError(
            f"{where}: {shown}: the fitted model leaves it out, as small beside the motor's own; add it to {motor}"
        )


def cannot_represent(actuator: Actuator, name: str) -> str:
    """Why a model of this actuator has no place for an effect, whatever is recorded; "" where it has one."""
    from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

    effect = find(name)
    if not effect.has_part(actuator.axes):
        return "on a linear axis nothing turns that it could be of"
    places = {function.__name__ for function in effect.places}
    return idle(places, bool(effect.states), actuator.controller.kind, actuator.inverter.kind)


def check_represents(actuator: Actuator, name: str) -> None:
    """Raises InputError with the reason where an effect would do nothing, and with what could hold it."""
    if not (reason := cannot_represent(actuator, name)):
        return
    raise InputError(f"effect {name}: this model cannot represent it: {reason}; {_what_could(actuator, name)}")


def _what_could(actuator: Actuator, name: str) -> str:
    """What holds an effect that this model does not: another loop, or nothing."""
    if actuator.controller.kind == "unknown" and not cannot_represent(actuator.in_open_loop(), name):
        return "an open loop can (--open-loop), or a closed one: write the controller into the actuator's file"
    if actuator.controller.kind in ("unknown", "open"):
        return "a closed loop can: write the controller into the actuator's file"
    return "leave it out"


def _check_effect_acts(actuator: Actuator, name: str, where: str) -> None:
    if reason := cannot_represent(actuator, name):
        raise InputError(f"{where}: effects.{name}: {reason}; leave it out")


def _check_value(actuator: Actuator, path: str, value: float, where: str) -> None:
    check_value_is_read(actuator.controller.kind, actuator.inverter.kind, actuator.axes, path, value, where)


# --- reads an actuator from its TOML file; every mistake in it gives one line that says where -------------------------

_OTHERS = (*HEAD, "axes", "model", "effects", "faults", "recordings")
_RECORDING_KINDS = ("run", "map")
_MOST_BYTES = 10_000_000


def load_actuator(path: str | Path | None = None) -> Actuator:
    """The actuator of a TOML file, or the thesis's own without one; InputError tells what is wrong in it."""
    if path is None:
        return parse_actuator(shipped("thesis.toml"), "thesis.toml")
    return parse_actuator(actuator_text(path), path)


def actuator_text(path: str | Path) -> str:
    """What an actuator's file holds, not looked at yet; InputError where it cannot be read."""
    try:
        with open_user_file(path, "an actuator file (.toml)", TEXT_BYTES) as file:
            return file.read().decode("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "not UTF-8"
        raise InputError(f"{quoted(path)}: cannot be read as text ({why})") from None


def shipped(name: str) -> str:
    """Text of an actuator file that comes with the package (assets/actuators)."""
    return (shipped_folder("actuators") / name).read_text(encoding="utf-8")


def parse_actuator(text: str, path: str | Path) -> Actuator:
    """The actuator of a file's text; path: what errors call it.  InputError tells what is wrong in it."""
    where = quoted(path)
    try:
        document = toml_of(text)
    except ValueError as error:
        raise InputError(f"{where}: not valid TOML: {quoted(error)}") from None
    try:
        return replace(actuator_of(document, where), text=text)
    except InputError:
        raise
    except ValueError:  # of a number with thousands of digits, read or shown
        raise InputError(f"{where}: holds a number with too many digits; correct it") from None


def actuator_of(document: dict[str, Any], where: str) -> Actuator:
    """The actuator of a file's tables; InputError, which begins with `where`, tells what is wrong in them."""
    if document.get("schema", 1) != 1:
        raise InputError(f"{where}: schema {quoted(document['schema'], 40)} is not known; this version reads schema 1")
    unknown = set(document) - set(SECTIONS) - set(_OTHERS)
    if unknown:
        sections = ", ".join((*SECTIONS, *_OTHERS[3:]))
        raise InputError(f"{where}: unknown entry {quoted(sorted(unknown)[0])!r}; sections are {sections}")
    tables = {name: _table(document, name, where) for name in (*SECTIONS, *_OTHERS[3:])}
    axes = _axes(tables["axes"], where)
    kinds = {
        section: _choice(tables[section], "kind", USUAL[section], CHOICES[section], section, where)
        for section in CHOICES
    }
    is_voltage = kinds["inverter"] == "voltage"
    if kinds["controller"] == "unknown" or (kinds["controller"] == "open" and not is_voltage):
        kinds["inverter"] = "current"
    if kinds["controller"] == "position" and kinds["inverter"] == "hysteresis":
        raise InputError(f'{where}: [inverter] a position controller needs kind = "voltage" or "current"')
    if kinds["controller"] == "cascade" and kinds["inverter"] == "voltage":
        raise InputError(f'{where}: [inverter] a cascade needs kind = "hysteresis" or "current"')
    tolerances: dict[str, Tolerance] = {}
    sections = {section: _section(section, tables[section], kinds, axes, tolerances, where) for section in SECTIONS}
    check_stops(sections["transmission"], axes, where)
    actuator = Actuator(
        name=str(document.get("name", Path(where).stem)),
        description=str(document.get("description", "")),
        tolerances=tolerances,
        effects=_effects(tables["effects"], axes, tolerances, where),
        faults=_faults(tables["faults"], where),
        axes=axes,
        step_s=_seconds(tables["model"], "step_s", reader_step(**kinds), where),
        torque_known=_flag(tables["model"], "torque_known", True, where),
        filter_s=_seconds(tables["model"], "filter_s", 12e-3, where),
        leaves_out_reversals=_flag(tables["model"], "leaves_out_reversals", False, where),
        mapping=_mapping(tables["recordings"], where),
        rules=_rules(tables["recordings"], axes, where),
        **sections,
    )
    check_all_is_read(actuator, where)
    return actuator


def _section(
    section: str, given: dict[str, Any], kinds: dict[str, str], axes: Axes, tolerances: dict[str, Tolerance], where: str
) -> Any:
    needed, optional = layout(section, kinds)
    inside = {on_axes(f"{section}.{name}", axes).name: name for name in (*needed, *optional)}
    reasons = unread(kinds["controller"], kinds["inverter"])
    why = {on_axes(path, axes).name: reason for path, reason in reasons.items() if path.startswith(section)}
    for extra in set(given) - set(inside) - ({"kind"} if section in CHOICES else set()):
        reason = f": {why[extra]}" if extra in why else ""
        raise InputError(
            f"{where}: [{section}] has no parameter {quoted(extra)!r}{reason}; it has {', '.join(inside) or 'none'}"
        )
    values: dict[str, Any] = {"kind": kinds[section]} if section in CHOICES else {}
    for shown, name in inside.items():
        if shown in given:
            values[name], tolerance = _entry(section, name, shown, given[shown], where)
            if tolerance is not None:
                tolerances[f"{section}.{name}"] = tolerance
        elif name in needed:
            raise InputError(f"{where}: [{section}] lacks {shown}")
    return SECTIONS[section](**values)


def _effects(
    given: dict[str, Any], axes: Axes, tolerances: dict[str, Tolerance], where: str
) -> dict[str, dict[str, float]]:
    """The effects that belong to the actuator's model, checked by the catalogue."""
    if not given:  # the catalogue's kernels need not be loaded for an actuator without effects
        return {}
    from ema_model.effects import find
    from ema_model.effects.user.torque import kind_of, read_entries

    effects: dict[str, dict[str, float]] = {}
    for given_name in given:
        inside = f"[effects.{quoted(given_name)}]"
        table = _table(given, given_name, f"{where}: [effects]")
        kind = kind_of(given_name)
        try:
            effect, table = (find(given_name, axes), table) if kind is None else read_entries(kind, table)
        except InputError as error:
            raise InputError(f"{where}: {'[effects]' if kind is None else inside} {error}") from None
        if effect.name in effects:
            raise InputError(f"{where}: {inside} is the same as another one; write them as one")
        names = {p.shown: p.name for p in effect.parameters}
        values = {}
        for shown, entry in table.items():
            if shown not in names:
                raise InputError(
                    f"{where}: {inside} has no {quoted(shown)!r}; it has {', '.join(names)}{did_you_mean(shown, names)}"
                )
            value, tolerance = _number_and_tolerance(f"effects.{quoted(given_name)}", quoted(shown), entry, where)
            values[names[shown]] = value
            if tolerance is not None:
                tolerances[f"effects.{effect.name}.{names[shown]}"] = tolerance
        try:
            effects[effect.name] = effect.settings(values)
        except InputError as error:
            raise InputError(f"{where}: {inside} {error}") from None
    return effects


def _faults(given: dict[str, Any], where: str) -> dict[str, float]:
    """The known faults k1 … k8, each a number in 0 … 1."""
    for name, value in given.items():
        if not math.isfinite(as_number(value)):
            raise InputError(f"{where}: [faults] {name} must be a number, not {quoted(value, 40)!r}")
    faults = {name: float(value) for name, value in given.items()}
    try:
        vector(faults)
    except InputError as error:
        raise InputError(f"{where}: [faults] {error}") from None
    return faults


def _entry(section: str, name: str, shown: str, entry: Any, where: str) -> tuple[float, Tolerance | None]:
    value, tolerance = _number_and_tolerance(section, shown, entry, where)
    check_value(section, name, value, where, shown)
    return value, tolerance


def _number_and_tolerance(section: str, shown: str, entry: Any, where: str) -> tuple[float, Tolerance | None]:
    tolerance = None
    value = entry
    if isinstance(entry, dict):
        extra = set(entry) - set(ENTRY)
        if extra or "value" not in entry:
            raise InputError(f"{where}: [{section}] {shown} takes value, tolerance or sigma, free")
        value = entry["value"]
    if not math.isfinite(as_number(value)):
        raise InputError(f"{where}: [{section}] {shown} must be a number, not {quoted(value, 40)!r}")
    if isinstance(entry, dict) and ("tolerance" in entry or "sigma" in entry):
        given, scale = (entry["sigma"], 1.0) if "sigma" in entry else (entry["tolerance"], abs(value))
        sigma = as_number(given) * scale
        if not 0.0 < sigma < math.inf:
            raise InputError(f"{where}: [{section}] {shown}: the tolerance must be above 0 (sigma where value is 0)")
        free = entry.get("free", True)
        if not isinstance(free, bool):
            raise InputError(f"{where}: [{section}] {shown}: free must be true or false, not {quoted(free)!r}")
        tolerance = Tolerance(sigma, free)
    return float(value), tolerance


def _table(document: dict[str, Any], name: str, where: str) -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise InputError(f"{where}: [{quoted(name)}] must be a table")
    return table


def _check_keys(table: dict[str, Any], name: str, shown: str, where: str) -> None:
    for extra in set(table) - set(TABLES[name]):
        raise InputError(f"{where}: {shown} has no {quoted(extra)!r}; it has {', '.join(TABLES[name])}")


def _choice(table: dict[str, Any], key: str, usual: str, choices: tuple[str, ...], section: str, where: str) -> str:
    chosen = table.get(key, usual)
    if chosen not in choices:
        raise InputError(f"{where}: [{section}] {key} must be {' or '.join(choices)}, not {quoted(chosen, 40)!r}")
    return chosen


def _axes(table: dict[str, Any], where: str) -> Axes:
    _check_keys(table, "axes", "[axes]", where)
    return Axes(*(_choice(table, key, "rotary", AXIS_KINDS, "axes", where) for key in ("motor", "user")))


def _seconds(table: dict[str, Any], name: str, usual: float, where: str) -> float:
    _check_keys(table, "model", "[model]", where)
    value = as_number(table.get(name, usual))
    if not SHORTEST_S <= value <= LONGEST_S:
        raise InputError(f"{where}: [model] {name} must lie between 1e-7 and 1 s, not {quoted(table[name], 40)!r}")
    return value


def _flag(table: dict[str, Any], name: str, usual: bool, where: str) -> bool:
    value = table.get(name, usual)
    if not isinstance(value, bool):
        raise InputError(f"{where}: [model] {name} must be true or false, not {quoted(value, 40)!r}")
    return value


def _mapping(table: dict[str, Any], where: str) -> tuple[str, ...]:
    _check_keys(table, "recordings", "[recordings]", where)
    mapping = table.get("mapping", [])
    if not isinstance(mapping, list) or not all(isinstance(text, str) for text in mapping):
        raise InputError(f'{where}: [recordings] mapping must be a list of texts such as "time_s=t[ms]"')
    return tuple(mapping)


def _rules(table: dict[str, Any], axes: Axes, where: str) -> tuple[Rule, ...]:
    given = table.get("where", [])
    if not isinstance(given, list) or not all(isinstance(rule, dict) for rule in given):
        raise InputError(f"{where}: [[recordings.where]] must be tables")
    rules = []
    for rule in given:
        _check_keys(rule, "recordings.where", "[[recordings.where]]", where)
        if not isinstance(rule.get("match"), str):
            raise InputError(f'{where}: [[recordings.where]] needs match, a pattern of file names such as "*kp100*"')
        kind = _choice(rule, "kind", "run", _RECORDING_KINDS, "recordings.where", where)
        values = {}
        for path, value in _table(rule, "set", where).items():
            section, _, shown = path.partition(".")
            inside = (
                {on_axes(f"{section}.{name}", axes).name: name for name in SECTIONS[section].__annotations__}
                if section in SECTIONS
                else {}
            )
            if shown not in inside or shown == "kind":
                raise InputError(
                    f'{where}: [[recordings.where]] no parameter {quoted(path, 60)!r}; write "section.name" = value'
                )
            check_value(section, inside[shown], value, f"{where}: recordings.where", shown)
            values[f"{section}.{inside[shown]}"] = float(value)
        rules.append(Rule(rule["match"], values, kind))
    return tuple(rules)


# --- writes an actuator to a TOML file that `load_actuator` reads back; what somebody noted in its file stays ---------

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
    for name in TABLES["model"]:  # one that says nothing may stand
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
        *(f"  {key:10} {told}" for key, told in ENTRY.items()),
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
    meanings = TABLES.get(name, {}) | {key: about(path, actuator.axes) for key, path in paths.items()}
    if name in KINDS:
        meanings["kind"] = KINDS[name][kinds[name]]
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
