"""What every command says: JSON with its provenance, and progress on a terminal."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from ema_model.errors import InputError
from ema_model.files.whole_file import whole_file
from emaviz import __version__

if TYPE_CHECKING:
    from emaviz.cli.documents import HeadJson


def write_json(arguments: Any, result: Mapping[str, Any]) -> None:
    """Writes a result with its schema, versions, seed and options to --json, whole or not at all; nothing without it.

    InputError if it cannot be written.
    """
    path = arguments.json
    if path is None:
        return
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


class Progress:
    """A line on stderr that says how far a long command is; silent off a terminal and in the first second."""

    def __init__(self) -> None:
        self._started = self._shown = time.monotonic()
        self._drawn = False

    def show(self, text: str) -> None:
        """Replaces the line, ten times a second at most."""
        now = time.monotonic()
        if not sys.stderr.isatty() or now - self._started < 1.0 or now - self._shown < 0.1:
            return
        self._shown, self._drawn = now, True
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)

    def done(self) -> None:
        """Takes the line away."""
        if self._drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._drawn = False


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return str(value)
