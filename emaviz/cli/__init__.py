"""The command line: `verbs` has a file for each of its commands, beside it stands what they share."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from ema_model.members import names

# Whatever takes time is imported where an interrupt ends the program as it should.
from emaviz.cli.exit_code import ExitCode
from emaviz.cli.interrupt import until_interrupted

COMMANDS = tuple(names("emaviz.cli.verbs"))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit code.  Without arguments it is the program, which an interrupt ends."""
    if arguments is None:
        return until_interrupted(lambda: _run(sys.argv[1:]))
    return _run(list(arguments))


def _run(given: list[str]) -> int:
    try:
        from ema_model.errors import InputError
        from emaviz.cli.parser import parser_of

        if given[:1] not in (["-h"], ["--help"], ["--version"]) and (not given or given[0] not in COMMANDS):
            given.insert(0, "gui")
        try:
            parsed = parser_of(given[0]).parse_args(given)
            return int(parsed.run(parsed) or ExitCode.DONE)
        except InputError as error:
            print(f"emaviz: {error}", file=sys.stderr)
            return ExitCode.WRONG_INPUT
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        import os

        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return ExitCode.DONE
