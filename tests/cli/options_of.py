"""Every command's options, and what they need at least."""

from __future__ import annotations

import argparse
from functools import cache

from emaviz.cli import COMMANDS
from emaviz.cli.options import Input, Output
from emaviz.cli.parser import parser_of

TEXT = {  # options that name no file and take no single number; each is refused or taken by what it is for
    "--fault", "--effect", "--map", "--free", "--signal", "--set", "--host", "--allow-host", "--data-dir", "name",
    "--scheduler", "--threshold", "--encoding", "--name", "--description", "--gear", "--where", "--runs",
    "--by", "--unit", "verb",
}  # fmt: skip


@cache
def command_parser(command: str) -> argparse.ArgumentParser:
    """The parser of one command, "actuator new" of one's verb."""
    found: argparse.ArgumentParser = parser_of(command.partition(" ")[0])
    for name in command.split():
        found = _commands(found)[name]
    return found


def every_command() -> list[str]:
    """The commands, of those with verbs each verb."""
    return [
        f"{command} {verb}".strip() for command in COMMANDS for verb in (_commands(command_parser(command)) or ("",))
    ]


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(found[0].choices) if found else {}


def options_with_values() -> list[tuple[str, str, argparse.Action]]:
    """Command, name and action of all that take a value."""
    return [
        (command, (action.option_strings or [action.dest])[0], action)
        for command in every_command()
        for action in command_parser(command)._actions
        if action.nargs != 0 and not isinstance(action, argparse.BooleanOptionalAction)
    ]


def needed(command: str, recording: str, but: argparse.Action | None = None) -> list[str]:
    """The command with the least that it asks for; `recording` where it reads a file."""
    given = command.split()
    for action in command_parser(command)._actions:
        if action.dest == (but and but.dest):
            continue
        if isinstance(action.type, Input) and not action.option_strings:
            given.append(recording)
        elif isinstance(action.type, Output) and not action.option_strings:
            given.append(f"needed{action.type.suffixes[0]}")
        elif action.required and action.option_strings:
            given += [action.option_strings[0], *(action.choices or ("needed.csv",))][:2]
    return given
