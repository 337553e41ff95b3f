"""The data folder: the only place that the page reads files from and writes them to.

A browser may send any name, and a link may lead anywhere: every path is resolved and must end inside.
"""

from __future__ import annotations

import filecmp
import os
import re
import shutil
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from ema_model.challenges.challenge import SUFFIX as CHALLENGE_SUFFIX
from ema_model.errors import InputError
from ema_model.files.opened import check_user_file, shown
from ema_model.files.written import FileLock, new_draft, remove_abandoned, whole_file
from ema_model.recordings import side_path
from ema_model.recordings.formats import FORMATS, parquet

ACTUATOR_SUFFIX = ".toml"
SESSION_SUFFIX = ".emaviz"
_MOST_LISTED = 500
_DEEPEST = 3
_LONGEST_NAME = 100
_STRANGE = re.compile(r"[^\w.()+ -]+")  # all but letters of any script, digits and a few signs
_RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(10))}


class DataFolder:
    """Recordings, uploads and actuator files below one folder.  Raises InputError, one line, for what is refused."""

    def __init__(self, folder: Path) -> None:
        """Makes the folder with `recordings`, `uploads`, `actuators`, `sessions`, `challenges` and `scenes` in it.

        A relative path or a link is resolved here, once: what is built from it below holds wherever the program works.
        """
        try:
            self.folder = folder.resolve()
        except (OSError, RuntimeError):
            raise InputError(f"--data-dir {folder}: links there lead in a circle; name a folder") from None
        self.recordings, self.uploads, self.actuators, self.sessions, self.challenges, self.scenes = self.own = tuple(
            self.folder / name for name in ("recordings", "uploads", "actuators", "sessions", "challenges", "scenes")
        )
        for made in self.own:
            try:
                made.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"--data-dir {folder}: {made.name} cannot be made ({error.strerror})") from None
        self._receiving: dict[Path, FileLock] = {}
        for at, _ in _walked(self.folder):
            remove_abandoned(at)

    def measurements(self, most: int | None = _MOST_LISTED) -> list[str]:
        """Names of the files that may hold measurements, relative to the folder, the newest first; no runs of ours.

        most: of them.
        """
        own = f"{self.recordings.name}/"
        return [name for name in self._files(self.folder, tuple(FORMATS), most) if not name.startswith(own)]

    def folders(self) -> dict[str, int]:
        """The folders that hold measurements themselves, "." for this one, and how many; in order of their names.

        What the app itself has recorded is left out.
        """
        found = Counter(Path(name).parent.as_posix() for name in self.measurements(most=None))
        return dict(sorted((name, count) for name, count in found.items() if name != self.recordings.name))

    def inner(self, name: str) -> Path:
        """The folder of that name, relative to this one."""
        try:
            path = (self.folder / name).resolve()
            fits = self.holds(path) and path.is_dir()
        except (OSError, ValueError, RuntimeError):
            fits = False
        if not fits:
            raise InputError(f"{shown(name, 100)}: no such folder in the data folder; choose one of the list")
        return path

    def actuator_files(self) -> list[str]:
        """Names of the uploaded actuator files."""
        return self._files(self.actuators, (ACTUATOR_SUFFIX,))

    def session_files(self) -> list[str]:
        """Names of the saved sessions, the newest first."""
        return self._files(self.sessions, (SESSION_SUFFIX,))

    def session(self, name: str) -> Path:
        """The saved session of that name, relative to the folder."""
        return self._existing(name, (SESSION_SUFFIX,))

    def challenge_files(self) -> list[str]:
        """Names of the sealed challenges, the newest first."""
        return self._files(self.challenges, (CHALLENGE_SUFFIX,))

    def challenge(self, name: str) -> Path:
        """The sealed challenge of that name, relative to the folder."""
        return self._existing(name, (CHALLENGE_SUFFIX,))

    def measurement(self, name: str) -> Path:
        """The file of that name, relative to the folder."""
        return self._existing(name, tuple(FORMATS))

    def actuator(self, name: str) -> Path:
        """The actuator file of that name, relative to the folder."""
        return self._existing(name, (ACTUATOR_SUFFIX,))

    def beside(self, path: Path) -> Path:
        """The side file's path of a measurement, which may not exist; refused if a link leads it outside."""
        side = side_path(path)
        if not self.holds(side):
            raise InputError(f"{shown(side.name)}: leads out of the data folder; replace the link by a file")
        return side

    def holds(self, path: Path) -> bool:
        """Whether the path, its links followed, ends inside the folder."""
        try:
            return path.resolve().is_relative_to(self.folder)
        except (OSError, ValueError, RuntimeError):  # no name at all, or links in a circle
            return False

    def place(self, filename: str) -> Path:
        """Where an upload of that name is to be kept: safe, and not yet taken.

        Measurements go to `uploads`, .toml to `actuators`, .emaviz to `sessions`, .challenge to `challenges`.
        """
        name = sanitised(filename)
        suffix = Path(name).suffix.lower()
        if suffix not in (*FORMATS, ACTUATOR_SUFFIX, SESSION_SUFFIX, CHALLENGE_SUFFIX):
            known = ", ".join(FORMATS)
            raise InputError(
                f"{shown(name)}: the page takes measurements ({known}), actuator files (.toml), sessions (.emaviz) and "
                "sealed challenges (.challenge); convert it"
            )
        folders = {
            ACTUATOR_SUFFIX: self.actuators,
            SESSION_SUFFIX: self.sessions,
            CHALLENGE_SUFFIX: self.challenges,
        }
        return self._free(folders.get(suffix, self.uploads), name)

    def fresh(self, where: Path, what: str, suffix: str) -> Path:
        """A name for what the app writes there itself: the time, and what it is; not yet taken."""
        return self._free(where, f"{datetime.now():%Y%m%d-%H%M%S}-{what}{suffix}")

    def part(self) -> Path:
        """A new file in `uploads` for a transfer on its way; `measurements` leaves it out."""
        if not self.holds(self.uploads):
            raise InputError("the data folder's uploads leads out of it; replace the link by a folder")
        for gone in [path for path in self._receiving if not path.exists()]:
            self._receiving.pop(gone).release()
        try:
            path, lock = new_draft(self.uploads)
        except OSError as error:
            raise InputError(f"{self.uploads}: cannot be written ({error.strerror}); check the disk") from None
        if lock is not None:
            self._receiving[path] = lock
        return path

    def drop(self, part: Path) -> None:
        """Gives up what `part` began."""
        with suppress(OSError):
            part.unlink()
        if lock := self._receiving.pop(part, None):
            lock.release()

    def keep(self, part: Path, filename: str) -> Path:
        """Gives a finished transfer its name; returns where it is.  The part is gone in any case."""
        try:
            return self.keep_at(part, self.place(filename))
        finally:
            self.drop(part)

    def keep_at(self, part: Path, path: Path) -> Path:
        """Puts a finished transfer in that place of the folder.  The part is gone in any case."""
        try:
            os.replace(part, path)
        except OSError as error:
            raise InputError(f"{shown(path.name)}: cannot be kept ({error.strerror}); check the disk") from None
        finally:
            self.drop(part)
        return path

    def take_in(self, given: Path) -> Path:
        """Copies a file that the command line names, and its side file, into `uploads`; one inside stays."""
        check_user_file(given, "the file of a measurement")
        if self.holds(given):
            return given.resolve()
        for known in self.uploads.glob(f"{Path(sanitised(given.name)).stem}*{given.suffix.lower()}"):
            if self.holds(known) and filecmp.cmp(given, known, shallow=False):
                return known.resolve()  # of an earlier start
        try:
            path = self.place(given.name)
            if side_path(given).is_file():
                with whole_file(side_path(path)) as draft:
                    shutil.copyfile(side_path(given), draft)
            with whole_file(path) as draft:
                shutil.copyfile(given, draft)
        except OSError as error:
            raise InputError(f"{shown(given, 300)}: cannot be copied into the data folder ({error.strerror})") from None
        return path.resolve()

    def named_in(self, line: str) -> str:
        """A line with this folder's files by their names here, by which the page knows them."""
        return line.replace(f"{self.folder}/", "")

    def name_of(self, path: Path) -> str:
        """As `measurements` lists it."""
        return path.resolve().relative_to(self.folder).as_posix()

    def scene(self, name: str) -> bytes | None:
        """The page of a scene that the app has written, or None."""
        try:
            return self._existing(f"{self.scenes.name}/{name}", (".html",)).read_bytes()
        except (InputError, OSError):
            return None

    def _existing(self, name: str, suffixes: tuple[str, ...]) -> Path:
        try:
            path = (self.folder / name).resolve()
            fits = path.is_relative_to(self.folder) and path.suffix.lower() in suffixes and path.is_file()
        except (OSError, ValueError, RuntimeError):
            fits = False
        if not fits:
            raise InputError(f"{shown(name, 100)}: no such file in the data folder; choose one of the list")
        return (self.folder / name).resolve()

    def _free(self, folder: Path, name: str) -> Path:
        if not self.holds(folder):
            raise InputError(f"the data folder's {folder.name} leads out of it; replace the link by a folder")
        stem, suffix = Path(name).stem, Path(name).suffix.lower()
        candidates = (f"{stem}{'' if i == 1 else f'-{i}'}{suffix}" for i in range(1, 10_000))
        # A side file of that stem would be taken for the new file's.
        free = (
            folder / c
            for c in candidates
            if not os.path.lexists(folder / c) and not os.path.lexists(side_path(folder / c))
        )
        path = next(free, None)
        if path is None:
            raise InputError(f"{shown(name)}: too many files have this name; rename it")
        return path

    def _files(self, folder: Path, suffixes: tuple[str, ...], most: int | None = _MOST_LISTED) -> list[str]:
        found: list[tuple[float, str]] = []
        for at, names in _walked(folder):
            for path in _episodes(at) or [at / name for name in names]:
                hidden = path.name.startswith(".") or path.suffix.lower() not in suffixes
                if not hidden and path.is_file() and self.holds(path):
                    with suppress(OSError):
                        found.append((-path.stat().st_mtime, path.relative_to(self.folder).as_posix()))
        return [name for _, name in sorted(found)[:most]]


def _walked(folder: Path) -> Iterator[tuple[Path, list[str]]]:
    """The folder and those below it that are looked into, each with the names in it."""
    for at, folders, names in os.walk(folder):
        depth = len(Path(at).relative_to(folder).parts)
        if _episodes(Path(at)):  # which lie deeper
            folders.clear()
        folders[:] = [f for f in sorted(folders) if not f.startswith(".") and depth + 1 < _DEEPEST]
        yield Path(at), names


def _episodes(folder: Path) -> list[Path]:
    """The files of a robot's dataset, where the folder is one."""
    return [Path(file) for file in parquet.files_in(str(folder))]


def sanitised(filename: str) -> str:
    """The last part of a name that a browser sent, without signs that any system or page could trip over."""
    last = re.split(r"[/\\]", filename)[-1]
    cleaned = _STRANGE.sub("_", last).strip(" .")
    stem, suffix = Path(cleaned).stem, Path(cleaned).suffix
    if cleaned.startswith(".") or not stem.strip(". _") or stem.split(".")[0].lower() in _RESERVED:
        stem = f"file-{stem.strip('. ')}".rstrip("-_ ")
    return stem[: _LONGEST_NAME - len(suffix[:20])] + suffix[:20]
