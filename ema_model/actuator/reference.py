"""The reference of keys: tables for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from ema_model.actuator.actuator import Actuator
from ema_model.actuator.parameters import (
    CHOICES,
    CONTROLLER_KINDS,
    ENTRY,
    HEAD,
    INVERTER_KINDS,
    KINDS,
    SECTIONS,
    TABLES,
    Facts,
    default_of,
    drives_of,
    facts_of,
    is_said,
    layout,
    numbers,
    on_axes,
    says_drive,
    settings_read,
    unread,
)
from ema_model.files.written import inline
from ema_model.quantities import Axes, number

if TYPE_CHECKING:
    from ema_model.effects.user import UserEffect

# --- what stands in an actuator's file, as tables; `ema_model.actuator.file` reads the same ---------------------------


def tables_of(actuator: Actuator) -> dict[str, Any]:
    """All its parameters with their tolerances, its effects, faults and recordings, in the file's order."""
    axes = actuator.axes
    return {
        "schema": 1,
        "name": inline(actuator.name),
        "description": inline(actuator.description),
        "axes": {"motor": axes.motor, "user": axes.user},
        "model": {name: getattr(actuator, name) for name in settings_read(actuator.controller.kind)},
        **{section: _section(actuator, section) for section in SECTIONS},
        **_given("effects", _effects(actuator)),
        **_given("faults", {name: float(value) for name, value in actuator.faults.items()}),
        **_given("recordings", _recordings(actuator)),
    }


def _given(name: str, table: dict[str, Any]) -> dict[str, Any]:
    return {name: table} if table else {}


def _section(actuator: Actuator, section: str) -> dict[str, Any]:
    kinds = {"controller": actuator.controller.kind, "inverter": actuator.inverter.kind}
    silent = unread(**kinds)
    is_kind = section in CHOICES and (section != "inverter" or says_drive(kinds["controller"], kinds["inverter"]))
    entries: dict[str, Any] = {"kind": kinds[section]} if is_kind else {}
    for name in (name for names in layout(section, kinds) for name in names):
        value, path = float(getattr(getattr(actuator, section), name)), f"{section}.{name}"
        if is_said(path, value) and path not in silent:
            entries[on_axes(path, actuator.axes).name] = _entry(actuator, path, value)
    return entries


def _effects(actuator: Actuator) -> dict[str, Any]:
    """Its effects; a user's are numbered where there are several of a kind."""
    from ema_model.effects import find  # the kernels need not be loaded for an actuator without effects
    from ema_model.effects.user import UserEffect

    found: dict[str, Any] = {}
    kinds: list[str] = []
    for name, settings in actuator.effects.items():
        effect = find(name)
        if isinstance(effect, UserEffect):
            kinds.append(effect.kind)
            count = kinds.count(effect.kind)
            found[f"{effect.kind}_{count}" if count > 1 else effect.kind] = _users(actuator, effect)
            continue
        paths = {f"effects.{name}.{one}": float(value) for one, value in settings.items()}
        found[name] = {on_axes(path, actuator.axes).name: _entry(actuator, path, v) for path, v in paths.items()}
    return found


def _users(actuator: Actuator, effect: UserEffect) -> dict[str, Any]:
    """The entries of a user's effect, as `ema_model.effects.user.torque` reads them."""
    entries: dict[str, Any] = {key: inline(value) for key, value in effect.definition.items()}
    values = {name: float(value) for name, value in actuator.effects[effect.name].items()}
    path = f"effects.{effect.name}"
    if effect.kind == "torque_curve":
        knots = inline([_entry(actuator, f"{path}.{name}", value) for name, value in values.items()])
        return {**entries, "values": knots.multiline(True)}
    from ema_model.effects.user.torque import parameter_ranges

    ranges = parameter_ranges(effect)
    return entries | {n: _entry(actuator, f"{path}.{n}", value, ranges.get(n)) for n, value in values.items()}


def _entry(actuator: Actuator, path: str, value: float, limits: tuple[float, float] | None = None) -> Any:
    """A number, or a table of it with its tolerance and its limits, where it has some."""
    parts: dict[str, Any] = {"value": value}
    if (tolerance := actuator.tolerances.get(path)) is not None:
        parts |= {"sigma": float(tolerance.sigma)} | ({} if tolerance.free else {"free": False})
    if limits is not None:
        parts |= {"low": limits[0], "high": limits[1]}
    return value if len(parts) == 1 else inline(parts)


def _recordings(actuator: Actuator) -> dict[str, Any]:
    found: dict[str, Any] = {"mapping": inline(list(actuator.mapping))} if actuator.mapping else {}
    if actuator.rules:
        found["where"] = []
    for rule in actuator.rules:
        values = {on_axes(path, actuator.axes).path: float(value) for path, value in rule.values.items()}
        found["where"].append({"match": inline(rule.match), "kind": rule.kind, **_given("set", inline(values))})
    return found


def as_spelt(tables: dict[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """The same with its tolerances relative to the values, where a file has them so and they are still the same."""
    for section in SECTIONS:
        given = known.get(section)
        for name, old in given.items() if isinstance(given, Mapping) else ():
            entry, relative = tables[section].get(name), old.get("tolerance") if isinstance(old, Mapping) else None
            if relative is None or not isinstance(entry, Mapping) or "sigma" not in entry:
                continue
            if math.isclose(relative * abs(entry["value"]), entry["sigma"], rel_tol=1e-12):
                spelt = {"value": entry["value"], "tolerance": relative}
                tables[section][name] = inline(spelt | {key: one for key, one in entry.items() if key != "sigma"})
    return tables


# --- the reference of every key that an actuator file may have, made of what the reader itself goes by ----------------

_LINES = Axes("linear", "linear")


@dataclass(frozen=True)
class ParameterRow:
    """One parameter as the reference shows it."""

    path: str  # "motor.inertia_kgm2"
    linear: str  # the name where its axis is linear; the same where nothing changes
    meaning: str
    unit: str
    default: str  # "needed" where a file must say it
    tolerance: str  # the usual one
    plausible: str
    kinds: tuple[str, ...]  # of controller and drive, "cascade, current", that have it


def kinds_of_actuators() -> tuple[tuple[str, str], ...]:
    """Every pair of controller and drive that a file may have."""
    return tuple(
        (controller, drive)
        for controller, drive in product(CONTROLLER_KINDS, INVERTER_KINDS)
        if drive in drives_of(controller)
    )


def parameter_rows() -> Iterator[ParameterRow]:
    """Every parameter of every kind, in the order of the sections."""
    rotary = Axes()
    for section in SECTIONS:
        for name in numbers(section):
            path = f"{section}.{name}"
            facts, named = facts_of(path, rotary), on_axes(path, rotary)
            having, needing = [], []
            for controller, drive in kinds_of_actuators():
                needed, optional = layout(section, {"controller": controller, "inverter": drive})
                if name in (*needed, *optional) and path not in unread(controller, drive):
                    having.append(_kind(controller, drive))
                    if name in needed:
                        needing.append(having[-1])
            yield ParameterRow(
                path,
                on_axes(path, _LINES).path,
                facts.meaning,
                named.unit,
                _default(path, having, needing),
                usual_tolerance(facts),
                f"{number(facts.low)} … {number(facts.high)}",
                tuple(having),
            )


def usual_tolerance(facts: Facts) -> str:
    """'5%' of the value, or '± 0.02'; "" where it counts as known."""
    share = f"{facts.tolerance:.1%}".replace(".0%", "%") if facts.tolerance else ""
    return share or (f"± {facts.sigma:g}" if facts.sigma else "")


def _kind(controller: str, drive: str) -> str:
    return f"{controller} + {drive}" if says_drive(controller, drive) else controller


def _default(path: str, having: list[str], needing: list[str]) -> str:
    if having == needing:
        return "needed"
    value = default_of(path)
    shown = "none" if value is None or not is_said(path, value) or abs(value) >= 1e9 else f"{value:g}"
    return f"{shown}; needed with {', '.join(needing)}" if needing else shown


def markdown() -> str:
    """The whole reference."""
    lines = [
        "# The keys of an actuator file",
        "",
        "Made by `emaviz actuator keys` from what the reader of these files goes by. `emaviz actuator new FILE.toml`",
        "writes such a file with comments; `emaviz actuator check FILE.toml [RECORDING]` says what one lacks.",
        "",
        "Units are SI and end the names. On a linear axis a torque is a force, an inertia a mass and an angle",
        "a length, and the names say so: `inertia_kgm2` becomes `mass_kg`.",
        "",
        *_table("Head", HEAD),
        *_table("A parameter: a number, or a table", ENTRY),
        *(line for name in ("axes", "model") for line in _table(f"[{name}]", TABLES[name])),
    ]
    rows = list(parameter_rows())
    for section in SECTIONS:
        lines += [f"## [{section}]", ""]
        if section in KINDS:
            choices = "; ".join(f"`{name}` {meaning}" for name, meaning in KINDS[section].items())
            lines += [f"`kind` is one of: {choices}.", ""]
        lines += ["| key | on a linear axis | means | unit | default | usual 1 σ | plausible | of |", "|---" * 8 + "|"]
        for row in rows:
            if row.path.startswith(f"{section}."):
                short, linear = (path.partition(".")[2] for path in (row.path, row.linear))
                other = f"`{linear}`" if linear != short else ""
                cells = (row.meaning, row.unit, row.default, row.tolerance, row.plausible, _of(row.kinds))
                lines.append(f"| `{short}` | {other} | {' | '.join(cells)} |")
        lines.append("")
    lines += [
        "## [effects.NAME]",
        "",
        "Effects that belong to the actuator's model, several of a kind as `NAME_2`.",
        "",
    ]
    lines += ["| effect | key | on a linear axis | means | range | default |", "|---" * 6 + "|"]
    # The kernels take a while to import.
    from ema_model.effects import CATALOGUE
    from ema_model.effects.user.torque import KEYS as USERS

    for effect in CATALOGUE.values():
        for parameter in effect.parameters:
            there = parameter.on(_LINES).shown
            other = f"`{there}`" if there != parameter.name else ""
            cells = (parameter.meaning, f"{parameter.low:g} … {parameter.high:g}", f"{parameter.default:g}")
            lines.append(f"| `{effect.name}` | `{parameter.name}` | {other} | {' | '.join(cells)} |")
    lines.append("")
    for name, about in USERS.items():
        lines += _table(f"[effects.{name}]", about)
    for name in ("faults", "recordings"):
        lines += _table(f"[{name}]", TABLES[name])
    lines += _table("[[recordings.where]]", TABLES["recordings.where"])
    return "\n".join(lines)


def _of(kinds: tuple[str, ...]) -> str:
    every = [_kind(*pair) for pair in kinds_of_actuators()]
    return "all" if list(kinds) == every else ", ".join(kinds)


def _table(title: str, about: dict[str, str]) -> list[str]:
    rows = [f"| `{key}` | {meaning.replace('|', '¦')} |" for key, meaning in about.items()]
    return [f"## {title}", "", "| key | means |", "|---|---|", *rows, ""]
