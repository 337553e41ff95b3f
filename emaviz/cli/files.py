"""The files that a command reads and writes: declared with its options, checked all together before it begins.

An option's `type` declares it: an `Input` for what is read, an `Output` for what is written.
"""

from __future__ import annotations

import argparse
import os
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, replace
from glob import has_magic
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

# What reads recordings takes a while to import: it is imported where it is asked.
from ema_model.errors import InputError
from ema_model.files.opened import check_user_file, shown


@dataclass(frozen=True)
class Input:
    """The type of an option that names a file to read."""

    expected: str  # as in "an actuator file (.toml)"
    has_side_file: bool = False
    is_file: Callable[[str], bool] = bool  # tells a file's name from what else the option takes
    several: bool = False  # a folder or a pattern stands for the recordings in it
    in_folders: bool = False  # a folder without recordings stands for those in its folders

    def __call__(self, text: str) -> str:
        return text


@dataclass(frozen=True)
class Output:
    """The type of an option that names a file to write."""

    ends_in: tuple[str, ...] = ()  # none: as measurements are written
    is_kept: bool = True  # one that exists is replaced with --force only
    has_side_file: bool = False

    def __call__(self, text: str) -> str:
        return text

    @property
    def suffixes(self) -> tuple[str, ...]:
        """One of these ends the name."""
        if self.ends_in:
            return self.ends_in
        import emaviz.formats  # noqa: F401  they join the family
        from ema_model.recordings.formats import WRITTEN

        return tuple(WRITTEN)

    def suffix_of(self, path: Path) -> str:
        """As it is compared: of measurements' alone, readers take capitals."""
        return path.suffix.lower() if self.has_side_file else path.suffix


@dataclass(frozen=True)
class Folder:
    """The type of an option that names a folder, which whoever takes it looks at."""

    def __call__(self, text: str) -> str:
        return text


RECORDING = Input("the file of a measurement", has_side_file=True)
RECORDINGS = replace(RECORDING, several=True)
UNITS = replace(RECORDINGS, in_folders=True)
HELD_OUT = replace(RECORDINGS, is_file=lambda text: not _is_pattern(text))
ACTUATOR = Input("an actuator file (.toml)")
JSON = Output((".json",), is_kept=False)
REPORT = Output((".html", ".htm"), is_kept=False)
RRD = Output((".rrd",))
SAVED_ACTUATOR = Output((".toml",))
MEASUREMENT = Output(has_side_file=True)


def _is_pattern(text: str) -> bool:
    from ema_model.recordings.recording_set import is_pattern

    return is_pattern(text)


_Declared = TypeVar("_Declared", Input, Output)


class _Named(NamedTuple, Generic[_Declared]):
    path: Path
    option: str  # empty for a positional one
    declared: _Declared


def add_recordings(parser: argparse.ArgumentParser, done: str, nargs: str = "+", declared: Input = RECORDINGS) -> None:
    """The recordings of one actuator that a command takes; done: "fitted"."""
    parser.add_argument(
        "files",
        nargs=nargs,
        type=declared,
        metavar="FILE",
        help=f"recordings of one actuator, {done} together; folders, LeRobot datasets and patterns too",
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """--force, for a command with an output that is kept"""
    parser.add_argument("--force", action="store_true", help="replace a recording or an actuator file that exists")


def check_files(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Raises InputError for an input that is no file, and for an output that may not or cannot be written.

    To be asked before any work.  Where the outputs go, what killed processes left of theirs is removed.
    """
    from ema_model.files.written import remove_abandoned

    inputs = [one for one in _named(Input, parser, arguments) if one.declared.is_file(str(one.path))]
    outputs = _named(Output, parser, arguments)
    for one in inputs:
        check_user_file(one.path, one.declared.expected)
    taken = [place for one in inputs for place in _taken(one)]
    for one in outputs:
        if problem := _problem(one, taken, getattr(arguments, "force", False)):
            raise InputError(f"{one.option} {shown(one.path, 300)}: {problem}")
        taken += _taken(one)
    for folder in {os.path.dirname(os.path.realpath(one.path)) for one in outputs}:
        remove_abandoned(folder)


def _named(
    kind: type[_Declared], parser: argparse.ArgumentParser, arguments: argparse.Namespace
) -> list[_Named[_Declared]]:
    named = []
    for action in parser._actions:
        if isinstance(action.type, kind):
            value = getattr(arguments, action.dest)
            option = "".join(action.option_strings[:1])
            for text in value if isinstance(value, list) else [value]:
                if text is not None:
                    named += [_Named(Path(one), option, action.type) for one in _files(text, action.type)]
    return named


def _files(text: str, declared: Input | Output) -> list[str]:
    stands_for_others = os.path.isdir(text) or has_magic(text)  # else there is no need to ask what reads recordings
    if isinstance(declared, Input) and declared.several and stands_for_others and declared.is_file(text):
        import emaviz.formats  # noqa: F401  they join the family
        from ema_model.recordings.recording_set import files_of

        return files_of(text, in_folders=declared.in_folders)
    return [text]


def _taken(one: _Named[_Declared]) -> list[tuple[Path, str]]:
    """Where no other output may go, and why: the file itself, and what would be read as its side file."""
    taken = [(one.path, f"is what {one.option} names" if one.option else "is a file to read")]
    if one.declared.has_side_file:
        from ema_model.recordings.side_file import OF_A_FOLDER, side_path

        own = side_path(one.path)
        why = f"is the place of the side file of {shown(one.path.name, 100)}"
        taken += [(own, why), (own.with_name(OF_A_FOLDER), why)]
    return taken


def _problem(one: _Named[Output], taken: list[tuple[Path, str]], force: bool) -> str | None:
    """Why this output may not or cannot be written, if so."""
    path, declared = one.path, one.declared
    target = Path(os.path.realpath(path))
    for other, why in taken:
        if _are_same(path, other):
            return f"{why}; name another file"
    if target.is_dir():
        return "is a folder; name a file in it"
    if declared.suffix_of(path) not in declared.suffixes:
        return f"the name must end in {' or '.join(declared.suffixes)}"
    if not target.parent.is_dir():
        return f"the folder {target.parent if path.is_symlink() else path.parent} does not exist; make it first"
    if target.exists() and not target.is_file():
        return "is not a regular file; name another"
    if not os.access(target.parent, os.W_OK):
        return f"no permission to write in {target.parent}"
    if declared.is_kept and target.exists() and not force:
        return "exists already; name another file, or replace it with --force"
    return None


def _are_same(one: Path, other: Path) -> bool:
    """Whether both names mean one file, by links and by spellings that some file systems do not tell apart."""
    if one.exists() or other.exists():
        return one.exists() and other.exists() and one.samefile(other)
    one, other = (Path(os.path.realpath(path)) for path in (one, other))
    return one.parent == other.parent and _folded(one.name) == _folded(other.name)


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()
