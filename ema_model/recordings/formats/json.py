"""JSON: records, columns, and the logs of servos."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import msgspec
import numpy as np

from ema_model.files.opened import ARRAYS, RUNS, shown
from ema_model.recordings.column_names import is_time
from ema_model.recordings.formats.channels import RUN, Channel, Log, Matrix, NoLog, in_columns, log_format

# --- JSON logs --------------------------------------------------------------------------------------------------------
# Records, one a line or in a list, or columns as lists, at any depth; single numbers are parameters.
# A record may be a sample, or a run with a list for each signal: {"data": [{"type": "step", "actions": […], …}, …]}.

_DEEPEST = 8
_FEWEST = 2  # numbers that make a column
_SHORTEST_RUN = 20  # samples, by which a list of them is told from the parts of one
_KINDS = ("type", "name", "kind", "id")  # keys under which a run says what it is
_MOST_NAMED = 12
_SPLIT = {"columns", "data"}  # pandas' "split": names, and rows of numbers


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """What the document holds; NoLog for what is no JSON, or no log."""
    del most_bytes  # the file's own size is bounded, and the process's memory
    with open(path, "rb") as file:
        text = file.read()
    text = text.removeprefix(b"\xef\xbb\xbf").strip()
    try:
        document = decoded(text)
    except ValueError as error:
        document = _lines(text, error)
    except RecursionError:
        raise NoLog("it is nested too deeply") from None
    title = ""
    if is_one(document):
        title, document = servo_title(document), with_units(document)
    found = _Found()
    found.walk(document, ())
    channels, aside = in_columns(found.channels)
    yield Log(
        channels,
        parameters=found.parameters,
        notes=tuple(found.notes),
        left_aside=tuple(dict.fromkeys((*found.aside, *aside))),
        title=title,
    )


def numbers_of_records(records: Sequence[Any]) -> list[tuple[tuple[str, ...], Any]]:
    """What records have numbers under, all of them: the keys' path, and the numbers (n,)."""
    found = _Found()
    found.walk(list(records), ())
    return [(channel.path, np.asarray(channel.values())) for channel in in_columns(found.channels)[0]]


def decoded(text: bytes) -> Any:
    """A document, also with the NaN and Infinity that Python writes and JSON has not; ValueError for what is none."""
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        if b"NaN" not in text and b"Infinity" not in text:
            raise
        return json.loads(text)


def _lines(text: bytes, error: Exception) -> Any:
    """Records of which each has a line; what was wrong with the whole otherwise."""
    first = text.split(b"\n", 1)[0].strip()
    if not (first.startswith(b"{") and first.endswith(b"}")):
        raise NoLog(str(error)) from None
    try:
        try:
            return msgspec.json.Decoder().decode_lines(text)
        except msgspec.DecodeError:
            return [decoded(line) for line in text.splitlines() if line.strip()]
    except (ValueError, RecursionError) as problem:
        raise NoLog(str(problem)) from None


class _Found:
    """Collects what is in a document."""

    def __init__(self) -> None:
        self.channels: list[Channel | Matrix] = []
        self.parameters: dict[str, float] = {}
        self.aside: list[str] = []
        self.notes: list[str] = []
        self.begin: Any = None  # the first stamp that there is: all count from it

    def walk(self, item: Any, path: tuple[str, ...]) -> None:
        """Adds what an item holds."""
        if len(self.channels) + len(self.aside) > ARRAYS:
            raise NoLog(f"it holds over {ARRAYS} rows of numbers")
        if isinstance(item, dict):
            if item.keys() >= _SPLIT and isinstance(item["data"], list) and isinstance(item["columns"], list):
                if self._rows(item["data"], path or ("data",), [str(name) for name in item["columns"]]):
                    return
            if len(path) > _DEEPEST:
                self.aside.append(".".join(path))
                return
            if path and len(item) > _FEWEST and (column := _indexed(item)) is not None:
                self._list(column, path)
                return
            for name, inner in item.items():
                self.walk(inner, (*path, name))
        elif isinstance(item, list):
            self._list(item, path)
        elif isinstance(item, (int, float)) and not isinstance(item, bool):
            self.parameters[".".join(path) or "value"] = _number(item)
        elif item is not None and path:
            self.aside.append(".".join(path))

    def _list(self, items: list[Any], path: tuple[str, ...]) -> None:
        name = ".".join(path) or "list"
        is_run = len(items) == 1 and isinstance(items[0], dict) and _are_runs(items)
        if len(items) < _FEWEST and not is_run:
            self.aside.append(name)
        elif isinstance(items[0], dict):
            self._records(items, path)
        elif isinstance(items[0], list):
            if not self._rows(items, path or ("data",), ()):
                self.aside.append(name)
        elif (values := self._numbers(items)) is not None:
            self.channels.append(Channel(path or ("list",), len(items), lambda: values))
        else:
            self.aside.append(name)

    def _records(self, records: list[Any], path: tuple[str, ...]) -> None:
        """A column for each key that all records have a number under; of inner objects too."""
        if not all(isinstance(record, dict) for record in records):
            self.aside.append(".".join(path) or "list")
            return
        if _are_runs(records) and self._runs(records):
            return
        for key, first in records[0].items():
            inner = [record.get(key) for record in records]
            if isinstance(first, dict):
                self._records(inner, (*path, key))
            elif isinstance(first, list) and all(isinstance(one, list) and len(one) == len(first) for one in inner):
                if not self._rows(inner, (*path, key), [f"{key}.{i}" for i in range(len(first))]):
                    self.aside.append(key)
            elif (values := self._numbers(inner)) is not None:
                self.channels.append(Channel((*path, key), len(inner), lambda values=values: values))
            else:
                self.aside.append(key)

    def _runs(self, records: list[dict[str, Any]]) -> bool:
        """Records that are runs, one after the other, and a column of their numbers; False where nothing is shared."""
        runs: list[dict[tuple[str, ...], Channel]] = []
        for record in records:
            found = _Found()
            found.begin = self.begin
            found.walk(record, ())
            self.begin = self.begin if self.begin is not None else found.begin
            channels, _ = in_columns(found.channels)
            lengths = Counter(one.samples for one in channels)
            samples = max(lengths, key=lambda length: lengths[length], default=0)
            runs.append({one.path: one for one in channels if one.samples == samples})
        shared = [path for path in runs[0] if all(path in run for run in runs)]
        if len(shared) < _FEWEST:
            return False
        sizes = [run[shared[0]].samples for run in runs]
        for path in shared:
            values = np.concatenate([np.asarray(run[path].values(), np.float64) for run in runs])
            self.channels.append(Channel(path, values.size, lambda values=values: values))
        numbers = np.repeat(np.arange(1.0, len(runs) + 1.0), sizes)
        self.channels.append(Channel((RUN,), numbers.size, lambda: numbers, holds=True))
        single = {path[0] for path in shared}
        self.aside += [key for key in records[0] if key not in single]
        kinds = [next((one[key] for key in _KINDS if isinstance(one.get(key), str)), "") for one in records]
        told = [f"{i} is {shown(kind, 30)}" for i, kind in enumerate(kinds, 1) if kind][:_MOST_NAMED]
        more = f": {', '.join(told)}{', …' if len(runs) > len(told) else ''}" if told else ""
        self.notes.append(f"a run a record, {len(runs)} in all{more}")
        return True

    def _rows(self, rows: list[Any], path: tuple[str, ...], names: Sequence[str]) -> bool:
        """Rows of numbers as a table; False if they are none, or of different widths."""
        try:
            values = np.array(rows, np.float64)
        except (TypeError, ValueError, OverflowError):
            return False
        if values.size == 0:
            return False
        if names and values.ndim == 2 and values.shape[1] == len(names):
            self.channels += [
                Channel((*path, name), values.shape[0], lambda i=i: values[:, i]) for i, name in enumerate(names)
            ]
            return True
        values = np.squeeze(values)
        if values.ndim == 1 and values.size > 1:
            self.channels.append(Channel(path, values.size, lambda: values))
        elif values.ndim == 2:
            self.channels.append(Matrix(path, values.shape, lambda: values))
        return values.ndim in (1, 2)

    def _numbers(self, items: Sequence[Any]) -> Any:
        """The numbers, truth being 0 and 1, stamps of date and time seconds; None for anything else, and for blanks."""
        kinds = set(map(type, items))
        if kinds <= {int, float, bool}:
            try:
                return np.fromiter(items, np.float64, len(items))
            except OverflowError:
                return None
        if kinds == {str}:
            try:
                stamps = np.array([text.removesuffix("Z") for text in items], "datetime64[ns]").astype(np.int64)
            except ValueError:
                return None
            self.begin = stamps[0] if self.begin is None else self.begin
            return (stamps - self.begin) * 1e-9
        return None


def _are_runs(records: Sequence[dict[str, Any]]) -> bool:
    """Whether each record has lists as long as each other, long ones, and no time of its own as a sample has."""
    if not 0 < len(records) <= RUNS:
        return False
    for record in records:
        lengths = Counter(len(value) for value in record.values() if isinstance(value, list))
        if max((count for length, count in lengths.items() if length >= _SHORTEST_RUN), default=0) < _FEWEST:
            return False
        if any(isinstance(value, (int, float)) and is_time(key) for key, value in record.items()):
            return False
    return True


def _indexed(item: dict[str, Any]) -> list[Any] | None:
    """The values of an object that is a list in disguise, as pandas writes columns: {"0": 1.5, "1": 1.7}."""
    if all(name == str(i) for i, name in enumerate(item)):
        return list(item.values())
    return None


def _number(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf")


FORMAT = log_format(opened, "JSON", ".json", ".jsonl", ".ndjson", doubtful=(".json",))


# --- the logs of servos on a pendulum by Rhoban/bam (github.com/Rhoban/bam, bam/xl330/record.py …) --------------------
# One object: the rig's mass, length, kp, vin, motor and trajectory, and `entries`, a record for each sample.  Units
# stand in the recorder's source alone: position, speed and goal in radians, `load` as a ratio or, in its logs of
# January 2026 (bam/data.bak/raw at commit af22604), as the register that holds counts of the PWM's limit: 65 535 stands
# for −1.

_UNITS = {
    "timestamp": "s",
    "position": "rad",
    "goal_position": "rad",
    "speed": "rad/s",
}
_SIGNALS = {"input_volts": "bus_voltage_V", "temp": "temperature_C", "torque_enable": "drive_enabled"}
_PWM_LIMITS = {"xl330": 885, "xl330i": 885}  # counts of the full duty; of the XL330's control table
_REGISTER = 1 << 16  # values of a register with a sign, written as it stands
_KEYS = {"mass", "length", "kp", "motor", "entries"}


def is_one(document: Any) -> bool:
    """Whether it is such a log."""
    if not isinstance(document, dict) or not document.keys() >= _KEYS:
        return False
    entries = document["entries"]
    return isinstance(entries, list) and bool(entries) and isinstance(entries[0], dict) and "position" in entries[0]


def with_units(document: dict[str, Any]) -> dict[str, Any]:
    """The log as columns with the units in their names, and the duty as a ratio where the motor's limit is known."""
    entries = [entry for entry in document["entries"] if isinstance(entry, dict)]
    columns = {key: [entry.get(key) for entry in entries] for key in entries[0]}
    limit = _PWM_LIMITS.get(document["motor"]) if isinstance(document["motor"], str) else None
    names = _SIGNALS | {name: f"{name} [{unit}]" for name, unit in _UNITS.items()}
    if limit and (duties := _duties(columns.get("load", [None]), limit)):
        columns["load"], names["load"] = duties, "duty"
    return {**document, "entries": {names.get(key, key): values for key, values in columns.items()}}


def _duties(loads: list[Any], limit: int) -> list[float]:
    """The loads as ratios of the limit; nothing where some are none, as between counts of which the sign was lost."""
    if not all(isinstance(load, (int, float)) for load in loads):
        return []
    if all(abs(load) <= 1.0 for load in loads):  # as later versions of the recorder write them
        return [float(load) for load in loads]
    counts = [load - _REGISTER if load >= _REGISTER // 2 else load for load in loads]
    return [count / limit for count in counts] if all(abs(count) <= limit for count in counts) else []


def servo_title(document: dict[str, Any]) -> str:
    """What tells one such log from another: "xl330 kp400 sin_sin"."""
    parts = (document["motor"], f"kp{document['kp']}", document.get("trajectory", ""))
    return " ".join(str(part) for part in parts)[:100]
