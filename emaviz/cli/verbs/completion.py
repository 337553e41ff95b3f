"""`emaviz completion`: what a shell runs to complete commands, options and their choices."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from shlex import quote
from typing import NamedTuple

HELP = "print what completes commands and options in bash, zsh or fish"
PLACE = 13
_USE = {
    "bash": 'eval "$(emaviz completion bash)" in ~/.bashrc',
    "zsh": 'eval "$(emaviz completion zsh)" in ~/.zshrc, after compinit',
    "fish": "emaviz completion fish | source in ~/.config/fish/config.fish",
}


class _Level(NamedTuple):
    """What may follow a command, "actuator new" of one's verb; "" for the program itself."""

    command: str
    below: dict[str, str]  # the commands below it, with their help
    actions: list[argparse.Action]  # the options, and positional arguments with choices

    @property
    def words(self) -> list[str]:
        options = [name for one in self.actions for name in one.option_strings]
        return [*self.below, *(c for one in self.actions if not one.option_strings for c in _choices(one)), *options]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The shell."""
    uses = "; ".join(_USE.values())
    parser.add_argument("shell", choices=tuple(_SHELLS), metavar="|".join(_SHELLS), help=f"put it to use by: {uses}")


def run(arguments: argparse.Namespace) -> int:
    """Prints the script."""
    from emaviz.cli.parser import whole_parser

    print("\n".join(_SHELLS[arguments.shell](list(_levels(whole_parser())))))
    return 0


def _levels(parser: argparse.ArgumentParser, command: str = "") -> Iterator[_Level]:
    below, actions = {}, []
    for one in parser._actions:
        if isinstance(one, argparse._SubParsersAction):
            below = {str(sub.dest): str(sub.help) for sub in one._choices_actions}
            for name, sub in one.choices.items():
                yield from _levels(sub, f"{command} {name}".strip())
        elif one.option_strings or one.choices:
            actions.append(one)
    yield _Level(command, below, actions)


def _choices(action: argparse.Action) -> list[str]:
    return [str(one) for one in action.choices or ()]


def _cases(levels: list[_Level], take: str) -> Iterator[str]:
    """How bash and zsh find the command in what is typed, and the words that may follow; take: %s are words."""
    commands = "|".join(quote(f"{level.command} {name}") for level in levels for name in level.below)
    yield f'    case "$at $word" in {commands}) at="${{at:+$at }}$word" ;; esac; done'
    yield '  case "$at|$before" in'
    for level in levels:
        for one in level.actions:
            if one.option_strings and one.choices:
                names = "|".join(quote(f"{level.command}|{name}") for name in one.option_strings)
                yield f"    {names}) {take % ' '.join(map(quote, _choices(one)))}; return ;;"
    yield '  esac\n  case "$at" in'
    yield from (f"    {quote(level.command)}) {take % ' '.join(map(quote, level.words))} ;;" for level in levels)
    yield "  esac"


def _bash(levels: list[_Level]) -> Iterator[str]:
    yield '_emaviz() {\n  local at="" word before="${COMP_WORDS[COMP_CWORD-1]}"'
    yield '  for word in "${COMP_WORDS[@]:1:COMP_CWORD-1}"; do'
    yield from _cases(levels, 'COMPREPLY=($(compgen -W "%s" -- "${COMP_WORDS[COMP_CWORD]}"))')
    yield "}\ncomplete -o default -F _emaviz emaviz"  # files, where no word fits


def _zsh(levels: list[_Level]) -> Iterator[str]:
    yield '_emaviz() {\n  local at="" word before="${words[CURRENT-1]}"'
    yield '  for word in "${(@)words[2,CURRENT-1]}"; do'
    yield from _cases(levels, "compadd -- %s")
    yield "  [[ $PREFIX == -* ]] || _files\n}\ncompdef _emaviz emaviz"


def _fish(levels: list[_Level]) -> Iterator[str]:
    for level in levels:
        seen = "; and ".join(f"__fish_seen_subcommand_from {word}" for word in level.command.split())
        none = f"not __fish_seen_subcommand_from {' '.join(level.below)}" if level.below else ""
        start = f"complete -c emaviz -n {quote('; and '.join(filter(None, (seen, none))))}"
        yield from (f"{start} -a {name} -d {quote(text)}" for name, text in level.below.items())
        for one in level.actions:
            names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in one.option_strings)
            takes = f"-x -a {quote(' '.join(_choices(one)))}" if one.choices else "" if one.nargs == 0 else "-r"
            text = (one.help or "").replace("%%", "%")
            yield f"{start} {names} {takes} -d {quote(text)}"


_SHELLS: dict[str, Callable[[list[_Level]], Iterator[str]]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}
