"""A session as one file, what the page has with its measured files; and whether a result is still of what is chosen."""

from __future__ import annotations

import filecmp
import hashlib
import json
import math
import threading
import zipfile
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
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
from emaviz.session.jobs import Job
from emaviz.session.settings import taken

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


# --- what a result was computed from, and whether that still is what is chosen: one rule for every tab ----------------

_MOST_NAMES = 3
_WRITTEN_S = 60.0  # in which a result's file is


class Inputs(msgspec.Struct, frozen=True):
    """Of one result.

    subject: what it is of, in words; source: which of several it is made from, as a folder's name, of which all else
    depends; files: a version of each, by its name in the data folder, None where they cannot
    be looked at; options: a value of each, by what it is called in a sentence.
    """

    subject: str = ""
    source: str = ""
    files: dict[str, str] | None = msgspec.field(default_factory=dict)
    options: dict[str, str] = msgspec.field(default_factory=dict)

    def changed(self, now: Inputs) -> str:
        """What is different now: 'chirp.csv was removed and the window of time was changed'; '' for nothing."""
        if self.source != now.source:
            return "another source was chosen"
        parts: list[str] = []
        if self.files is not None and now.files is not None:
            both = self.files.keys() & {name for name, version in now.files.items() if version}
            for names, what in (
                ([name for name in self.files if name not in both], "removed"),
                ([name for name in now.files if name not in both], "added"),
                ([name for name in self.files if name in both and self.files[name] != now.files[name]], "changed"),
            ):
                parts += _said([name.rpartition("/")[2] for name in names], what)
        options = [name for name in {**self.options, **now.options} if self.options.get(name) != now.options.get(name)]
        return listed(parts + _said(options, "changed"))

    def renamed(self, names: Mapping[str, str]) -> Inputs:
        """With the files' names of now, by those of then."""
        files = self.files and {names.get(name, name): version for name, version in self.files.items()}
        return msgspec.structs.replace(self, files=files)


class SavedResult(msgspec.Struct, frozen=True):
    """What a session's file says of a result; the result itself stands beside, or its tab saves it."""

    inputs: Inputs | None = None
    running: str = ""  # what was being computed when it was saved


@dataclass(frozen=True)
class Whole:
    """How a session's file takes the result of a tab whole, and shows it again without computing."""

    save: Callable[[], Any]  # plain values and arrays; None without a result
    show: Callable[[Any], None]  # of what was saved; InputError, and nothing is shown, for what makes no sense


class ResultFiles:
    """Report and recording of the result that a tab shows, each written once, when a link asks for it."""

    def __init__(self, kinds: Collection[str], shown: Callable[[], object], save: Callable[[str], object]) -> None:
        """kinds: suffixes; shown(): what is shown, None for nothing; save(suffix): writes it soon, and `came` then."""
        self.kinds, self._shown, self._save = kinds, shown, save
        self._made: dict[str, tuple[object, Path]] = {}
        self._awaited: dict[str, threading.Event] = {}
        self._making = threading.Lock()

    def clear(self) -> None:
        """Something else is shown."""
        self._made.clear()

    def came(self, path: Path) -> bool:
        """A file is written; whether a link had asked for it."""
        self._made[path.suffix] = self._shown(), path
        awaited = self._awaited.pop(path.suffix, None)
        if awaited is not None:
            awaited.set()
        return awaited is not None

    def make(self, suffix: str) -> Path | None:
        """Of what is shown now; None where that is nothing, or it cannot be written."""
        with self._making:
            shown = self._shown()
            if shown is None or suffix not in self.kinds:
                return None
            if (path := self._known(suffix, shown)) is None:
                come = self._awaited[suffix] = threading.Event()
                self._save(suffix)
                path = self._known(suffix, shown) if come.wait(_WRITTEN_S) else None
                self._awaited.pop(suffix, None)
            return path

    def _known(self, suffix: str, shown: object) -> Path | None:
        of, path = self._made.get(suffix, (None, None))
        return path if path is not None and of == shown and path.is_file() else None


class Provenance:
    """Of the result that a tab shows.  Read and written on any thread."""

    def __init__(
        self,
        what: str,
        start: str,
        now: Callable[[], Inputs],
        job: Job | None = None,
        soon: Callable[[], object] = lambda: False,
        reads: Callable[[], object] = lambda: False,
    ) -> None:
        """what: the result, as 'the comparison'; start: the button that computes it; now(): what that would take.

        soon(): whether a run is about to begin by itself; reads(): whether what it would take is still being read.
        """
        self.what, self.start, self.now = what, start, now
        self.of: Inputs | None = None  # what is shown; None for nothing
        self.files: ResultFiles | None = None  # what can be written of it
        self.missing: SavedResult | None = None  # a session had it, and it is to be computed again
        self.whole: Whole | None = None  # where its tab does not save it among its own
        self._job, self._soon, self._reads = job, soon, reads
        self._why = ""  # what is missing could not be brought
        self._is_lost = False  # it was missing before a session was saved, or without one
        self._restored = False  # a session brought the result itself
        self._is_whole = False  # it is shown as a session brought it, while its files may still be read
        self._coming: Inputs | None = None  # of the run that goes on
        self._error: Inputs | None = None  # of which something was refused, or has failed
        if job is not None:
            job.ended.connect(lambda _: self._ended(job))

    # --- runs -------------------------------------------------------------------------------------------------------

    def begin(self, begin: Callable[[], bool], of: Inputs | None = None) -> bool:
        """Begins a run whose result takes the place of the shown one; of: its inputs, else what they are now."""
        before, begun, self._is_whole = self._coming, False, False
        self._coming = self.now() if of is None else of
        try:
            begun = begin()
        finally:
            if not begun:
                self._coming = before
        return begun

    def take(self, of: Inputs | None = None) -> None:
        """A result is there; of: its inputs, else those of the run that goes on."""
        self.of, self.missing, self._coming = of or self._coming or self.now(), None, None
        self._is_whole, self._why = False, ""

    def lose(self, of: Inputs | None, why: str) -> None:
        """A result that was there is not: it is to be computed again."""
        self.clear()
        self.missing, self._why, self._is_lost = SavedResult(of), why, True

    def clear(self) -> None:
        """Nothing is shown any more."""
        self.of = self.missing = self._error = None
        self._is_whole, self._why, self._is_lost = False, "", False

    def _ended(self, job: Job) -> None:
        if job.error:
            self._error = self._coming or self.now()
        self._coming = None

    # --- errors -----------------------------------------------------------------------------------------------------

    def refused(self) -> None:
        """Something was said of what is chosen now."""
        self._error = self.now()

    def forget_error(self) -> bool:
        """Whether what was refused, or has failed, is not what is chosen any more; true once."""
        gone = self._error is not None and bool(self._error.changed(self.now()))
        if gone:
            self._error = None
            if self._job is not None and not self._job.running:
                self._job.error = ""
        return gone

    # --- in words ---------------------------------------------------------------------------------------------------

    @property
    def computing(self) -> bool:
        """Whether the next result is on its way."""
        return self._coming is not None or (self._job is not None and self._job.waiting) or bool(self._soon())

    def line(self, start: str = "") -> str:
        """A sentence where what is shown is not what is chosen; '' where it is.  start: as the button is called now."""
        press = f"press {start or self.start}"
        if (missing := self.missing) is not None:
            had = f"{self.what} of {missing.inputs.subject}" if missing.inputs is not None else ""
            running = f"“{missing.running}” was running when this session was saved" if missing.running else ""
            if self.computing:
                had = f"this session's {had.removeprefix('the ')}" if had else "what was running in this session"
                return f"Being computed again: {had}."
            if not had:
                return f"Not computed: {running}; {press}."
            why = f" ({self._why})" if self._why else ""
            saved = "" if self._is_lost else ", which this session was saved with"
            again = f"To be computed again: {had}{saved}{why}; {press}."
            return f"{again} {running}." if running else again
        if self.of is None:
            return ""
        if self._reads() or (self._is_whole and self.computing and self._coming is None):
            return ""  # its files are being read
        changed = self.of.changed(self.now())
        if self.computing:
            return f"Out of date: {f'{changed} since; ' if changed else ''}another one is being computed."
        return f"Out of date: {changed} since; {press}." if changed else ""

    def note(self) -> str:
        """For what is written while it is out of date; '' otherwise."""
        changed = "" if self.of is None else self.of.changed(self.now())
        return f"as it was computed: {changed} since" if changed else ""

    # --- a session --------------------------------------------------------------------------------------------------

    def saved(self) -> SavedResult | None:
        """For a session's file; None where nothing is shown, nor computed."""
        job, missing = self._job, self.missing
        running = "" if job is None or not (job.running or job.waiting) else job.title
        if missing is not None:
            return SavedResult(missing.inputs or self.of, running or missing.running)
        return SavedResult(self.of, running) if self.of is not None or running else None

    def restored(self) -> None:
        """Its tab has the result itself from a session; `bring` says of what it is."""
        self.take()
        self._restored = True

    def bring(self, saved: SavedResult | None, names: Mapping[str, str], whole: Any = None) -> None:
        """Once its tab has taken its part of a session; names: the files' names of now by those of then.

        whole: what `Whole.save` gave; where that cannot be shown, the result is to be computed again.
        """
        if whole is not None and self.whole is not None:
            try:
                self.whole.show(whole)
                self.restored()
            except InputError as error:
                self._why = str(error)
        restored, self._restored, self._is_lost = self._restored, False, False
        self.missing = self._error = None
        if saved is None:
            return
        inputs = None if saved.inputs is None else saved.inputs.renamed(names)
        if restored and inputs is not None:
            self.of = inputs
            self._is_whole = whole is not None
        is_here = inputs is not None and self.of is not None and not self.of.changed(inputs)
        if saved.running or not is_here:
            self.missing = SavedResult(None if is_here else inputs, saved.running)


def results_part(members: Callable[[], Mapping[str, Provenance]]) -> Part:
    """A session's part for the results of all tabs; to be restored after the tabs' own.  members(): by name."""

    def save() -> dict[str, Any]:
        saved = {name: one.saved() for name, one in members().items()}
        told = msgspec.to_builtins({name: one for name, one in saved.items() if one is not None})
        for name, one in told.items():
            if (found := _whole(members()[name])) is not None:
                one["whole"] = found
        return told

    def restore(given: Any, names: Mapping[str, str]) -> None:
        saved: dict[str, SavedResult] = taken(dict[str, SavedResult], given, "list of results")
        for name, one in members().items():
            one.bring(saved.get(name), names, given.get(name, {}).get("whole"))

    return Part(save, restore)


_MOST_BYTES = 100_000_000  # of one tab's arrays
_MOST_TEXT = 1_000_000  # of all else in it, as a file has it: together they stay below what is read


class Room:
    """What the results of one tab may take of a session's file; one that finds no room is computed again."""

    def __init__(self, text: int = _MOST_TEXT) -> None:
        self._arrays, self._text = _MOST_BYTES, text

    def take(self, found: Any) -> Any:
        """A stored result; InputError for one that is too large."""
        arrays, text = _bytes(found), len(json.dumps(found, default=lambda array: None))
        if arrays > self._arrays or text > self._text:
            raise InputError("the result is too large to be stored")
        self._arrays, self._text = self._arrays - arrays, self._text - text
        return found


def _whole(of: Provenance) -> Any:
    """A result as a session's file takes it; None without one, for one that is too large, or is not stored."""
    if of.whole is None or of.of is None:
        return None
    with suppress(InputError):
        return Room().take(of.whole.save())
    return None


def _bytes(value: Any) -> int:
    if isinstance(value, Mapping):
        return sum(map(_bytes, value.values()))
    if isinstance(value, list | tuple):
        return sum(map(_bytes, value))
    return getattr(value, "nbytes", 0)


_MOST_READ = 100_000_000  # bytes, of a file that is known again by what is in it; a larger one by when it was written


def version_of(path: Path, *said: object) -> str:
    """By which a file is known again, elsewhere too, with what was said of how to read it; '' where it is not there."""
    try:
        at = path.stat()
    except OSError:
        return ""
    own = str(at.st_mtime_ns) if at.st_size > _MOST_READ else _digest_of(path, at.st_size, at.st_mtime_ns)
    return " ".join((str(at.st_size), own, *(digest(one) for one in said)))


@lru_cache(maxsize=20_000)
def _digest_of(path: Path, size: int, changed_ns: int) -> str:
    """Of what is in a file, which is read again once it has another size, or was written since; else when it was."""
    with suppress(OSError), path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    return str(changed_ns)


def version_with_side(path: Path) -> str:
    """The same of a recording with its side file."""
    return f"{version_of(path)} {version_of(side_path(path))}".strip()


def digest(value: object) -> str:
    """A short text that is another one for another value."""
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]


def listed(words: list[str]) -> str:
    """'a, b and c'."""
    return " and ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _said(names: list[str], what: str) -> list[str]:
    if not names:
        return []
    more = len(names) - _MOST_NAMES
    shown = names if more <= 0 else [*names[:_MOST_NAMES], f"{more} more"]
    return [f"{listed(shown)} {'was' if len(names) == 1 else 'were'} {what}"]
