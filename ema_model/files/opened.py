"""Files opened with care: limits, refusals, links, archives; and those that come with the package."""

from __future__ import annotations

import io
import math
import os
import stat
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import resources
from pathlib import Path
from typing import IO, BinaryIO

from ema_model.errors import InputError, quoted

# --- how large a file from elsewhere may be: said here once, with the reason, and used by all that read one -----------
# A few kilobytes can unpack to any size, so a limit bounds three things alike: the file on the disk, the numbers that
# are taken from it (8 bytes each), and whatever is unpacked on the way to them.  A file within it is read in less than
# three times the limit of memory, and any other is refused in one line: in 20 s, either.

FILE_BYTES = 1_000_000_000  # a measurement, on the command line: hours at 1 kHz, and three of it fit into 4 GB
PAGE_BYTES = 250_000_000  # a measurement, or an upload, on the page, whose memory all its users share
SESSION_BYTES = 500_000_000  # all files of a session together, unpacked on the disk
SESSION_FILES = 200
SETTINGS_BYTES = 8_000_000  # a session's JSON, which takes up to 25 times that as Python's objects
CHALLENGE_BYTES = 32_000_000  # a sealed challenge and its parts: four recordings of seconds
CHALLENGE_RECORDING_BYTES = 64_000_000  # one of those, unpacked in turn
TEXT_BYTES = 100_000  # an actuator file or a side file, which people write by hand

COLUMNS = 2_000  # of a measurement: loggers of whole cars have hundreds
ARRAYS = 5 * COLUMNS  # of a .npz or .mat file, columns or not
RUNS = 10_000  # of a measurement: each is looked at by itself
LINE_BYTES = 1_000_000  # of a CSV file: a number takes up to 25


def megabytes(size: float) -> str:
    """A size as the refusals write it: 250 MB."""
    return f"{size / 1e6:.6g} MB"


# --- one clear line for a file that cannot be used --------------------------------------------------------------------

_NAMES_SHOWN = 12


def shown(value: object, limit: int = 40) -> str:
    """Foreign text on one line, cut to `limit` characters; see `quoted`."""
    return quoted(value, limit)


def listed(names: Iterable[str]) -> str:
    """Foreign names joined by commas, the first dozen of them."""
    names = list(names)
    more = [f"… ({len(names)} in all)"] if len(names) > _NAMES_SHOWN else []
    return ", ".join([shown(name.strip()) or "(unnamed)" for name in names[:_NAMES_SHOWN]] + more) or "none"


def refusal(path: str | os.PathLike[str], problem: str) -> InputError:
    """The error to raise: the file's name as given, then what is wrong, where, and what to do."""
    return InputError(f"{shown(os.fspath(path), 300)}: {problem}")


def reason(error: Exception) -> str:
    """What the system says about an error, on one line."""
    return shown(" ".join(str(getattr(error, "strerror", None) or error).split()), 80)


# --- the door for files that a user names: a regular file of a bearable size, or one clear line -----------------------
# A pipe would be waited for, and a device read for ever.


def check_user_file(
    path: str | os.PathLike[str], expected: str, most_bytes: float = math.inf, *, name: str | None = None
) -> os.stat_result:
    """The status of a regular file of at most so many bytes; raises InputError for anything else.

    expected: what the file should be, as in "an actuator file (.toml)"; name: what the error calls it, its path
    unless given.  Nothing is opened.
    """
    told = path if name is None else name
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise refusal(told, "no such file; check the name and the folder") from None
    except (OSError, ValueError) as error:
        raise _unreadable(told, error) from None
    _check(told, status, expected, most_bytes)
    return status


def open_user_file(path: str | os.PathLike[str], expected: str, most_bytes: float = math.inf) -> BinaryIO:
    """The file, opened to read bytes; raises as `check_user_file`."""
    check_user_file(path, expected, most_bytes)
    try:
        file = open(path, "rb", opener=_without_waiting)
    except OSError as error:
        raise _unreadable(path, error) from None
    try:  # what is open now may be another than what was there before
        _check(path, os.fstat(file.fileno()), expected, most_bytes)
    except InputError:
        file.close()
        raise
    return file


def _check(path: str | os.PathLike[str], status: os.stat_result, expected: str, most_bytes: float) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise refusal(path, f"is a folder; {expected} is expected")
    if not stat.S_ISREG(status.st_mode):
        raise refusal(path, f"is not a regular file; {expected} is expected")
    if status.st_size > most_bytes:
        size = f"is {status.st_size / 1e6:.6g} MB large, over the limit of {most_bytes / 1e6:g} MB"
        raise refusal(path, f"{size}; {expected} is expected")


def _without_waiting(path: str, flags: int) -> int:
    """Opens a pipe at once as well, so that it can be refused."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _unreadable(path: str | os.PathLike[str], error: Exception) -> InputError:
    return refusal(path, f"cannot be read ({reason(error)}); check the name and the permissions")


# --- takes a zip apart that may mean harm -----------------------------------------------------------------------------
# Takes a zip apart that may mean harm: .npz files, sessions and sealed challenges are zips, and come from elsewhere.
#
# The sizes that a zip declares are only claims, some ways of packing unpack gigabytes at a time, and members may
# share their bytes. So only stored and deflated members are taken, piece by piece, and every byte that comes out is
# counted.

_PIECE = 1 << 20
_DIRECTORY_BYTES = 4 << 20  # the list of members, which zipfile reads at once: each takes 46 and its name
_ENCRYPTED = 0x1  # of a member's flags
_OTHER_WAYS = {9: "deflate64", 12: "bzip2", 14: "LZMA", 93: "Zstandard"}


class Damaged(Exception):
    """No zip, or a broken one; the text says why, for a person."""


class Refused(Exception):
    """A zip that is not taken; the text says what it does, for a person; the reader adds what to do."""


class SafeZip:
    """The members of a zip by name; all that is read of them, together, stays below `most_bytes`.

    A name stands here as it does in the zip, and is good for nothing but to ask for the member.
    """

    def __init__(self, archive: zipfile.ZipFile, most_members: int, most_bytes: int) -> None:
        members = [info for info in archive.infolist() if not info.is_dir()]
        if len(members) > most_members:
            raise Refused(f"holds {len(members)} files, over the limit of {most_members}")
        for info in members:
            if info.flag_bits & _ENCRYPTED:
                raise Refused("is encrypted")
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                way = _OTHER_WAYS.get(info.compress_type, f"method {info.compress_type}")
                raise Refused(f"holds {shown(info.filename)!r} packed by {way}, where only deflate is taken")
        twice = [name for name, count in Counter(info.filename for info in members).items() if count > 1]
        if twice:
            raise Refused(f"holds {shown(twice[0])!r} twice")
        self._archive, self._members = archive, {info.filename: info for info in members}
        self._most_bytes, self._read = most_bytes, 0

    @property
    def names(self) -> list[str]:
        """All members' names, in the zip's order."""
        return list(self._members)

    @contextmanager
    def open(self, name: str) -> Iterator[Member]:
        """A member to read from; Damaged if there is none of that name."""
        if name not in self._members:
            raise Damaged(f"{shown(name)} is missing")
        with _told():
            file = self._archive.open(self._members[name])
        with file:
            yield Member(self, file)

    def read(self, name: str, most_bytes: int | None = None) -> bytes:
        """A whole member, which may have a limit of its own."""
        whole = io.BytesIO()
        with self.open(name) as member:
            while piece := member.read(_PIECE):
                whole.write(piece)
                if most_bytes is not None and whole.tell() > most_bytes:
                    raise Refused(f"holds {shown(name)!r} of over {megabytes(most_bytes)}, which is the limit")
        return whole.getvalue()

    def copy(self, name: str, target: IO[bytes]) -> None:
        """Writes a whole member to a file."""
        with self.open(name) as member:
            while piece := member.read(_PIECE):
                target.write(piece)

    def count(self, size: int) -> None:
        """Adds to what was read."""
        self._read += size
        if self._read > self._most_bytes:
            raise Refused(f"unpacks to over {megabytes(self._most_bytes)}, which is the limit")


class Member:
    """A member of a zip, opened."""

    def __init__(self, archive: SafeZip, file: IO[bytes]) -> None:
        self._archive, self._file = archive, file

    def read(self, size: int) -> bytes:
        """Up to `size` bytes, unpacked, and never more than a megabyte; none at the end."""
        with _told():
            piece = self._file.read(min(size, _PIECE))
        self._archive.count(len(piece))
        return piece


@contextmanager
def opened_zip(file: BinaryIO, most_members: int, most_bytes: int) -> Iterator[SafeZip]:
    """The members of a zip, which raise Damaged and Refused as this does."""
    with ExitStack() as closing:
        with _told():
            archive = closing.enter_context(zipfile.ZipFile(_Sparing(file)))  # type: ignore
            # Members that share their bytes could each be read from end to end, over and over.
            if sum(info.compress_size for info in archive.infolist()) > os.fstat(file.fileno()).st_size:
                raise Damaged("its members overlap")
        yield SafeZip(archive, most_members, most_bytes)


class _Sparing(io.BufferedReader):
    """A file that gives no more at once than a zip's directory may have, since zipfile reads that in one piece."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is not None and size > _DIRECTORY_BYTES:
            raise Damaged("its directory is too large")
        return super().read(size)


@contextmanager
def _told() -> Iterator[None]:
    """Around zipfile: a damaged zip fails in as many ways as there are layers below it."""
    try:
        yield
    except (Damaged, MemoryError):
        raise
    except Exception as error:
        name = "" if isinstance(error, zipfile.BadZipFile) else f"{type(error).__name__}: "
        raise Damaged(f"{name}{shown(error, 80)}" if str(error) else type(error).__name__) from None


# --- the files that come with the package -----------------------------------------------------------------------------


def shipped_folder(name: str) -> Path:
    """A folder of assets: inside the installed package, or in the repository beside it."""
    inside = Path(str(resources.files("ema_model") / "assets" / name))
    return inside if inside.is_dir() else Path(__file__).parents[2] / "assets" / name


# --- a folder that recordings arrive in: which of them are whole ------------------------------------------------------

LOOK_S = 1.0  # between two looks
_As = tuple[int, int]  # size and time of the last change


class Watched:
    """Files as they grow: one has arrived once it is as it was at the look before, and again if it changes later."""

    def __init__(self) -> None:
        self._seen: dict[Path, _As] = {}
        self._arrived: dict[Path, _As] = {}

    def arrived(self, paths: Iterable[Path]) -> list[Path]:
        """Those that have stopped growing since the last call; to be called every `LOOK_S`."""
        before, self._seen = self._seen, {}
        for path in paths:
            try:
                at = path.stat()
            except OSError:  # it is gone again
                continue
            self._seen[path] = at.st_size, at.st_mtime_ns
        new = {path: at for path, at in self._seen.items() if before.get(path) == at != self._arrived.get(path)}
        self._arrived |= new
        return [*new]

    def take(self, paths: Iterable[Path]) -> None:
        """These count as arrived, as they were seen last."""
        self._arrived |= {path: self._seen[path] for path in paths if path in self._seen}

    def forget(self, paths: Iterable[Path]) -> None:
        """These arrive once more."""
        for path in paths:
            self._arrived.pop(path, None)
