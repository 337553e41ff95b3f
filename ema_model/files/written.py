"""Files written whole: drafts, locks, TOML."""

from __future__ import annotations

import errno
import os
import re
import secrets
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import filelock
import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Null, Table

from ema_model.errors import InputError, quoted
from ema_model.files.opened import open_user_file

# --- a file lock that dies with its process: tells a recording being written from one left behind ---------------------

_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EINVAL)  # what such file systems answer


class FileLock:
    """An exclusive lock on `path`, held from `acquire` to `release` or the end of the process.

    The operating system drops the lock when the process ends in whatever way, so that, unlike a process
    number written in a file, it never outlives its owner and cannot be mistaken for another's.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Where a file system has no such locks, a marker that outlives a killed process is no substitute.
        self._lock = filelock.FileLock(path, thread_local=False, fallback_to_soft=False)

    @classmethod
    def acquire(cls, path: Path, wait_s: float = 0.0) -> FileLock | None:
        """The lock, or None if somebody living still holds it after `wait_s`, or the file system has none.

        OSError if the folder cannot be written.
        """
        if not path.parent.is_dir():  # which filelock would make
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path.parent))
        taken = cls(path)
        try:
            taken._lock.acquire(wait_s)
        except filelock.Timeout:
            return None
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            return None
        return taken

    @staticmethod
    def is_held(path: Path) -> bool:
        """Whether somebody living holds the lock; a file that a killed process left is no lock."""
        if not path.exists():
            return False
        try:
            lock = FileLock.acquire(path)
        except OSError:
            return False
        if lock is not None:
            lock.release()
        return lock is None

    def release(self) -> None:
        """Removes the file and unlocks; a second call does nothing."""
        if self._lock.is_locked:
            with suppress(OSError):  # while it is held: another's must not go; Windows keeps open files
                self.path.unlink(missing_ok=True)
            self._lock.release()


# --- a file that appears whole or not at all, whatever interrupts its writing -----------------------------------------

_DRAFT = re.compile(r"\.[0-9a-f]{16}\.part")
_LOCK = ".lock"  # behind the name of what is being written
_TRIES = 5
_LONGEST_S = 10.0  # to wait for another who changes the same file, which takes milliseconds


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Gives a draft to write, in the same folder; at the end it takes the file's place, after a failure it goes.

    A link is followed, so that it stays one.  Raises what writing the draft raises, and OSError.
    """
    target = Path(os.path.realpath(path))
    draft, lock = new_draft(target.parent)
    try:
        yield draft
        os.replace(draft, target)
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        if lock is not None:
            lock.release()


def write_text(path: str | os.PathLike[str], text: str, what: str) -> None:
    """Writes a text file, whole or not at all; InputError in one line where that cannot be done.

    what: it is, as 'the report'.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise InputError(f"{quoted(target)}: is a folder; name a file in it")
        if not target.parent.is_dir():
            raise InputError(f"{quoted(target)}: the folder {quoted(target.parent)} does not exist; make it first")
        with whole_file(target) as draft:
            draft.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise InputError(f"{quoted(target)}: {what} cannot be written: {why}; write it elsewhere") from None


def change_file(path: str | os.PathLike[str], change: Callable[[str], str], most_bytes: int) -> None:
    """Writes what `change` makes of the file's text, whole; of several who change it at once, each sees the last.

    What is no file of UTF-8 text of at most so many bytes counts as empty.  Raises what `change` raises, and OSError.
    """
    target = Path(os.path.realpath(path))
    lock = None
    with suppress(OSError):  # where no lock is to be had, the last one's text stands
        lock = FileLock.acquire(lock_path(target), _LONGEST_S)
    try:
        text = change(_text_of(target, most_bytes))
        with whole_file(target) as draft:
            draft.write_text(text, encoding="utf-8", newline="")
    finally:
        if lock is not None:
            lock.release()


def _text_of(path: Path, most_bytes: int) -> str:
    try:
        with open_user_file(path, "a text", most_bytes) as file:
            return file.read().decode("utf-8")
    except (InputError, OSError, UnicodeDecodeError):
        return ""


def new_draft(folder: Path) -> tuple[Path, FileLock | None]:
    """A hidden name in the folder, and the lock that tells `remove_abandoned` that its owner lives.

    The lock is None where the file system has none.  OSError if the folder cannot be written.
    """
    for _ in range(_TRIES):
        draft = folder / f".{secrets.token_hex(8)}.part"
        # Who removes abandoned drafts may come between the making of a lock's file and its locking.
        if (lock := FileLock.acquire(lock_path(draft))) is not None:
            return draft, lock
        lock_path(draft).unlink(missing_ok=True)
    return folder / f".{secrets.token_hex(8)}.part", None


def lock_path(path: Path) -> Path:
    """NAME.lock: locked as long as the process lives that writes NAME."""
    return path.with_name(path.name + _LOCK)


def remove_abandoned(folder: str | os.PathLike[str]) -> None:
    """Removes the drafts and locks in the folder whose processes were killed; those of living ones stay.

    A recording that was cut off (NAME.rrd.part) and a file that was to be changed (NAME.toml) stay as well, and lose
    their locks only.  Raises no OSError.
    """
    with suppress(OSError):
        names = os.listdir(folder)
        locked = {name.removesuffix(_LOCK) for name in names if name.endswith(_LOCK)}
        kept = {name for name in locked if name.endswith((".rrd.part", ".toml"))}
        for name in {*filter(_DRAFT.fullmatch, {*names, *locked}), *kept}:
            _remove(Path(folder, name))


def _remove(path: Path) -> None:
    with suppress(OSError):
        if (lock := FileLock.acquire(lock_path(path))) is None:
            return
        try:
            if _DRAFT.fullmatch(path.name):
                path.unlink(missing_ok=True)
        finally:
            lock.release()


# --- takes TOML that comes from elsewhere: whatever is wrong with it ends in one kind of error, and soon --------------

MARK = "\ufeff"  # what editors of Windows put before a text in UTF-8
# tomllib takes a time that grows with the square of a dotted key's parts: minutes for 100 kB of a.a.a.a….
_MOST_PARTS = 30
_PART = r"""(?: [\w-]+ | "[^"\n]*" | '[^'\n]*' ) [ \t]* \. [ \t]*"""
_LONG_KEY = re.compile(rf"(?<![\w-]) (?: {_PART} ){{{_MOST_PARTS}}}", re.VERBOSE)
# Whole numbers that Python reads, but does not write out into an error's line.
_LONG_NUMBER = re.compile(r"0[xob][0-9a-fA-F_]{1000}")


def toml_of(text: str) -> dict[str, Any]:
    """The document; ValueError, its text for a person, if it is none.  A byte order mark before it is no part of it."""
    text = text.removeprefix(MARK)
    if _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {_MOST_PARTS} parts")
    if _LONG_NUMBER.search(text):
        raise ValueError("a number has too many digits")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # Python's own, of thousands of digits
        raise ValueError("a number has too many digits") from None


# --- TOML is written: comments, order and spelling of an older text stay, where what they say stays -------------------

_FAILURES = (TOMLKitError, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


def toml_text(document: Mapping[str, Any], over: str = "") -> str:
    """The document as TOML; over: an older text, which is changed only where it says something else.

    An older text that is no TOML counts for nothing.
    """
    over = over.removeprefix(MARK)
    if over.strip():
        try:
            toml_of(over)  # which knows what takes long
            head, tail = _cut(over)
            whole = tomlkit.parse(head)
            above = _comments_above(whole)
            _put(whole, document)
            for table, comments in above:
                table.trivia.indent = comments
            text = tomlkit.dumps(whole)
            text += ("" if not text or text.endswith("\n") else "\n") + tail
            if toml_of(text) == _plain(document):
                return text
        except _FAILURES:  # what is written counts more than how it was spelt
            pass
    return tomlkit.dumps(document)


def inline(value: Any) -> Any:
    """The value on one line: tables within tables and lists have no heads of their own."""
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for name, one in value.items():
            table[_writable(name)] = inline(one)
        return table
    if isinstance(value, list | tuple):
        found = tomlkit.array()
        for one in value:
            found.append(inline(one))
        return found
    return tomlkit.item(_writable(value) if isinstance(value, str) else value)


def _writable(text: str) -> str:
    """Lone surrogates have no place in UTF-8."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _cut(text: str) -> tuple[str, str]:
    """What is said, and the comments behind all of it."""
    lines = text.split("\n")
    while lines and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
        lines.pop()
    if not lines:
        return text, ""
    said = "\n".join([*lines, ""])
    return text[: len(said)], text[len(said) :]


def _put(old: Any, new: Mapping[str, Any]) -> None:
    for name in [name for name in old if name not in new]:
        del old[name]
    for name, value in new.items():
        if name not in old:
            old[name] = value
        elif _changes_inside(old[name], value):
            _put(old[name], value)
        elif isinstance(old[name], list) and isinstance(value, list) and _are_tables(old[name], value):
            for one, other in zip(old[name], value):
                _put(one, other)
        elif not _says_the_same(_plain(old[name]), _plain(value)):
            old[name] = value


def _changes_inside(old: Any, new: Any) -> bool:
    """Whether both are tables; one on a line is written anew where it has other entries."""
    if not isinstance(old, Mapping) or not isinstance(new, Mapping):
        return False
    return not isinstance(old, InlineTable) or set(old) == set(new)


def _says_the_same(old: Any, new: Any) -> bool:
    return old == new and isinstance(old, bool) == isinstance(new, bool)


def _are_tables(old: list[Any], new: list[Any]) -> bool:
    return len(old) == len(new) and all(isinstance(one, Mapping) for one in (*old, *new))


def _plain(value: Any) -> Any:
    """The value as `tomllib` reads it."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value.unwrap() if hasattr(value, "unwrap") else value


def _comments_above(whole: tomlkit.TOMLDocument) -> list[tuple[Table, str]]:
    """What stands above each table's head, taken from the table before it, to which tomlkit counts it.

    So a new key follows the last one, and a table that goes takes no other's comments along.
    """
    found, before = [], whole
    for table in _tables(whole):
        body = before.body
        last = next((i for i in reversed(range(len(body))) if not isinstance(body[i][1], Table)), -1)
        first = last
        while first >= 0 and body[first][0] is None:
            first -= 1
        if before is not whole or first >= 0:  # else it is the file's own head
            text = "".join(item.as_string() for _, item in body[first + 1 : last + 1])
            found.append((table, text + table.trivia.indent))
            for i in range(first + 1, last + 1):
                body[i] = (None, Null())
        before = table.value
    return found


def _tables(container: Container) -> Iterator[Table]:
    """Those with a head of their own, in their order."""
    for _, item in container.body:
        if isinstance(item, Table) and not isinstance(item, InlineTable):
            if not item.is_super_table():
                yield item
            yield from _tables(item.value)
