"""A task: all that one computation depends on, what it works on, a plan's axes that it is drawn along, and its kind."""

from __future__ import annotations

import hashlib
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import msgspec
import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.actuator.file import parse_actuator
from ema_model.commands import command
from ema_model.effects import CATALOGUE, find
from ema_model.effects.effect import Effect
from ema_model.effects.user.torque import kind_of, read_entries
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation import default_free
from ema_model.faults import vector
from ema_model.files.opened import listed, open_user_file
from ema_model.quantities import as_number
from ema_model.recordings import Measurement, find_side_file, read
from ema_model.recordings.measurement import Sensors
from ema_model.recordings.recording_set import check_held_out
from ema_model.simulation.plant import simulate
from ema_model.simulation.run import Run

_NAME_DIGITS = 24  # of the hash: two of a million tasks share a name once in 1e17 campaigns


@dataclass(frozen=True)
class Excitation:
    """What a simulated recording is made with: a command of the library, at rest at its start."""

    command: str
    settings: dict[str, Any] = field(default_factory=dict)
    duration_s: float = 0.5
    sample_rate_Hz: float = 10_000.0


@dataclass(frozen=True)
class Simulated:
    """A plant, drawn already, and the sensors that record it."""

    runs: tuple[Excitation, ...]
    holdout: tuple[Excitation, ...] = ()
    faults: dict[str, float] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)  # base parameters in which it differs from its file
    effects: dict[str, dict[str, Any]] = field(default_factory=dict)  # as an actuator file has them
    load_torque_Nm: float = 0.0
    load_recorded: bool = True
    noise_A: float = 0.0
    encoder_bits: int = 0
    noise_seed: int = 0


@dataclass(frozen=True)
class File:
    """A recording as it was when the task was made."""

    path: str
    digest: str  # of its content, and its side file's


@dataclass(frozen=True)
class Recorded:
    """Recordings of one actuator."""

    files: tuple[File, ...]
    holdout: tuple[File, ...] = ()
    mapping: tuple[str, ...] = ()


@dataclass(frozen=True)
class Task:
    """One computation.  What it gives depends on nothing else, but for the version of the program."""

    kind: str  # of `ema_model.campaign.kinds`
    group: str
    case: str  # what tells it from the others of its group, but for the seed
    seed: int
    actuator: str  # the text of the file
    settings: dict[str, Any]  # of the kind
    simulated: Simulated | None = None
    recorded: Recorded | None = None

    @cached_property
    def name(self) -> str:
        """A hash of all of it."""
        return hashlib.sha256(msgspec.json.encode(self, order="sorted")).hexdigest()[:_NAME_DIGITS]

    def as_json(self) -> str:
        """All of it, but of the actuator's file only the hash under which the campaign keeps it."""
        return msgspec.json.encode(replace(self, actuator=text_hash(self.actuator)), order="sorted").decode()


def text_hash(text: str) -> str:
    """The name under which a campaign keeps an actuator's file."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def from_json(text: str, actuators: dict[str, str]) -> Task:
    """The inverse of `Task.as_json`; actuators: the files' texts by their hash."""
    task = msgspec.json.decode(text, type=Task)
    return replace(task, actuator=actuators[task.actuator])


# --- what is drawn at random for a task, each from its seed alone: plants, faults, effects, loads ---------------------

SEVERITIES = ("slight", "clear", "strong")
NEEDS_LOAD = ("gear_load_friction", "load_dependent_friction")  # do nothing to an actuator without a load
_TEETH = 12.0  # the order of what is periodic
_FAULTS_ALONE = ("k1", "k2", "k3", "k6", "k8")
_BESIDE = ("cogging_torque", "stribeck_friction", "hinge_moment", "asymmetric_friction", "position_sensor_delay")


def base_parameters(actuator: Actuator, which: str, scale: float, seed: int) -> dict[str, float]:
    """Values drawn about the file's, normal with `scale` σ of their tolerances; the sensors' are left.

    which: "free", those that a calibration moves; or "all", within 3 σ.
    """
    if which == "free":
        random = np.random.default_rng(seed)
        paths = [path for path in default_free(actuator) if not path.startswith("sensors.")]
        size = {path: float(random.standard_normal()) for path in paths}
    else:
        random = np.random.default_rng([seed, 78])
        paths = [path for path in actuator.tolerances if not path.startswith("sensors.")]
        size = {path: float(np.clip(random.standard_normal(), -3.0, 3.0)) for path in paths}
    return {path: actuator.value(path) + scale * actuator.tolerances[path].sigma * size[path] for path in paths}


def load(low: float, high: float, seed: int) -> float:
    """N·m, uniform."""
    return float(np.random.default_rng([seed, 79]).uniform(low, high))


def uniform_faults(ranges: Mapping[str, Sequence[float]], seed: int) -> dict[str, float]:
    """Each k uniform in its own range."""
    random = np.random.default_rng([seed, 80])
    return {name: float(random.uniform(low, high)) for name, (low, high) in ranges.items()}


def worn(seed: int) -> dict[str, float]:
    """k1, k2, k6 and one shorted phase from U(0, 0.5), k7 from U(0, 1), k8 from U(0.2, 0.8)."""
    random = np.random.default_rng([seed, 77])
    k = faults.HEALTHY.copy()
    k[[0, 1, 5]] = random.uniform(0.0, 0.5, 3)
    k[2 + random.integers(3)] = random.uniform(0.0, 0.5)
    k[6], k[7] = random.random(), random.uniform(0.2, 0.8)
    return faults.named(k)


def one_fault(seed: int) -> dict[str, float]:
    """One fault of 0.15 … 0.6 (the gain to either side); which one follows from the seed."""
    return _one_fault(seed)[0]


def one_effect_beside(seed: int) -> dict[str, dict[str, Any]]:
    """A clear effect for the plant of `one_fault`, of any phase; which one follows from the seed."""
    random = _one_fault(seed)[1]
    effect = CATALOGUE[_BESIDE[(seed // len(_FAULTS_ALONE)) % len(_BESIDE)]]
    settings = {effect.parameters[0].name: effect.severities[1]}
    if effect.is_periodic:
        settings |= {"order": _TEETH, "phase_rad": float(random.uniform(-3.0, 3.0))}
    return {effect.name: settings}


def effect_of(name: str, severity: int, seed: int) -> dict[str, float]:
    """An effect's settings at a severity; what is periodic has the teeth's order and any phase."""
    effect = CATALOGUE[name]
    settings = {effect.parameters[0].name: effect.severities[severity]}
    if _has_order(effect):
        settings |= {"order": _TEETH, "phase_rad": float(np.random.default_rng(seed).uniform(-3.0, 3.0))}
    return settings


def pair_of_effects(names: Sequence[str], severities: Sequence[int], seed: int) -> dict[str, dict[str, float]]:
    """Two of these effects, each of one of these neighbouring severities."""
    random = np.random.default_rng(seed)
    chosen = [str(name) for name in random.choice(list(names), 2, replace=False)]
    drawn = {name: int(random.integers(severities[0], severities[-1] + 1)) for name in chosen}
    return {name: effect_of(name, severity, seed) for name, severity in drawn.items()}


FAULTS: dict[str, Callable[[int], dict[str, float]]] = {"worn": worn, "one": one_fault}
EFFECTS: dict[str, Callable[[int], dict[str, dict[str, Any]]]] = {"one_beside_a_fault": one_effect_beside}


def _has_order(effect: Effect) -> bool:
    return "order" in {parameter.name for parameter in effect.parameters}


def _one_fault(seed: int) -> tuple[dict[str, float], np.random.Generator]:
    random = np.random.default_rng(seed)
    name = _FAULTS_ALONE[seed % len(_FAULTS_ALONE)]
    size = float(random.uniform(0.15, 0.6))
    found = {name: 0.5 + 0.5 * float(random.choice([-1.0, 1.0])) * size if name == "k8" else size}
    if name == "k6":
        found["k7"] = float(random.uniform(0.1, 0.9))
    return found, random


# --- what a task works on: its actuator and its recordings, read or simulated -----------------------------------------

_PIECE = 1 << 20
_NEXT_NOISE = 7  # from one recording's seed to the next one's


@dataclass(frozen=True)
class TaskInputs:
    """What a kind of task gets."""

    actuator: Actuator  # as its file says: what is fitted
    fitted: list[Measurement]
    held: list[Measurement]
    truth: NDArray[Any] | None = None  # (8,), of a simulated plant
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # hidden in it


def inputs_of(task: Task) -> TaskInputs:
    """Reads or simulates; InputError and FloatingPointError as those do."""
    actuator = _actuator(task.actuator)
    if task.recorded is not None:
        fitted, held = (
            [_read(file, actuator, task.recorded.mapping) for file in files]
            for files in (task.recorded.files, task.recorded.holdout)
        )
        check_held_out(fitted, held)
        return TaskInputs(actuator, fitted, held)
    if task.simulated is None:
        return TaskInputs(actuator, [], [])
    source = task.simulated
    fitted, held = (recorded(source, runs, actuator) for runs in (source.runs, source.holdout))
    check_held_out(fitted, held)
    return TaskInputs(actuator, fitted, held, vector(source.faults), effects_of(source.effects))


def recorded(source: Simulated, runs: Sequence[Excitation], actuator: Actuator) -> list[Measurement]:
    """Recordings of the plant; every one of a list has noise of its own."""
    plant = actuator.with_values(source.values)
    sensors, effects = Sensors(source.noise_A, source.encoder_bits), effects_of(source.effects)
    found = []
    for i, one in enumerate(runs):
        clean = simulate(run_of(one, source.load_torque_Nm), plant, vector(source.faults), effects)
        if not source.load_recorded:
            clean = replace(clean, signals={n: y for n, y in clean.signals.items() if n != "load_torque_Nm"})
        found.append(sensors.record(clean, source.noise_seed + _NEXT_NOISE * i))
    return found


def run_of(one: Excitation, load_torque_Nm: float) -> Run:
    """The run as the simulation takes it; InputError for names and values that it does not."""
    return Run(command(one.command, one.settings), one.duration_s, one.sample_rate_Hz, load_torque_Nm)


def effects_of(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Settings by effect; a user's own are registered.  InputError for names and values that there are not."""
    effects = {}
    for name, table in tables.items():
        kind = kind_of(name)
        effect, numbers = (find(name), dict(table)) if kind is None else read_entries(kind, table)
        effects[effect.name] = effect.settings(numbers)
    return effects


def digest(path: str) -> str:
    """Of a recording and its side file; InputError where one is no file."""
    whole = hashlib.sha256()
    for one in filter(None, (path, find_side_file(path))):
        with open_user_file(one, "the file of a measurement") as file:
            while piece := file.read(_PIECE):
                whole.update(piece)
    return whole.hexdigest()[:16]


def _read(file: File, actuator: Actuator, mapping: Sequence[str]) -> Measurement:
    if digest(file.path) != file.digest:
        raise InputError(f"{file.path}: has changed since the campaign was planned; run it again into a new folder")
    return read(file.path, actuator, mapping)


@lru_cache(maxsize=16)
def _actuator(text: str) -> Actuator:
    return parse_actuator(text, "the campaign's actuator")


# --- the axes of a plan's group: what each of its entries may be, and the choices that they stand for -----------------
# An entry is one choice, or a list of them, which makes it an axis. What is drawn at random is a choice too: a table
# that says how, drawn anew from each seed.

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
        return [Choice(f"{name} faults", _known(name, FAULTS))]
    if "uniform" in table:
        ranges = {name: _pair(one) for name, one in _table(_only(table, "uniform")).items()}
        for ends in zip(*ranges.values()):
            faults.vector(dict(zip(ranges, ends)))
        return [Choice("uniform faults", lambda seed: uniform_faults(ranges, seed))]
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
        return [Choice(f"effect {name}", _known(name, EFFECTS))]
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
    severities = [_severity(one) for one in _list(table.get("severities", list(SEVERITIES)))]
    if not severities:
        return []
    if "pair_of" in table:
        names = _names(table["pair_of"])
        if len(names) < 2 or severities != list(range(severities[0], severities[-1] + 1)):
            raise InputError("pair_of needs two effects or more, and severities that are neighbours")
        return [Choice("two effects", lambda seed: pair_of_effects(names, severities, seed))]
    names = [name for name in _names(table["each"]) if name not in _names(table.get("but", []))]
    return [
        Choice(f"{name}/{SEVERITIES[severity]}", _of_the_library(name, severity, drawn == "drawn"))
        for name in names
        for severity in severities
    ]


def _of_the_library(name: str, severity: int, phase_drawn: bool) -> Callable[[int], Any]:
    if phase_drawn:
        return lambda seed: {name: effect_of(name, severity, seed)}
    effect = CATALOGUE[name]
    return lambda seed: {name: effect.at_severity(severity)}


def _load(entry: Any, actuator: Actuator) -> list[Choice]:
    """N·m; {uniform = [low, high]}; {where_needed = N·m}: only where a hidden effect does nothing without a load"""
    if isinstance(entry, dict):
        if "uniform" in entry:
            low, high = _pair(_only(entry, "uniform"))
            return [Choice(f"load {low:g} … {high:g} N·m", lambda seed: load(low, high, seed))]
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
    if name not in SEVERITIES:
        raise InputError(f"no severity {quoted(name, 40)!r}; there are {', '.join(SEVERITIES)}")
    return SEVERITIES.index(name)


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


# --- what a kind of task declares -------------------------------------------------------------------------------------

TEXT, NUMBER, FLAG = pa.string(), pa.float64(), pa.bool_()
TEXTS, NUMBERS = pa.list_(pa.string()), pa.list_(pa.float64())

COMMON = pa.schema(
    [
        ("name", TEXT),  # of the task
        ("group", TEXT),
        ("case", TEXT),
        ("seed", pa.int64()),
        ("error", TEXT),  # null where the task has its answer; the kind's columns are null beside one
        ("k_true", NUMBERS),  # (8,), of a simulated plant
        ("hidden", TEXTS),  # effects of the plant that the model lacks
        ("files", TEXTS),  # the recordings that were fitted
        ("task", TEXT),  # all of it, so that it can be computed again
    ]
)
HOW = pa.schema(  # how a row came about, which is another each time: in the parts, not in the tables
    [
        ("elapsed_s", NUMBER),
        ("answer_s", NUMBER),  # of an identification itself, without compiling and without making its recordings
        ("worker", TEXT),
        ("memory_MB", NUMBER),
        ("finished_s", NUMBER),
    ]
)


@dataclass(frozen=True)
class Kind:
    """A kind of task.

    run(inputs, settings, seed) gives a value for each of `columns`, which depends on its arguments only, and of `HOW`
    what it knows; it raises InputError or FloatingPointError for what cannot be computed.
    """

    title: str
    settings: type[Any]  # a frozen dataclass: each field is an option of a plan's group, and may be an axis
    columns: pa.Schema
    run: Callable[[TaskInputs, Any, int], dict[str, Any]]
    seconds: Callable[[Any], float]  # about how long one takes on one core, from its settings
    told: Callable[[list[dict[str, Any]]], dict[str, Any]]  # what rows without errors say together, by its title
    from_recordings: bool = True  # else it makes all that it needs from its settings and the seed
    name: str = ""  # in plans; `KINDS` fills it in

    @property
    def schema(self) -> pa.Schema:
        """Of its table."""
        return pa.schema([*COMMON, *self.columns])
