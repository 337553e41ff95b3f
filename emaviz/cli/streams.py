"""Standard streams that are closed, full or no longer read: the program ends with a line and not with a traceback."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any, TextIO

from emaviz.cli.exit_code import ExitCode


def open_closed() -> None:
    """Opens what the shell has closed (`>&-`), so that no file of ours takes its number; stdout still refuses text.

    To be called before anything is opened.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            opened = os.open(os.devnull, os.O_WRONLY if name == "stderr" else os.O_RDONLY)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, open(number, "r" if name == "stdin" else "w", encoding="utf-8", closefd=False))


def until_unwritable(run: Callable[[], int], say: Callable[[str], None]) -> int:
    """Runs the program and returns its exit code: 1, and a line, where its standard output could not be written.

    That nobody reads it any longer, as `| head` does, is no failure.
    """
    out = _Out(sys.stdout)
    sys.stdout = out  # type: ignore[assignment]
    try:
        try:
            return run()
        finally:
            out.flush()
    except OSError as error:
        if error is not out.failure:
            raise
    except SystemExit:  # of --help, whose writing ignores a failure
        if out.failure is None:
            raise
    finally:
        if out.failure is not None:  # what is still to be written must not fail when Python ends
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, out.fileno())
            os.close(nowhere)
    assert out.failure is not None, "else it has returned, or raised"
    if isinstance(out.failure, BrokenPipeError):
        return ExitCode.DONE
    why = out.failure.strerror if out.failure is not None else ""
    say(f"the standard output cannot be written ({why}); check where it goes")
    return ExitCode.FAILED


class _Out:
    """A text stream that remembers how it failed."""

    def __init__(self, to: TextIO) -> None:
        self._to = to
        self.failure: OSError | None = None

    def write(self, text: str) -> int:
        try:
            return self._to.write(text)
        except OSError as error:
            self.failure = error
            raise

    def flush(self) -> None:
        try:
            self._to.flush()
        except OSError as error:
            self.failure = error
            raise

    def __getattr__(self, name: str) -> Any:
        return getattr(self._to, name)
