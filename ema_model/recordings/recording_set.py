"""Many recordings at once: the files of a folder or a pattern, the runs of one file, and which are held out by rule."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TypeVar

import numpy as np

from ema_model.errors import InputError
from ema_model.files.opened import listed, refusal, shown
from ema_model.recordings.formats import FORMATS, parquet
from ema_model.recordings.measurement import Measurement
from ema_model.recordings.read import TooShort

File = TypeVar("File")
Read = TypeVar("Read")

_MARKS = frozenset("*?[")
RUN = "#"  # between a file's name and the number of one of its runs


def is_pattern(text: str) -> bool:
    """Whether it is a pattern, and not the name of a file that is there."""
    return bool(_MARKS & set(text)) and not os.path.exists(text)


def files_of(text: str, *, in_folders: bool = False) -> list[str]:
    """The recordings that a folder holds, or a pattern names, in order of their names; of all else the text itself.

    A folder's own folders are left out, as is what begins with a dot; in_folders: of a folder without recordings those
    in its folders are taken.  A LeRobot dataset has its episodes' files.  InputError where there are none.
    """
    path = Path(text)
    if os.path.isdir(text):
        if episodes := parquet.files_in(text):
            return episodes
        found = [str(one) for one in recordings_in(path)]
        if not found and in_folders:
            folders = sorted(one for one in path.iterdir() if one.is_dir() and not one.name.startswith("."))
            found = [str(one) for folder in folders for one in recordings_in(folder)]
        if not found:
            raise refusal(text, f"a folder without recordings; they end in {', '.join(FORMATS)}")
        return found
    if not is_pattern(text):
        return [text]
    anchor = Path(path.anchor) if path.is_absolute() else Path()
    try:
        found = sorted(str(one) for one in anchor.glob(str(path.relative_to(anchor))) if _is_recording(one))
    except (ValueError, OSError, NotImplementedError):
        found = []
    if not found:
        raise refusal(text, "no recording has such a name; check the pattern")
    return found


def recordings_in(folder: Path) -> list[Path]:
    """The recordings of a folder in order of their names, without its own folders and what begins with a dot.

    Files of a doubtful suffix count where there are no others: beside measurements, a text is a note.
    """
    found = sorted(path for path in folder.iterdir() if _is_recording(path))
    sure = [path for path in found if path.suffix.lower() not in FORMATS[path.suffix.lower()].doubtful]
    return sure or found


def _is_recording(path: Path) -> bool:
    return path.is_file() and path.suffix.lower() in FORMATS and not path.name.startswith(".")


def long_enough(
    files: Iterable[File], read: Callable[[File], Read], left_out: Callable[[str], object]
) -> Iterator[tuple[File, Read]]:
    """Each file with what is read of it; of several files, those that are too short are left out, with a line each.

    Raises TooShort where none is long enough, and what else `read` raises.
    """
    short: list[TooShort] = []  # until one is long enough
    is_any = False
    for file in files:
        try:
            found = read(file)
        except TooShort as error:
            short.append(error)
        else:
            is_any = True
            yield file, found
        while is_any and short:
            left_out(f"{short.pop(0)}; left out")
    if short:
        raise short[0] if len(short) == 1 else TooShort(f"{short[0]}; none of the {len(short)} recordings is longer")


def column_of_runs(file: str) -> str:
    """The column that tells a file's recordings apart where its format has several in one, else ""."""
    return parquet.EPISODE if parquet.has_episodes(file) else ""


def episodes_of(measurement: Measurement, file: str) -> list[Measurement]:
    """The episodes of a dataset's file as recordings of their own, as the dataset calls them; of all else itself."""
    entry = measurement.reading.mapping.get("segment")
    if entry is None or entry.column != column_of_runs(file):
        return [measurement]
    return [replace(run, name=parquet.episode(index)) for index, run in _runs(measurement)]


def runs_of(measurement: Measurement) -> list[Measurement]:
    """The runs of one file as recordings of their own, NAME#INDEX, by its `segment`, each with its own time.

    InputError where the file has no such column.
    """
    return [replace(run, name=f"{measurement.name}{RUN}{index:g}") for index, run in _runs(measurement)]


def _runs(measurement: Measurement) -> Iterator[tuple[float, Measurement]]:
    measurement.require("segment")
    for index in np.unique(measurement["segment"]).tolist():
        keep = measurement["segment"] == index
        signals = {name: values[keep] for name, values in measurement.signals.items() if name != "segment"}
        yield index, replace(measurement, signals=signals)


def held_out(measurements: Sequence[Measurement], rule: str) -> tuple[list[Measurement], list[Measurement]]:
    """Those to fit, and those whose names the rule takes out; InputError where it takes none or all of them."""
    taken = [fnmatchcase(one.name, rule) for one in measurements]
    if not any(taken):
        names = listed([one.name for one in measurements])
        raise InputError(f"--holdout {shown(rule, 100)}: no recording has such a name (there are {names})")
    if all(taken):
        raise InputError(f"--holdout {shown(rule, 100)}: every recording has such a name; leave some to fit")
    return (
        [one for one, out in zip(measurements, taken) if not out],
        [one for one, out in zip(measurements, taken) if out],
    )


def check_held_out(fitted: Sequence[Measurement], held: Sequence[Measurement]) -> None:
    """InputError for a recording that is both fitted and held out, whatever its files are called.

    It would say nothing of what the model does elsewhere.  Two are the same where they have the same signals, with the
    same values at the same times.
    """
    for one in held:
        for other in fitted:
            if _is_same(one, other):
                same = "" if one.name == other.name else f" (its content is that of {shown(other.name, 100)})"
                both = f"{shown(one.name, 100)}: is both fitted and held out{same}"
                raise InputError(f"{both}; hold out a recording that is not fitted")


def _is_same(one: Measurement, other: Measurement) -> bool:
    return set(one) == set(other) and all(np.array_equal(one[name], other[name]) for name in one)
