"""The door for files that a user names: a regular file of a bearable size, or one clear line.

A pipe would be waited for, and a device read for ever.
"""

from __future__ import annotations

import math
import os
import stat
from typing import BinaryIO

from ema_model.errors import InputError
from ema_model.files.refusal import reason, refusal


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
