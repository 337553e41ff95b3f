"""A session as one file: recorded runs, parts, archive."""

from __future__ import annotations

import filecmp
import json
import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model.discovery.words import effect_title
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
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import side_path
from emaviz import __version__
from emaviz.recording.entry import Entry
from emaviz.session.data_folder import SESSION_SUFFIX, DataFolder, sanitised

if TYPE_CHECKING:
    from emaviz.recording.read import Recording


# --- what a recorded run is, in a line: its kind and what came of it, from what its file says of itself ---------------

UNKNOWN = "run"


def summary(said: Mapping[str, Any]) -> tuple[str, str]:
    """('discovery', 'cogging torque: 1.69 → 0.757 × floor'); ('run', '') of a file that says nothing."""
    for key, (kind, words) in _KINDS.items():
        if isinstance(said.get(key), Mapping):
            try:
                return kind, words(said[key])
            except (KeyError, TypeError, IndexError, ValueError):  # of another version
                return kind, ""
    return UNKNOWN, ""


def _identification(found: Mapping[str, Any]) -> str:
    names = sorted({name for one in found.values() for name in one.get("alarms", ())})
    return "not healthy: " + ", ".join(names) if names else "healthy" if _all(found, "healthy") else "no single k off"


def _all(found: Mapping[str, Any], name: str) -> bool:
    return all(one.get(name) for one in found.values())


def _discovery(found: Mapping[str, Any]) -> str:
    names = [in_sentence(effect_title(str(one["name"]))) for one in found["effects"]]
    errors = [found["ladder"][at]["rmse"] for at in (0, -1)]
    if None in errors:
        fell = ""
    elif len(found["ladder"]) > 1:
        fell = f"{number(errors[0])} → {number(errors[1])} × floor"
    else:
        fell = f"{number(errors[0])} × floor"
    what = ", ".join(names) or str(found["verdict"]).replace("_", " ")
    return f"{what}: {fell}" if fell else what


def _comparison(found: Mapping[str, Any]) -> str:
    return str(found["sentences"][0])


def _tracking(found: Mapping[str, Any]) -> str:
    trends = [name for name, one in found["faults"].items() if one.get("trend")]
    return f"trend of {', '.join(trends)}" if trends else "no trend"


_KINDS: dict[str, tuple[str, Callable[[Mapping[str, Any]], str]]] = {
    "found": ("identification", _identification),
    "discovery": ("discovery", _discovery),
    "comparison": ("comparison", _comparison),
    "track": ("tracking", _tracking),
    "reproduce": ("evaluation", lambda _: "the thesis's tables beside ours"),
}

# --- past recordings: what the folder holds, with settings and results; renamed, deleted, read back -------------------

_ENDING = ".rrd"


class Recorded:
    """The folder of recordings.  Raises InputError, one line, for what is refused.

    Only the names that the folder lists are taken; what a file says of itself is kept until the file changes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._known: dict[str, tuple[tuple[int, int], Entry]] = {}

    def names(self) -> list[str]:
        """Names of the recordings, the newest first."""
        found = []
        for one in os.scandir(self.folder):
            if one.name.endswith(_ENDING) and not one.name.startswith(".") and one.is_file():
                found.append((-one.stat().st_mtime_ns, one.name))
        return [name for _, name in sorted(found)]

    def entry(self, name: str) -> Entry:
        """A recording with its settings and result, as far as it says them."""
        path = self.path(name)
        try:
            status = path.stat()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be read ({error.strerror})") from None
        version = status.st_mtime_ns, status.st_size
        known = self._known.get(name)
        if known is None or known[0] != version:
            said = _properties(path)
            at = datetime.fromtimestamp(status.st_mtime)
            known = version, Entry(name, at, status.st_size, **said)
            self._known[name] = known
        return known[1]

    def read(self, name: str) -> Recording:
        """Everything in it."""
        from emaviz.recording import read

        try:
            return read(self.path(name))
        except OSError as error:
            raise InputError(str(error)) from None

    def rename(self, name: str, wanted: Any) -> str:
        """Gives it another name, made safe, and returns that; a name that is taken is refused."""
        path = self.path(name)
        stem = str(wanted).strip().removesuffix(_ENDING)
        if not stem:
            raise InputError("a run needs a name; type one first")
        new = sanitised(stem + _ENDING)
        target = self.folder / new
        if new == name:
            return name
        if os.path.lexists(target):
            raise InputError(f"{shown(new)} exists already; choose another name")
        try:
            path.rename(target)
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be renamed ({error.strerror})") from None
        self._known.pop(name, None)
        return new

    def delete(self, name: str) -> None:
        """Removes the file."""
        try:
            self.path(name).unlink()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be deleted ({error.strerror})") from None
        self._known.pop(name, None)

    def path(self, name: str) -> Path:
        """Where it is; refused unless the folder itself lists it."""
        path = self.folder / name
        try:
            listed = Path(name).name == name and name.endswith(_ENDING) and path.is_file() and not path.is_symlink()
        except OSError:  # longer than any name
            listed = False
        if not listed:
            raise InputError(f"{shown(name)}: no such run; choose one of the list")
        return path


def _properties(path: Path) -> dict[str, Any]:
    """What it is and came to; settings, answers and the best of an identification; nothing of damaged files."""
    try:
        from emaviz.recording.read import properties

        said = properties(path)
    except (OSError, ImportError):
        return {}
    kind, says = summary(said)
    settings, found, best = said.get("settings"), said.get("found"), said.get("best")
    if not (isinstance(settings, dict) and isinstance(found, dict) and isinstance(best, str)):
        return {"kind": kind, "says": says}
    return {"settings": settings, "found": found, "best": best, "kind": kind, "says": says}


def recovered(recordings: Path) -> list[str]:
    """What became of recordings of interrupted runs, a line each."""
    try:
        from emaviz.recording.read import recover

        return [f"Recovered a recording of an interrupted run: {found}" for found in recover(recordings)]
    except (OSError, ImportError) as error:
        return [f"Interrupted recordings cannot be recovered: {error}"]


# --- a session as one file: what the page is set to and has found, with the measured files that it needs --------------
# NAME.emaviz is a zip of `session.json` and the files under `files/`, so that it opens on another computer.

SCHEMA = 1
_DOCUMENT, _FILES = "session.json", "files/"


@dataclass(frozen=True)
class Part:
    """One part of the page.

    save(): what JSON can hold; restore(saved, names): takes it, names being the files' names now by those of then.
    InputError from `restore` says what makes no sense.  files(): names in the data folder of what it needs.
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
            archive.writestr(_DOCUMENT, json.dumps(document, indent=1))
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
    if not isinstance(document, dict) or not isinstance(document.get("files", []), list):
        raise InputError(f"{shown(path.name)}: is no session of emaviz")
    schema = document.get("schema")
    if schema != SCHEMA:
        told = schema if isinstance(schema, int | str) else "unknown"
        raise InputError(f"{shown(path.name)}: was saved by another version (schema {shown(told)})")
    return document


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
