"""What a result was computed from, and whether that still is what is chosen: one rule for every tab."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from ema_model.errors import InputError
from ema_model.recordings import side_path
from emaviz.session.jobs import Job
from emaviz.session.session_file import Part
from emaviz.session.settings import taken

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
