"""What a recording is called and says of itself, what is wrong with one, where things lie in it and how they look."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.faults import FAULTS
from ema_model.files.written import FileLock, lock_path
from ema_model.quantities import SIGNALS, amount, in_sentence, number, parameter_title, unit_of
from ema_model.text import Facts
from emaviz import colours


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


# --- where things lie in a recording and how they look: entity paths, series names with units, colours ----------------

Colour = tuple[int, int, int, int]


def _rgba(hexadecimal: str, alpha: int = 255) -> Colour:
    return *colours.rgb(hexadecimal), alpha


APPLICATION = "emaviz"
PROPERTIES = "emaviz"
SIM_TIME = "sim_time"
ITERATION = "iteration"
K_NAMES = tuple(fault.name for fault in FAULTS)
K_TITLES = {fault.name: f"{fault.name} {fault.title[0].lower()}{fault.title[1:]} [-]" for fault in FAULTS}
# Beside a view's title stand buttons: four views in a line leave it two dozen letters where the app holds the viewer.
DASHBOARD_TITLES = {name: title.removesuffix(" [-]") for name, title in K_TITLES.items()}

COMPARISON = "/comparison"
ANSWER = "/answer"
GROUPS = ("reference", "monitor", "measurement", "initial", "residual", "floor_high", "floor_low")
GROUP_TITLES = {"reference": "RM", "monitor": "MM", "measurement": "Measured", "residual": "Residual"}
# Of a comparison: the model before calibration, and the edges between which a perfect one would leave its residual.
GROUP_TITLES |= {
    "initial": "MM before calibration",
    "floor_high": "Floor, upper edge",
    "floor_low": "Floor, lower edge",
}
GROUP_COLOURS: dict[str, Colour] = {
    "reference": _rgba(colours.REFERENCE, 200),
    "monitor": _rgba(colours.MONITOR),
    "measurement": _rgba(colours.REFERENCE, 150),
    "residual": _rgba(colours.DIFFERENCE),
    "initial": _rgba(colours.COMMAND, 160),
    "floor_high": _rgba(colours.COMMAND),
    "floor_low": _rgba(colours.COMMAND),
}
# Lines are drawn in the order of their paths, so what lies below is wider, and the reference lets it shine through.
GROUP_WIDTHS = {"reference": 1.3, "monitor": 3.0, "measurement": 4.0, "residual": 1.3}
GROUP_WIDTHS |= {"initial": 1.3, "floor_high": 1.5, "floor_low": 1.5}
TRUTH_COLOUR = _rgba(colours.TRUTH)
POPULATION_COLOUR = _rgba(colours.COMMAND, 80)
_PLAIN = re.compile(r"[A-Za-z0-9_]+")


def plain(name: str) -> str:
    """The name itself, if it can be one part of an entity path without escapes; ValueError otherwise."""
    if not _PLAIN.fullmatch(name):
        raise ValueError(f"{name!r} cannot name a part of a recording: letters, digits and _ only")
    return name


def signal_title(name: str) -> str:
    """'Equivalent current [A]' of 'current_A'; the name itself when it is not a canonical one."""
    signal = SIGNALS.get(name)
    if signal is None:
        return name
    return f"{signal.title} [{signal.unit or '-'}]"


def series_title(group: str, name: str) -> str:
    """'RM equivalent current [A]': what the legend says."""
    title = signal_title(name)
    return f"{GROUP_TITLES[group]} {title[0].lower()}{title[1:]}"


def signal_colour(group: str, name: str) -> Colour:
    """The group's colour; phases B and C are lighter and darker, as the three share a plot."""
    red, green, blue, alpha = GROUP_COLOURS[group]
    if name.startswith("phase_b"):
        return (red + 255) // 2, (green + 255) // 2, (blue + 255) // 2, alpha
    if name.startswith("phase_c"):
        return red * 5 // 9, green * 5 // 9, blue * 5 // 9, alpha
    return red, green, blue, alpha


def iteration_colour(index: int) -> Colour:
    """From grey to the monitor's colour as the iterations go by (150 is usual)."""
    share = min(index / 150.0, 1.0) ** 0.5
    start, end = np.array(POPULATION_COLOUR), np.array(GROUP_COLOURS["monitor"])
    red, green, blue, alpha = (start + share * (end - start)).astype(int).tolist()
    return red, green, blue, alpha


def algorithm_colour(algorithm: str) -> Colour:
    """The algorithm's own colour; the monitor's for one without."""
    return _rgba(colours.ALGORITHMS.get(algorithm, colours.MONITOR))


def algorithm_path(algorithm: str) -> str:
    """'/identification/hba'."""
    return f"/identification/{plain(algorithm)}"


def monitor_iteration_path(algorithm: str, index: int) -> str:
    """'/identification/hba/monitor/iteration_0040/current_A'."""
    return f"{algorithm_path(algorithm)}/monitor/iteration_{index:04d}/current_A"
