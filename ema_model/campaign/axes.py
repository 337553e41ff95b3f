"""The axes of a plan's group: what each of its entries may be, and the choices that they stand for.

An entry is one choice, or a list of them, which makes it an axis.  What is drawn at random is a choice too: a table
that says how, drawn anew from each seed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.campaign import draws
from ema_model.campaign.given import effects_of
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.refusal import listed
from ema_model.quantities.numbers import as_number

MOST_TASKS = 1_000_000  # of a plan


@dataclass(frozen=True)
class Choice:
    """One point of an axis."""

    label: str
    at: Callable[[int], Any]  # its value for a seed


Reader = Callable[[Any, Actuator], list[Choice]]


def choices_of(name: str, entry: Any, actuator: Actuator) -> list[Choice]:
    """The choices of an axis in their order; InputError for what is none of it, and for an axis that holds nothing."""
    read = AXES[name]
    found = [choice for one in (entry if isinstance(entry, list) else [entry]) for choice in read(one, actuator)]
    if not found:
        raise InputError("holds nothing, so that there is nothing to compute; give it a value")
    return found


def _faults(entry: Any, actuator: Actuator) -> list[Choice]:
    """{k1 = 0.25}, {} for healthy, {grid = {k1 = [0, 0.5], …}}, {uniform = {k1 = [0, 0.5], …}}, {draw = NAME}"""
    table = _table(entry)
    if "draw" in table:
        name = _only(table, "draw")
        return [Choice(f"{name} faults", _known(name, draws.FAULTS))]
    if "uniform" in table:
        ranges = {name: _pair(one) for name, one in _table(_only(table, "uniform")).items()}
        for ends in zip(*ranges.values()):
            faults.vector(dict(zip(ranges, ends)))
        return [Choice("uniform faults", lambda seed: draws.uniform_faults(ranges, seed))]
    if "grid" in table:
        grid = {name: [_number(v) for v in _list(one)] for name, one in _table(_only(table, "grid")).items()}
        check_count(len(values) for values in grid.values())
        points = [dict(zip(grid, point)) for point in itertools.product(*grid.values())]
    else:
        points = [{name: _number(value) for name, value in table.items()}]
    for point in points:
        faults.vector(point)
    return [_always(" ".join(f"{name}={value:g}" for name, value in one.items()) or "healthy", one) for one in points]


def _effects(entry: Any, actuator: Actuator) -> list[Choice]:
    """{cogging_torque = {amplitude_Nm = 0.01}}, {} for none; {each = NAMES or "all", but = NAMES, severities = […],
    phases = "drawn"}, {pair_of = NAMES, severities = […]}, {draw = NAME}; of a user: as in an actuator's file."""
    table = _table(entry)
    if "draw" in table:
        name = _only(table, "draw")
        return [Choice(f"effect {name}", _known(name, draws.EFFECTS))]
    if "each" in table or "pair_of" in table:
        return _library(table)
    for name, settings in table.items():
        if not isinstance(settings, dict):
            raise InputError(f"effect {quoted(name)} needs a table of its parameters, not {quoted(settings, 40)!r}")
    effects_of(table)
    told = [name if "expression" not in one else str(one["expression"]) for name, one in table.items()]
    numbers = [f"{v:g}" for one in table.values() for v in one.values() if isinstance(v, int | float)]
    return [_always(" ".join([*told, *numbers]) or "nothing hidden", table)]


def _library(table: Mapping[str, Any]) -> list[Choice]:
    _check_keys(table, ("each", "but", "pair_of", "severities", "phases"))
    drawn = table.get("phases", "drawn")
    if drawn not in ("drawn", "default"):
        raise InputError(f'phases is "drawn" or "default", not {quoted(drawn, 40)!r}')
    severities = [_severity(one) for one in _list(table.get("severities", list(draws.SEVERITIES)))]
    if not severities:
        return []
    if "pair_of" in table:
        names = _names(table["pair_of"])
        if len(names) < 2 or severities != list(range(severities[0], severities[-1] + 1)):
            raise InputError("pair_of needs two effects or more, and severities that are neighbours")
        return [Choice("two effects", lambda seed: draws.pair_of_effects(names, severities, seed))]
    names = [name for name in _names(table["each"]) if name not in _names(table.get("but", []))]
    return [
        Choice(f"{name}/{draws.SEVERITIES[severity]}", _of_the_library(name, severity, drawn == "drawn"))
        for name in names
        for severity in severities
    ]


def _of_the_library(name: str, severity: int, phase_drawn: bool) -> Callable[[int], Any]:
    if phase_drawn:
        return lambda seed: {name: draws.effect_of(name, severity, seed)}
    effect = CATALOGUE[name]
    return lambda seed: {name: effect.at_severity(severity)}


def _load(entry: Any, actuator: Actuator) -> list[Choice]:
    """N·m; {uniform = [low, high]}; {where_needed = N·m}: only where a hidden effect does nothing without a load"""
    if isinstance(entry, dict):
        if "uniform" in entry:
            low, high = _pair(_only(entry, "uniform"))
            return [Choice(f"load {low:g} … {high:g} N·m", lambda seed: draws.load(low, high, seed))]
        where = _number(_only(entry, "where_needed"))
        return [Choice(f"load {where:g} N·m where needed", lambda seed: ("where_needed", where))]
    value = _number(entry)
    return [_always(f"load {value:g} N·m", value)]


def _off_by(entry: Any, actuator: Actuator) -> list[Choice]:
    """{"motor.viscous_friction_Nms_rad" = 3e-5}: added to what the plant would have"""
    table = {path: _number(value) for path, value in _table(entry).items()}
    actuator.with_values({path: actuator.value(path) + 0.0 for path in _paths(table, actuator)})
    return [_always(" ".join(f"{path}+{value:g}" for path, value in table.items()) or "parameters as drawn", table)]


def _numbers(what: str, unit: str = "", low: float = 0.0) -> Reader:
    def read(entry: Any, actuator: Actuator) -> list[Choice]:
        value = _number(entry)
        if not value >= low:
            raise InputError(f"must be {low:g} or more, not {value:g}")
        return [_always(f"{what} {value:g} {unit}".rstrip(), value)]

    return read


def _bits(entry: Any, actuator: Actuator) -> list[Choice]:
    if isinstance(entry, bool) or not isinstance(entry, int) or not 0 <= entry <= 32:
        raise InputError(f"is a whole number from 0 to 32, not {quoted(entry, 40)!r}")
    return [_always(f"{entry} bits", entry)]


def check_count(sizes: Iterable[int]) -> None:
    """Raises InputError where a product of so many choices each has too many points."""
    if (count := math.prod(sizes)) > MOST_TASKS:
        raise InputError(f"has {count:.3g} points, and {MOST_TASKS} are the most; split it")


AXES: dict[str, Reader] = {
    "faults": _faults,
    "effects": _effects,
    "load_torque_Nm": _load,
    "off_by": _off_by,
    "tolerances": _numbers("tolerances ×"),
    "noise_A": _numbers("noise", "A"),
    "encoder_bits": _bits,
}
USUAL: dict[str, Any] = {
    "faults": {},
    "effects": {},
    "load_torque_Nm": 0.0,
    "off_by": {},
    "tolerances": 0.0,
    "noise_A": 0.0,
    "encoder_bits": 0,
}


def _always(label: str, value: Any) -> Choice:
    return Choice(label, lambda seed: value)


def _known(name: Any, named: Mapping[str, Callable[[int], Any]]) -> Callable[[int], Any]:
    if name not in named:
        raise InputError(f"no draw {quoted(name, 40)!r}; there are {', '.join(named)}")
    return named[name]


def _severity(name: Any) -> int:
    if name not in draws.SEVERITIES:
        raise InputError(f"no severity {quoted(name, 40)!r}; there are {', '.join(draws.SEVERITIES)}")
    return draws.SEVERITIES.index(name)


def _names(entry: Any) -> list[str]:
    """Effects of the library; all: those that do what no base parameter does, and that need no arm."""
    if entry == "all":
        return [name for name, effect in CATALOGUE.items() if not effect.duplicates and name != "pendulum_load"]
    for name in _list(entry):
        if name not in CATALOGUE:
            raise InputError(
                f"no effect {quoted(name, 60)!r}; effects are {', '.join(CATALOGUE)}{did_you_mean(name, CATALOGUE)}"
            )
    return entry


def _paths(table: Mapping[str, Any], actuator: Actuator) -> list[str]:
    known = [path for path in actuator.tolerances if not path.startswith("effects.")]
    for path in table:
        if path not in known:
            raise InputError(f"no parameter {quoted(path, 60)!r} with a tolerance; there are {listed(known)}")
    return list(table)


def _only(table: Mapping[str, Any], key: str) -> Any:
    _check_keys(table, (key,))
    if key not in table:
        raise InputError(f"needs {key}; it has {listed(table)}")
    return table[key]


def _check_keys(table: Mapping[str, Any], known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"has no {quoted(key, 60)!r}; it has {', '.join(known)}")


def _table(entry: Any) -> dict[str, Any]:
    if not isinstance(entry, dict):
        raise InputError(f"is a table {{name = value}}, or a list of such, not {quoted(entry, 40)!r}")
    return entry


def _list(entry: Any) -> list[Any]:
    if not isinstance(entry, list):
        raise InputError(f"takes a list, not {quoted(entry, 40)!r}")
    return entry


def _pair(entry: Any) -> tuple[float, float]:
    low, high = [_number(one) for one in entry] if isinstance(entry, list) and len(entry) == 2 else (1.0, 0.0)
    if not low <= high:
        raise InputError(f"takes [low, high], not {quoted(entry, 40)!r}")
    return low, high


def _number(entry: Any) -> float:
    value = as_number(entry)
    if not abs(value) < float("inf"):
        raise InputError(f"takes a number, not {quoted(entry, 40)!r}")
    return value
