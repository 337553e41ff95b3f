"""What a recording is called, what it says of itself, and what is wrong with one."""

from __future__ import annotations

import itertools
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.files.written import FileLock, lock_path
from ema_model.quantities import amount, in_sentence, number, parameter_title, unit_of
from ema_model.text import Facts


class RecordingError(OSError):
    """A recording cannot be written, read, repaired or shown.  Its message is one line: what, where, what to do."""


# --- names of the files around a recording, and the checks before one is started --------------------------------------

MIN_FREE_BYTES = 200_000_000


def part_of(target: Path) -> Path:
    """NAME.rrd.part: where NAME.rrd grows until it is whole."""
    return target.with_name(target.name + ".part")


def free_name(folder: Path, stem: str, ending: str) -> Path:
    """folder/stem+ending, or stem-2, stem-3, … if that exists."""
    for count in itertools.count(1):
        path = folder / f"{stem}{'' if count == 1 else f'-{count}'}{ending}"
        if not path.exists():
            return path
    raise AssertionError("unreachable")


def free_bytes(folder: Path) -> int:
    """Bytes free for this user on the folder's disk."""
    return shutil.disk_usage(folder).free


def claim(target: Path, min_free_bytes: int) -> FileLock:
    """Checks that a recording can start at `target` and takes its lock.

    A part left there by a process that died is moved aside, for `recover` to find.
    Raises RecordingError: wrong name, no such folder, not writable, disk full, being recorded by another.
    """
    folder = target.parent
    if target.suffix != ".rrd":
        raise RecordingError(f"{target}: the name of a recording must end in .rrd")
    if target.is_dir():
        raise RecordingError(f"{target}: is a folder; a file name is needed")
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; create it or record elsewhere")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(f"{folder}: not writable; record elsewhere")
    free = free_bytes(folder)
    if free < min_free_bytes:
        raise RecordingError(
            f"{folder}: {free / 1e6:.0f} MB free, {min_free_bytes / 1e6:.0f} MB are needed to record; free some space"
        )
    part = part_of(target)
    try:
        lock = FileLock.acquire(lock_path(part))
    except OSError as error:
        raise RecordingError(f"{folder}: cannot record there: {error.strerror}") from error
    if lock is None:
        raise RecordingError(f"{target}: is being recorded already; choose another name")
    if part.exists():
        part.rename(free_name(folder, f"{target.stem}-interrupted", ".rrd.part"))
    return lock


# --- with what settings a recording was made, and where each of its measurements stands on sim_time -------------------


def configured(
    settings: Mapping[str, Any], names: Sequence[str], times: Sequence[NDArray[np.float64]], shifts: Sequence[float]
) -> Facts:
    """names, times, s, and what was added to them, s: of the measurements."""
    facts = {name: str(value) for name, value in settings.items() if value not in (None, [], "")}
    for i, (name, time, shift) in enumerate(zip(names, times, shifts), 1):
        moved = f", moved by {shift:.4g} s" if shift else ""
        facts[f"recording {i}"] = f"{name}: {time[0]:.4g} … {time[-1]:.4g} s{moved}"
    return Facts(facts)


# --- what a recording says of itself in a list: its settings and what was found ---------------------------------------


@dataclass(frozen=True)
class Entry:
    """One recording of the folder."""

    name: str
    at: datetime
    size_bytes: int
    settings: dict[str, Any] = field(default_factory=dict)  # of an identification; empty for others
    found: dict[str, dict[str, Any]] = field(default_factory=dict)  # its answers by algorithm
    best: str | None = None  # the algorithm to believe
    kind: str = "run"  # identification, discovery, comparison …
    says: str = ""  # what came of it, in a line

    @property
    def answer(self) -> dict[str, Any] | None:
        """The best answer: k, rmse_A, corrected_rmse_A (not in older files), error_percent, evaluations, elapsed_s,
        healthy, alarms, stopped.
        """
        return self.found.get(self.best or "")


def error_key(*answers: Mapping[str, Any] | None) -> str:
    """Of the error by which answers are compared: the corrected one where all of them have it."""
    have = all(answer.get("corrected_rmse_A") is not None for answer in answers if answer)
    return "corrected_rmse_A" if have else "rmse_A"


def error_said(answer: Mapping[str, Any], *others: Mapping[str, Any]) -> str:
    """An answer's error, by the key that it shares with others."""
    key = error_key(answer, *others)
    return f"{'corrected' if key == 'corrected_rmse_A' else 'uncorrected'} error {amount(answer[key], 'A')}"


def setting(name: str, value: Any) -> tuple[str, str]:
    """A setting as a person reads it: ('amplitude', '5.00 mrad') of ('amplitude_rad', '0.005')."""
    told = _told(value, unit_of(name))
    if name == "algorithms":
        from ema_model.identification.run import algorithm_title  # the kernels take a while to import

        told = ", ".join(algorithm_title(one) for one in told.split(", "))
    return in_sentence(parameter_title(name)), told


def _told(value: Any, unit: str) -> str:
    """A recording keeps its settings as text."""
    try:
        read = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return str(value)
    if isinstance(read, bool) or not isinstance(read, int | float):
        return ", ".join(map(str, read)) if isinstance(read, list) else str(value)
    if isinstance(read, int) and not unit:
        return str(read)
    return amount(read, unit) if unit else number(read)
