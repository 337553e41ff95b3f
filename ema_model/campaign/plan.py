"""A plan: document, groups, loading."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from glob import escape, glob
from pathlib import Path
from typing import Any

import msgspec

from ema_model.actuator import Actuator, actuator_text, parse_actuator, shipped
from ema_model.campaign import task
from ema_model.campaign.data_sets import folder_of
from ema_model.campaign.kinds import KINDS
from ema_model.campaign.task import (
    AXES,
    MOST_TASKS,
    USUAL,
    Choice,
    Excitation,
    File,
    Recorded,
    Simulated,
    Task,
    check_count,
    choices_of,
    digest,
    run_of,
)
from ema_model.errors import InputError, quoted
from ema_model.files.opened import TEXT_BYTES, listed, open_user_file, shipped_folder
from ema_model.files.written import inline, toml_of, toml_text

# --- a plan's text: read over that of the plan that it is like, its entries checked, and written as one file ----------

_DEEPEST = 5  # plans that are like others


def document_of(path: Path, depth: int) -> dict[str, Any]:
    """The file's content over that of the plan that it is like."""
    try:
        with open_user_file(path, "a plan (.toml)", TEXT_BYTES) as file:
            document = toml_of(file.read().decode("utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{quoted(path)}: cannot be read as text (not UTF-8)") from None
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{quoted(path)}: not valid TOML: {quoted(error)}") from None
    like = document.pop("like", None)
    if like is None:
        return document
    if not isinstance(like, str) or depth >= _DEEPEST:
        raise InputError(f"{quoted(path)}: like is the name of another plan's file, which is not like this one in turn")
    other = document_of(path.parent / like, depth + 1)
    return _over(document, other)


def _over(above: dict[str, Any], below: dict[str, Any], depth: int = 0) -> dict[str, Any]:
    """Entries of `above` go before those of `below`, down to the entries of groups and runs."""
    whole = dict(below)
    for name, entry in above.items():
        both = isinstance(entry, dict) and isinstance(below.get(name), dict) and depth < 2
        whole[name] = _over(entry, below[name], depth + 1) if both else entry
    return whole


def plan_text(document: Mapping[str, Any], file: Path) -> str:
    """The whole plan as one file, with whole paths of what it names."""
    groups = {}
    for name, table in document["groups"].items():
        table = dict(table)
        if Path(table.get("actuator", "thesis")).suffix:
            table["actuator"] = str((file.parent / table["actuator"]).resolve())
        if "recordings" in table:
            beside = folder_of(table.pop("data")) if "data" in table else file.parent
            table["recordings"] = _whole_paths(table["recordings"], beside.resolve())
        groups[name] = table
    return toml_text({name: _at_the_top(one) for name, one in {**document, "groups": groups}.items()})


def _at_the_top(entry: Any) -> Any:
    """Tables of tables stay so, and what is in them stands on a line."""
    if not isinstance(entry, dict):
        return inline(entry)
    return {name: {key: inline(value) for key, value in table.items()} for name, table in entry.items()}


def _whole_paths(entry: Any, beside: Path) -> Any:
    if isinstance(entry, str):
        return str(Path(escape(str(beside))) / entry)
    if isinstance(entry, list):
        return [_whole_paths(one, beside) for one in entry]
    if "each" in entry:  # the others lie in those folders
        return {**entry, "each": _whole_paths(entry["each"], beside)}
    return {name: one if name == "label" else _whole_paths(one, beside) for name, one in entry.items()}


def check_names(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    """InputError for an entry that there is not."""
    for name in table:
        if name not in known:
            raise InputError(f"{where} has no {quoted(name, 60)!r}; it has {', '.join(known)}".strip())


def table_of(document: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    """A table of it, empty where it has none; InputError where that is something else."""
    found = document.get(name, {})
    if not isinstance(found, dict):
        raise InputError(f"{where} [{name}] must be a table")
    return found


# --- one group of a plan: the products of its axes, or its recordings, as tasks ---------------------------------------

_SHARED = ("does", "actuator", "seeds")
_SIMULATED = ("runs", "holdout", "load_recorded", "noise_seed_plus", "tolerances_of", *AXES)
_RECORDED = ("recordings", "data", "mapping")


class Group:
    """One group of a plan, checked; InputError, with its place in the plan, for whatever is wrong in it."""

    def __init__(self, name: str, table: dict[str, Any], runs: Mapping[str, Excitation], beside: Path, where: str):
        self.name, self._table, self._runs, self._beside, self._where = name, table, runs, beside, where
        if table.get("does") not in KINDS:
            raise InputError(f"{where} does = {quoted(table.get('does'), 40)!r} is not known; it is {_or(KINDS)}")
        self._kind = KINDS[table["does"]]
        options = [field.name for field in fields(self._kind.settings)]
        source = _RECORDED if "recordings" in table else _SIMULATED
        source = source if self._kind.from_recordings else ()
        check_names(table, (*_SHARED, *source, *options), where)
        self._text, self._actuator = self._told("actuator", self._actuator_file)
        self._recordings_in = self._told("data", lambda: folder_of(table["data"])) if "data" in table else beside
        self._seeds = self._told("seeds", lambda: _seeds(table.get("seeds", [0])))
        self._settings = self._told("", lambda: self._all_settings(options))
        if not self._kind.from_recordings:
            self._sources: list[tuple[str, Any]] = [("", lambda seed: None)]
        else:
            self._sources = self._recorded() if "recordings" in table else self._simulated()

    @property
    def count(self) -> int:
        """How many tasks it has."""
        return len(self._sources) * len(self._settings) * len(self._seeds)

    def tasks(self) -> Iterator[Task]:
        """In the order of its axes, the seed last."""
        for (label, source), (settings_label, settings) in itertools.product(self._sources, self._settings):
            case = " · ".join(filter(None, (label, settings_label)))
            for seed in self._seeds:
                made = self._told("", lambda: source(seed))  # noqa: B023 (called at once)
                yield Task(
                    kind=self._kind.name,
                    group=self.name,
                    case=case,
                    seed=seed,
                    actuator=self._text,
                    settings=settings,
                    simulated=made if isinstance(made, Simulated) else None,
                    recorded=made if isinstance(made, Recorded) else None,
                )

    def _told(self, what: str, read: Any) -> Any:
        """What `read` gives; its error says where."""
        try:
            return read()
        except InputError as error:
            raise InputError(f"{self._where} {what}{': ' if what else ''}{error}") from None

    def _actuator_file(self) -> tuple[str, Actuator]:
        name = self._table.get("actuator", "thesis")
        if not isinstance(name, str):
            raise InputError(f"is the name of a file (.toml), not {quoted(name, 40)!r}")
        if Path(name).suffix:
            text = actuator_text(self._beside / name)
        else:
            try:
                text = shipped(f"{name}.toml")
            except FileNotFoundError:
                raise InputError(f"no actuator {quoted(name)!r} is shipped; name a file (.toml)") from None
        return text, parse_actuator(text, name)

    def _all_settings(self, options: list[str]) -> list[tuple[str, dict[str, Any]]]:
        """All products of the kind's settings, with what tells them apart."""
        axes: list[list[tuple[str, str, Any]]] = []
        for name in options:
            if name in self._table:
                entries = self._table[name]
                entries = entries if isinstance(entries, list) else [entries]
                if not entries:
                    raise InputError(f"{name}: holds nothing, so that there is nothing to compute; give it a value")
                several = len(entries) > 1
                axes.append([(f"{name} {entry}" if several else "", name, entry) for entry in entries])
        check_count(map(len, axes))
        found = []
        for point in itertools.product(*axes):
            given = {name: value for _, name, value in point}
            try:
                settings = msgspec.convert(given, self._kind.settings)
            except msgspec.ValidationError as error:
                raise InputError(str(error).replace("`", "")) from None
            found.append((" · ".join(filter(None, (one[0] for one in point))), msgspec.to_builtins(settings)))
        return found

    def _recorded(self) -> list[tuple[str, Any]]:
        mapping = self._table.get("mapping", [])
        if not isinstance(mapping, list) or not all(isinstance(one, str) for one in mapping):
            raise InputError(f'{self._where} mapping: takes a list of texts such as "time_s=t[ms]"')
        entries = self._table["recordings"]
        found: list[tuple[str, Any]] = []
        for entry in entries if isinstance(entries, list) else [entries]:
            if isinstance(entry, str):
                sets = [([path], []) for path in self._files(entry)]
            elif isinstance(entry, dict):
                check_names(entry, ("each", "fit", "holdout", "label"), f"{self._where} recordings:")
                each = entry.get("each")
                folders = self._files(each) if isinstance(each, str) else [self._recordings_in]
                sets = [
                    tuple(self._all_files(entry.get(key, []), Path(folder)) for key in ("fit", "holdout"))
                    for folder in folders
                ]
            else:
                raise InputError(f"{self._where} recordings: takes names of files, or {{ fit = […], holdout = […] }}")
            for fit, holdout in sets:
                if not fit:
                    raise InputError(f"{self._where} recordings: a task needs one to fit")
                said = entry.get("label") if isinstance(entry, dict) else None
                label = str(said or " + ".join(os.path.relpath(path, self._recordings_in) for path in fit))
                source = Recorded(_digested(fit), _digested(holdout), tuple(mapping))
                found.append((label, lambda seed, source=source: source))
        if not found:
            raise InputError(f"{self._where} recordings: holds nothing, so that there is nothing to compute")
        return found

    def _all_files(self, patterns: Any, beside: Path) -> list[str]:
        if not isinstance(patterns, list) or not all(isinstance(one, str) for one in patterns):
            raise InputError(f"{self._where} recordings: fit and holdout take lists of files' names")
        return [path for pattern in patterns for path in self._files(pattern, beside)]

    def _files(self, pattern: str, beside: Path | None = None) -> list[str]:
        """Whole paths; InputError where there are none."""
        folder = (beside or self._recordings_in).resolve()
        found = sorted(str(folder / path) for path in glob(pattern, root_dir=folder, recursive=True))
        if not found:
            where = "beside the plan" if folder == self._beside.resolve() else f"in {quoted(folder, 300)}"
            raise InputError(f"{self._where} recordings: no file {quoted(pattern)!r} {where}")
        return found

    def _simulated(self) -> list[tuple[str, Any]]:
        table = self._table
        axes: dict[str, list[Choice]] = {"runs": self._told("runs", self._run_choices)}
        for name in AXES:
            entry = table.get(name, USUAL[name])
            axes[name] = self._told(name, lambda: choices_of(name, entry, self._actuator))  # noqa: B023 (called at once)
        holdout = self._told("holdout", lambda: self._named_runs(table.get("holdout", [])))
        which = table.get("tolerances_of", "free")
        if which not in ("free", "all"):
            raise InputError(f'{self._where} tolerances_of: is "free" or "all", not {quoted(which, 40)!r}')
        load_recorded, plus = table.get("load_recorded", True), table.get("noise_seed_plus", 0)
        if not isinstance(load_recorded, bool) or isinstance(plus, bool) or not isinstance(plus, int) or plus < 0:
            raise InputError(f"{self._where} load_recorded is true or false, noise_seed_plus a whole number from 0")
        several = [name for name, choices in axes.items() if len(choices) > 1]
        drawn = [name for name in ("faults", "effects") if table.get(name, USUAL[name]) != USUAL[name]]
        shown = [name for name in axes if name in several or name in drawn]

        def source(point: Mapping[str, Choice], seed: int) -> Simulated:
            value = {name: choice.at(seed) for name, choice in point.items()}
            load, effects = value["load_torque_Nm"], value["effects"]
            if isinstance(load, tuple):
                load = load[1] if set(effects) & set(task.NEEDS_LOAD) else 0.0
            values = {}
            if value["tolerances"]:
                values = task.base_parameters(self._actuator, which, value["tolerances"], seed)
            for path, more in value["off_by"].items():
                values[path] = values.get(path, self._actuator.value(path)) + more
            self._actuator.with_values(values)  # a draw can be impossible
            return Simulated(
                runs=value["runs"],
                holdout=holdout,
                faults=value["faults"],
                values=values,
                effects=effects,
                load_torque_Nm=load,
                load_recorded=load_recorded,
                noise_A=value["noise_A"],
                encoder_bits=value["encoder_bits"],
                noise_seed=seed + plus,
            )

        self._told("", lambda: check_count(map(len, axes.values())))
        found = []
        for choices in itertools.product(*axes.values()):
            point = dict(zip(axes, choices))
            label = " · ".join(point[name].label for name in shown)
            found.append((label, lambda seed, point=point: source(point, seed)))
        return found

    def _run_choices(self) -> list[Choice]:
        entries = self._table.get("runs", [])
        entries = entries if isinstance(entries, list) else [entries]
        if not entries:
            raise InputError("holds nothing, so that there is nothing to compute; name some of [runs]")
        found = []
        for entry in entries:
            names = entry if isinstance(entry, list) else [entry]
            chosen = self._named_runs(names)
            found.append(Choice(" + ".join(map(str, names)), lambda seed, chosen=chosen: chosen))
        return found

    def _named_runs(self, names: Any) -> tuple[Excitation, ...]:
        names = names if isinstance(names, list) else [names]
        for name in names:
            if not isinstance(name, str) or name not in self._runs:
                raise InputError(f"no run {quoted(name, 60)!r}; [runs] has {listed(self._runs)}")
        return tuple(self._runs[name] for name in names)


def _digested(paths: list[str]) -> tuple[File, ...]:
    return tuple(File(path, digest(path)) for path in paths)


def excitation_of(table: Any, where: str) -> Excitation:
    """One of a plan's [runs]."""
    if not isinstance(table, dict) or not isinstance(table.get("command"), str):
        raise InputError(f'{where} needs command = "chirp", or another command\'s name, and its settings')
    own = ("command", "duration_s", "sample_rate_Hz")
    numbers = {key: table[key] for key in own[1:] if key in table}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{where} {key}: takes a number, not {quoted(value, 40)!r}")
    settings = {key: value for key, value in table.items() if key not in own}
    one = Excitation(table["command"], settings, **{key: float(value) for key, value in numbers.items()})
    try:
        run_of(one, 0.0)
    except InputError as error:
        raise InputError(f"{where} {error}") from None
    return one


def _seeds(entry: Any) -> list[int]:
    if isinstance(entry, dict):
        check_names(entry, ("from", "count"), "")
        first, count = entry.get("from", 0), entry.get("count", 0)
        if not isinstance(first, int) or not isinstance(count, int):
            raise InputError("takes whole numbers from 0, or { from = 0, count = 100 }")
        check_count([count])
        entry = list(range(first, first + count))
    entry = entry if isinstance(entry, list) else [entry]
    if not entry:
        raise InputError("holds nothing, so that there is nothing to compute; give it a value")
    if not all(isinstance(one, int) and not isinstance(one, bool) and 0 <= one < 2**62 for one in entry):
        raise InputError("takes whole numbers from 0, or { from = 0, count = 100 }")
    return entry


def _or(names: Mapping[str, Any]) -> str:
    return " or ".join(names)


# --- plans from files: what is in one, and which come with the package ------------------------------------------------

_ENTRIES = ("schema", "title", "about", "like", "runs", "groups")


@dataclass(frozen=True)
class Plan:
    """What a campaign computes."""

    title: str
    about: str
    text: str  # a file that gives the same plan, wherever it lies
    tasks: tuple[Task, ...]


def load_plan(path: str | os.PathLike[str]) -> Plan:
    """The plan of a file, or the shipped one of that name; InputError, one line, for whatever is wrong in it.

    Files that it names lie beside it, unless their paths are whole.
    """
    file = plan_path(path)
    document = document_of(file, 0)
    check_names(document, _ENTRIES, f"{quoted(file)}:")
    if document.get("schema", 1) != 1:
        raise InputError(f"{quoted(file)}: schema {quoted(document['schema'], 40)} is not known; this reads schema 1")
    groups = table_of(document, "groups", f"{quoted(file)}:")
    if not groups:
        raise InputError(f"{quoted(file)}: has no [groups.NAME]; each says what is to be computed")
    runs = {}
    for name, table in table_of(document, "runs", f"{quoted(file)}:").items():
        where = f"{quoted(file)}: [runs.{quoted(name)}]"
        runs[name] = excitation_of(table, where)
    tasks: list[Task] = []
    for name, table in groups.items():
        where = f"{quoted(file)}: [groups.{quoted(name)}]"
        if not isinstance(table, dict):
            raise InputError(f"{where} must be a table")
        group = Group(name, table, runs, file.parent, where)
        if (count := len(tasks) + group.count) > MOST_TASKS:
            raise InputError(f"{where} takes the plan to {count} tasks, and {MOST_TASKS} are the most; split it")
        tasks += group.tasks()
    title, about = (str(document.get(key, usual)) for key, usual in (("title", file.stem), ("about", "")))
    return Plan(title, about, plan_text(document, file), tuple(tasks))


def plan_path(path: str | os.PathLike[str]) -> Path:
    """Where a plan lies: the file, or, of a name without a suffix, the one that is shipped under it."""
    given = Path(path)
    if given.suffix or given.exists():
        return given
    known = shipped_plans()
    if str(given) not in known:
        raise InputError(f"no plan {quoted(given)!r}; shipped are {', '.join(known)}, or name a file (.toml)")
    return known[str(given)]


def shipped_plans() -> dict[str, Path]:
    """The plans that come with the package (assets/plans), by name."""
    return {path.stem: path for path in sorted(shipped_folder("plans").glob("*.toml"))}
