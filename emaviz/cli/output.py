"""What every command says: JSON with its provenance, and progress on a terminal or in a log."""

from __future__ import annotations

import argparse
import json
import logging
import re
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np

from ema_model.errors import InputError
from ema_model.files.written import whole_file
from emaviz import __version__
from emaviz.text.time_left import time_left

if TYPE_CHECKING:
    from emaviz.cli.documents import HeadJson

_LINE_EVERY_S = 10.0  # of a log

_LOG = logging.getLogger("emaviz")


def write_json(arguments: Any, result: Mapping[str, Any]) -> None:
    """Writes a result with its schema, versions, seed and options to --json, whole or not at all; nothing without it.

    InputError if it cannot be written.
    """
    path = arguments.json
    if path is None:
        return
    import numba  # takes a third of a second

    head: HeadJson = {
        "schema": 1,
        "versions": {"emaviz": __version__, "numpy": np.__version__, "numba": numba.__version__},
        "seed": getattr(arguments, "seed", 0),
        "configuration": configuration(arguments),
    }
    try:
        with whole_file(path) as draft, open(draft, "w", encoding="utf-8") as file:
            json.dump({**head, **result}, file, indent=1, default=_plain, ensure_ascii=False, allow_nan=False)
            file.write("\n")
    except OSError as error:
        raise InputError(f"--json {path}: cannot be written ({error.strerror}); check the disk") from None


def configuration(arguments: Any) -> dict[str, Any]:
    """The options as they were given or defaulted."""
    return {name: value for name, value in vars(arguments).items() if name != "run"}


def say_not_written(arguments: Any, *options: str) -> None:
    """Says which of these options have no file, since the command was interrupted."""
    given = [f"--{name.replace('_', '-')}" for name in options if getattr(arguments, name)]
    if given:
        print(f"{', '.join(given)}: not written, since the answer is not whole")


def be_verbose() -> logging.Logger:
    """What says on stderr what is done, a line each with the time of day."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(asctime)s %(message)s", "%H:%M:%S"))
    _LOG.handlers = [handler]
    _LOG.setLevel(logging.INFO)
    return _LOG


class Progress:
    """Says on stderr how far a long command is, unless it has --quiet.

    On a terminal it is one line that changes, from the first second on; elsewhere a new line every ten seconds, with
    the time since the command began and, where that can be said, about how long it will still take.
    """

    def __init__(self, arguments: argparse.Namespace, clock: Callable[[], float] = time.monotonic) -> None:
        """clock(): s, of any zero."""
        self._quiet = getattr(arguments, "quiet", False)
        self._clock = clock
        self._started = self._shown = clock()
        self._drawn = False
        self._said: tuple[str, float | None] = ("", None)
        self._over = threading.Event()  # for the thread that writes while nothing new is said
        self._writer: threading.Thread | None = None
        self._writing = threading.Lock()
        self._what = ""  # of the verbose log

    def show(self, text: str, share: float | None = None) -> None:
        """Replaces the line, ten times a second at most; share: of the whole work that is done, 0 … 1, if known."""
        if self._quiet:
            return
        self._said = text, share
        now = self._clock()
        if _LOG.isEnabledFor(logging.INFO):
            self._log_each(text, now)
            return
        if not sys.stderr.isatty():
            self.log()
            self._keep_logging()
            return
        if now - self._started < 1.0 or now - self._shown < 0.1:
            return
        self._shown, self._drawn = now, True
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)

    def log(self) -> None:
        """Writes what was said last as a line of its own, if the last line was ten seconds ago."""
        with self._writing, suppress(OSError, ValueError):  # a log that is full or closed ends no computing
            now = self._clock()
            if now - self._shown < _LINE_EVERY_S:
                return
            self._shown = now
            (text, share), elapsed_s = self._said, now - self._started
            left = "" if share is None else time_left(elapsed_s, share)
            print(f"[{timedelta(seconds=int(elapsed_s))}] {text}{left and f', {left}'}", file=sys.stderr, flush=True)

    def _log_each(self, text: str, now: float) -> None:
        """Each thing that begins, and how far it is once a second."""
        what = re.sub(r"[-+.\d]+", "", text)
        if what != self._what or now - self._shown >= 1.0:
            self._what, self._shown = what, now
            _LOG.info("%s", text)

    def done(self) -> None:
        """Takes the line away; nothing more is said until the next `show`."""
        if self._writer is not None:  # it ends here: one that Python finds at its own end can abort the process
            self._over.set()
            self._writer.join(1.0)
            self._writer = None
        if self._drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._drawn = False

    def _keep_logging(self) -> None:
        if self._writer is not None:
            return
        self._over = over = threading.Event()

        def repeat() -> None:
            while not over.wait(1.0):
                self.log()

        self._writer = threading.Thread(target=repeat, name="progress", daemon=True)
        self._writer.start()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return str(value)
