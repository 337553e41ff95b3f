"""Formats of logs: what a library of theirs finds in a file becomes columns on one clock, in a process of its own.

A format's file gives a function `opened(path, most_bytes)`, which yields a `Log`, and makes its `FORMAT` here.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

from ema_model.files import sandbox
from ema_model.files.opened import listed, refusal, shown
from ema_model.recordings.formats import channels
from ema_model.recordings.formats.channels import Log, NoLog, told, with_own_clocks, with_runs
from ema_model.recordings.formats.format import Array, Clocks, Columns, Format
from ema_model.recordings.formats.npz import check_lengths

_PATIENCE_S = 20.0  # for one question; some libraries never end
INSTALL = "pip install 'emaviz[rigs]'"


def log_format(module: str, title: str, *suffixes: str, needs: str = "", doubtful: tuple[str, ...] = ()) -> Format:
    """A format whose file is `module`; `needs` is the library that reads it, if it is not always installed."""

    def ask(function: str, path: str, max_bytes: int, *more: Any) -> sandbox.Answer:
        if needs and importlib.util.find_spec(needs) is None:
            raise refusal(path, f"{title} files are read with {needs}, which is not installed: {INSTALL}")
        with open(path, "rb"):
            pass  # what the system does not let us read, is told as for any file
        question = f"{__name__}:{function}"
        try:
            return sandbox.ask(
                question, module, path, max_bytes, *more, most_bytes=3 * max_bytes, patience_s=_PATIENCE_S
            )
        except sandbox.Broken as error:
            raise refusal(path, f"is not a whole {title} file ({error}); save it again, or in parts") from None

    def header(path: str, max_bytes: int) -> list[str]:
        names, _ = ask("names_of", path, max_bytes)
        return names

    def read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
        (found, notes, title, clocks), arrays = ask("columns_of", path, max_bytes, list(names), strict)
        columns = dict(zip(found, arrays))
        if strict:
            check_lengths(path, columns)
        clocks = Clocks(*clocks) if clocks else None
        return Columns(columns, lambda row: f"sample {row + 1}", tuple(notes), title, clocks)

    return Format(suffixes[0], title, header, read, others=suffixes[1:], doubtful=doubtful)


_last: tuple[object, Log, ExitStack] | None = None  # the file that is looked at: it is asked about more than once


def names_of(module: str, path: str, max_bytes: int) -> tuple[list[str], list[Array]]:
    """The columns' names; asked in the process of its own."""
    return list(channels.offered(path, _opened(module, path, max_bytes))), []


def columns_of(
    module: str, path: str, max_bytes: int, names: Sequence[str], strict: bool
) -> tuple[tuple[list[str], list[str], str, tuple[dict[str, str], str, str] | None], list[Array]]:
    """Names, notes, title and what `Clocks` takes, and the columns; asked in the process of its own."""
    log = _opened(module, path, max_bytes)
    notes = list(log.notes)
    if log.parameters:
        notes.append(f"single numbers in the file: {told(log.parameters)}")
    if log.left_aside:
        notes.append(f"left aside, as they are no columns of numbers: {listed(log.left_aside)}")
    with _told(module, path):
        arrays, done, clocks = channels.taken(path, log, names, max_bytes, strict)
    if strict:
        _close()
    parts = (dict(clocks.of), clocks.main, clocks.rule) if clocks else None
    return (list(arrays), notes + done, log.title, parts), list(arrays.values())


def _opened(module: str, path: str, max_bytes: int) -> Log:
    global _last
    status = os.stat(path)
    key = (module, os.path.realpath(path), status.st_mtime_ns, status.st_size, status.st_ino, max_bytes)
    if _last is not None and _last[0] == key:
        return _last[1]
    _close()
    files = ExitStack()
    with _told(module, path):
        log = files.enter_context(importlib.import_module(module).opened(path, max_bytes))
        log = with_own_clocks(with_runs(log))
    _last = key, log, files
    return log


@contextmanager
def _told(module: str, path: str) -> Iterator[None]:
    try:
        yield
    except NoLog as error:
        title = importlib.import_module(module).FORMAT.title
        raise refusal(path, f"is not a whole {title} file ({shown(error, 120)}); save it again") from None


def _close() -> None:
    global _last
    if _last is not None:
        _, _, files = _last
        _last = None
        files.close()
