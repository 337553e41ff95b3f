"""The command line: `verbs` has a file for each command that is no analysis, beside it stands what they share."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ema_model.members import names, stated

# Whatever takes time is imported where an interrupt ends the program as it should.
from emaviz.cli.ending import ExitCode, until_interrupted

# A file each, and the analyses, whose verbs are made of what they state.
COMMANDS = tuple(sorted([*names("emaviz.cli.verbs"), *stated("ema_model.analyses", "OPTIONS")]))
_WITHOUT_COMMAND = ("-h", "--help", "--version")
_VERBOSE = ("-v", "--verbose")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit code.  Without arguments it is the program, which an interrupt ends."""
    if arguments is not None:
        return _run(list(arguments))
    from emaviz.cli.ending import open_closed, until_unwritable

    open_closed()
    return until_interrupted(lambda: until_unwritable(_program, _say))


def _program() -> int:
    given = sys.argv[1:]
    try:
        return _run(given)
    except Exception as error:
        if isinstance(error, OSError) or any(text in _VERBOSE for text in given):
            raise
        from ema_model.errors import InputError  # a message on one line

        _say(str(InputError(f"an internal failure, {type(error).__name__}: {error}; --verbose shows where")))
        return ExitCode.FAILED


def _run(given: list[str]) -> int:
    try:
        from ema_model.errors import InputError
        from emaviz.cli.parser import parser_of

        try:
            parsed = parser_of(_command(given)).parse_args(given)
            verbose = vars(parsed).pop("verbose", False)  # not one of the options that results repeat
            return _verbosely(parsed, given) if verbose else int(parsed.run(parsed) or ExitCode.DONE)
        except InputError as error:
            _say(str(error))
            return ExitCode.WRONG_INPUT
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED


def _verbosely(parsed: argparse.Namespace, given: list[str]) -> int:
    from emaviz.cli.output import be_verbose

    log, begun = be_verbose(), time.monotonic()
    log.info("emaviz %s", " ".join(given))
    try:
        return int(parsed.run(parsed) or ExitCode.DONE)
    finally:
        log.info("ended after %.2f s", time.monotonic() - begun)


def _command(given: list[str]) -> str:
    """The command that is asked for; gui is put in front of options and files that follow none."""
    from ema_model.errors import InputError, did_you_mean, quoted

    first = next((text for text in given if text not in _VERBOSE), "")
    if first in COMMANDS or first in _WITHOUT_COMMAND:
        return first
    if first and not first.startswith("-") and not (Path(first).suffix or os.sep in first or os.path.exists(first)):
        like = did_you_mean(first, COMMANDS)
        raise InputError(f"{quoted(first)}: neither a command nor a file{like} (see emaviz --help)")
    given.insert(0, "gui")
    return "gui"


def _say(line: str) -> None:
    try:
        print(f"emaviz: {line}", file=sys.stderr)
    except OSError:  # the exit code must do
        return
