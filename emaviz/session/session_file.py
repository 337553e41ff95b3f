"""A session as one file, written and read: what the page is set to and has found, with the measured files of it."""

from __future__ import annotations

import filecmp
import hashlib
import json
import math
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ema_model.errors import InputError, quoted
from ema_model.files.opened import (
    SESSION_BYTES,
    SESSION_FILES,
    SETTINGS_BYTES,
    Damaged,
    Refused,
    SafeZip,
    check_user_file,
    opened_zip,
    shown,
)
from ema_model.files.written import whole_file
from ema_model.recordings import side_path
from emaviz import __version__
from emaviz.session.data_folder import SESSION_SUFFIX, DataFolder, sanitised

# NAME.emaviz is a zip of `session.json`, `arrays.bin` with the arrays that it names, and the files under `files/`, so
# that it opens on another computer.

SCHEMA = 1
_DOCUMENT, _ARRAYS, _FILES = "session.json", "arrays.bin", "files/"
_ARRAY = "__array__"  # in the JSON, in the place of an array: how its numbers are spelled, its shape, where it begins


@dataclass(frozen=True)
class Part:
    """One part of the page.

    save(): what JSON can hold, and arrays; restore(saved, names): takes it, names being the files' names now by those
    of then.  InputError from `restore` says what makes no sense.  files(): names in the data folder of what it needs.
    """

    save: Callable[[], Any]
    restore: Callable[[Any, Mapping[str, str]], None]
    files: Callable[[], Sequence[str]] = list


def write_session(path: Path, parts: Mapping[str, Part], folder: DataFolder, names: Sequence[str]) -> None:
    """Writes a session; names: measurements and actuator files of the data folder that belong to it.

    Raises InputError, and leaves nothing behind, if it cannot be written.
    """
    document = {"schema": SCHEMA, "emaviz": __version__, "files": [], **{n: p.save() for n, p in parts.items()}}
    try:
        with whole_file(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name in dict.fromkeys(names):
                file = folder.folder / name
                if not (folder.holds(file) and file.is_file()):
                    continue
                document["files"].append(name)
                archive.write(file, _FILES + name)
                side = side_path(file)
                if side != file and side.is_file() and folder.holds(side):
                    archive.write(side, _FILES + folder.name_of(side))
            arrays = _Arrays()
            archive.writestr(_DOCUMENT, json.dumps(arrays.taken_from(document), separators=(",", ":")))
            if arrays.every:
                archive.writestr(_ARRAYS, bytes(arrays.every))
            if archive.getinfo(_DOCUMENT).file_size > SETTINGS_BYTES or _unpacks_to(archive) > SESSION_BYTES:
                raise InputError(f"{quoted(path.name)}: the session is too large to be opened again; open fewer files")
    except OSError as error:
        raise InputError(f"{quoted(path.name)}: cannot be written ({error.strerror}); check the disk") from None


def read_session(path: Path, parts: Mapping[str, Part], folder: DataFolder) -> None:
    """Takes a session back, its files into the data folder.  InputError: no session, damaged, too large.

    The files are taken all or not at all.
    """
    check_user_file(path, "a session", name=path.name)
    try:
        with path.open("rb") as file, opened_zip(file, SESSION_FILES, SESSION_BYTES) as archive:
            document = _document(archive, path)
            names = _take_files(archive, document, folder)
    except (OSError, Damaged) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{shown(path.name)}: is no session, or damaged ({shown(why, 80)}); save it anew") from None
    except Refused as error:
        raise InputError(f"{shown(path.name)}: {error}; save it anew, with fewer recordings") from None
    for name, part in parts.items():
        if name in document:
            try:
                part.restore(document[name], names)
            except InputError:
                raise
            except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
                told = f"its part {name!r} is damaged ({type(error).__name__}); save it anew"
                raise InputError(f"{shown(path.name)}: {told}") from None


def _document(archive: SafeZip, path: Path) -> dict[str, Any]:
    raw = archive.read(_DOCUMENT, SETTINGS_BYTES)
    try:
        document = json.loads(raw)
    except (ValueError, RecursionError):
        document = None
    if _ARRAYS in archive.names:
        arrays = archive.read(_ARRAYS)
        try:
            document = _Placed(arrays).put_into(document)
        except (LookupError, OverflowError, RecursionError, TypeError, ValueError):
            raise Damaged("its arrays do not fit") from None
    if not isinstance(document, dict) or not isinstance(document.get("files", []), list):
        raise InputError(f"{shown(path.name)}: is no session of emaviz")
    schema = document.get("schema")
    if schema != SCHEMA:
        told = schema if isinstance(schema, int | str) else "unknown"
        raise InputError(f"{shown(path.name)}: was saved by another version (schema {shown(told)})")
    return document


def _unpacks_to(archive: zipfile.ZipFile) -> int:
    """Bytes."""
    return sum(one.file_size for one in archive.infolist())


_PLAIN = "biufU"  # kinds of arrays that are numbers, truths or text


class _Arrays:
    """The arrays of a document, one after another, each once: what several results are of is often the same."""

    def __init__(self) -> None:
        self.every = bytearray()
        self._known: dict[bytes, int] = {}  # where each begins, by its digest

    def taken_from(self, value: Any) -> Any:
        """A part of the document with a note in the place of each array."""
        if isinstance(value, np.ndarray):
            plain = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
            if plain.dtype.kind not in _PLAIN:
                raise TypeError(f"an array of {plain.dtype} is not saved")
            own = plain.tobytes()
            first = self._known.setdefault(hashlib.blake2b(own).digest(), len(self.every))
            if first == len(self.every):
                self.every += own
            return {_ARRAY: [plain.dtype.str, list(value.shape), first]}
        if isinstance(value, Mapping):
            return {name: self.taken_from(one) for name, one in value.items()}
        return [self.taken_from(one) for one in value] if isinstance(value, list | tuple) else value


class _Placed:
    """Arrays back in the places of their notes, each made once."""

    def __init__(self, every: bytes) -> None:
        self._every, self._room = every, SESSION_BYTES
        self._known: dict[tuple[Any, ...], np.ndarray] = {}  # by their notes

    def put_into(self, value: Any) -> Any:
        """A part of the document with its arrays; ValueError, and others, for notes that make no sense."""
        if isinstance(value, dict):
            if value.keys() != {_ARRAY}:
                return {name: self.put_into(one) for name, one in value.items()}
            spelled, shape, first = value[_ARRAY]
            if (note := (spelled, *shape, first)) not in self._known:
                self._known[note] = self._made(np.dtype(spelled), shape, first)
            return self._known[note]
        return [self.put_into(one) for one in value] if isinstance(value, list) else value

    def _made(self, kind: np.dtype, shape: list[int], first: int) -> np.ndarray:
        if kind.kind not in _PLAIN or kind.itemsize == 0 or min([first, *shape]) < 0:
            raise ValueError("no array of numbers or text")
        made = np.frombuffer(self._every, kind, math.prod(shape), first).reshape(shape).copy()
        self._room -= made.nbytes
        if self._room < 0:
            raise ValueError("more arrays than a session's file holds")
        return made


def _take_files(archive: SafeZip, document: Mapping[str, Any], folder: DataFolder) -> dict[str, str]:
    """Unpacks what the data folder does not have already; names now by those of then."""
    inside = set(archive.names)
    names: dict[str, str] = {}
    kept: list[Path] = []
    try:
        for name in dict.fromkeys(str(name) for name in document.get("files", [])):
            if _FILES + name in inside:
                here = folder.folder / name
                part = _unpacked(archive, _FILES + name, folder)
                if folder.holds(here) and here.is_file() and filecmp.cmp(here, part, shallow=False):
                    folder.drop(part)
                    names[name] = name
                    continue
                kept.append(folder.keep(part, Path(name).name))
                names[name] = folder.name_of(kept[-1])
                side = _FILES + side_path(Path(name)).as_posix()
                if side in inside and side != _FILES + name:
                    kept.append(folder.keep_at(_unpacked(archive, side, folder), side_path(kept[-1])))
    except BaseException:  # half a session is of no use
        for path in kept:
            path.unlink(missing_ok=True)
        raise
    return names


def _unpacked(archive: SafeZip, name: str, folder: DataFolder) -> Path:
    """A file of the session, under a name of its own."""
    part = folder.part()
    try:
        with part.open("xb") as file:
            archive.copy(name, file)
    except BaseException:
        folder.drop(part)
        raise
    return part


def free_path(folder: DataFolder, wanted: Any) -> Path:
    """Where a session of that name goes; a name that is taken gets a number."""
    stem = str(wanted).strip().removesuffix(SESSION_SUFFIX) or "session"
    return folder.place(sanitised(stem + SESSION_SUFFIX))
