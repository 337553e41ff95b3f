"""Every command's options, and what they need at least."""

from __future__ import annotations

import argparse

from emaviz.cli import COMMANDS
from emaviz.cli.files import Input
from emaviz.cli.parser import parser_of

TEXT = {  # options that name no file and take no single number; each is refused or taken by what it is for
    "--fault", "--effect", "--map", "--free", "--signal", "--set", "--host", "--allow-host", "--data-dir", "name",
    "--scheduler", "--threshold", "--encoding",
}  # fmt: skip


def command_parser(command: str) -> argparse.ArgumentParser:
    """The parser of one command."""
    (commands,) = (a for a in parser_of(command)._actions if isinstance(a, argparse._SubParsersAction))
    return commands.choices[command]


def options_with_values() -> list[tuple[str, str, argparse.Action]]:
    """Command, name and action of all that take a value."""
    return [
        (command, (action.option_strings or [action.dest])[0], action)
        for command in COMMANDS
        for action in command_parser(command)._actions
        if action.nargs != 0 and not isinstance(action, argparse.BooleanOptionalAction)
    ]


def needed(command: str, recording: str, but: argparse.Action | None = None) -> list[str]:
    """The command with the least that it asks for; `recording` where it reads a file."""
    given = [command]
    for action in command_parser(command)._actions:
        if action.dest == (but and but.dest):
            continue
        if isinstance(action.type, Input) and not action.option_strings:
            given.append(recording)
        elif action.required and action.option_strings:
            given += [action.option_strings[0], "needed.csv"]
    return given
