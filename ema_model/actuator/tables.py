"""What stands in an actuator's file, as tables; `ema_model.actuator.file` reads the same."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ema_model.actuator.actuator import Actuator
from ema_model.actuator.layout import KINDS, WITHOUT_DRIVE, layout
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import SECTIONS
from ema_model.actuator.unread import settings_read, unread
from ema_model.files.toml_write import inline

if TYPE_CHECKING:
    from ema_model.effects.user import UserEffect


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
    is_kind = section in KINDS and not (section == "inverter" and kinds["controller"] in WITHOUT_DRIVE)
    entries: dict[str, Any] = {"kind": kinds[section]} if is_kind else {}
    for name in (name for names in layout(section, kinds) for name in names):
        value, path = float(getattr(getattr(actuator, section), name)), f"{section}.{name}"
        if math.isfinite(value) and path not in silent:
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
    """The entries of a user's effect, as `ema_model.effects.user.entries` reads them."""
    entries: dict[str, Any] = {key: inline(value) for key, value in effect.definition.items()}
    values = {name: float(value) for name, value in actuator.effects[effect.name].items()}
    path = f"effects.{effect.name}"
    if effect.kind == "torque_curve":
        knots = inline([_entry(actuator, f"{path}.{name}", value) for name, value in values.items()])
        return {**entries, "values": knots.multiline(True)}
    from ema_model.effects.user.entries import parameter_ranges

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
