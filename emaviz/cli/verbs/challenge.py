"""`emaviz challenge`: recordings to practise on, whose truth is sealed."""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import shown
from emaviz.cli import options

if TYPE_CHECKING:
    from ema_model.challenges import Challenge

HELP = "list challenges to practise on, take one's recordings, open its seal"
PLACE = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --out, --reveal."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="one of the list, which stands there without a name")
    parser.add_argument("--out", type=options.Folder(), metavar="DIR", help="a new folder for its recordings")
    parser.add_argument("--reveal", action="store_true", help="tell what is hidden in it")


def run(arguments: argparse.Namespace) -> int:
    """Lists, writes or reveals."""
    from ema_model.challenges.challenge import challenges

    known = {one.name: one for one in challenges(kind=None)}
    if arguments.name is None:
        if arguments.out or arguments.reveal:
            raise InputError(f"name a challenge: {', '.join(known)}")
        for one in known.values():
            print(f"{one.name:20} {'●' * one.grade:5}  {one.title}")
        return 0
    if arguments.name not in known:
        like = did_you_mean(arguments.name, known)
        raise InputError(f"no challenge {quoted(arguments.name)}; there are {', '.join(known)}{like}")
    one = known[arguments.name]
    if arguments.out:
        _write(one, Path(arguments.out), arguments)
    elif not arguments.reveal:
        print(f"{one.title}\n\n{one.story}\n\n--out DIR writes its recordings, --reveal opens the seal")
    if arguments.reveal:
        print("\n".join(_answer(one)))
    return 0


def _write(one: Challenge, where: Path, arguments: argparse.Namespace) -> None:
    from ema_model import practice
    from ema_model.challenges.challenge import EFFECTS
    from emaviz.cli import output

    if one.kind == EFFECTS:
        command = _copy(one, where)
    else:
        progress = output.Progress(arguments)
        try:
            practice.make(one, where, progress.show)
        finally:
            progress.done()
        command = practice.command(one, str(where))
    print(f"{one.title}\n\n{one.story}\n\nwritten to {where}; go on with\n  {command}")


def _copy(one: Challenge, where: Path) -> str:
    """The recordings that are shipped; the command line that goes on with them."""
    try:
        where.mkdir(parents=True, exist_ok=True)
        if any(where.iterdir()):
            raise InputError(f"{shown(where)}: is not empty; name another folder")
        for file in (*one.training, *one.holdout):
            shutil.copyfile(file, where / file.name)
    except OSError as error:
        raise InputError(f"{shown(where)}: cannot be written ({error.strerror}); name another folder") from None
    named = " ".join(str(where / file.name) for file in one.training)
    return f"emaviz discover {named} --holdout {' '.join(str(where / file.name) for file in one.holdout)}"


def _answer(one: Challenge) -> list[str]:
    from ema_model.challenges.challenge import EFFECTS, folder

    if one.kind != EFFECTS:
        from ema_model import practice

        return list(practice.reveal(one).lines)
    from ema_model.challenges.truth import read_truth

    return [read_truth(folder() / "truth" / f"{one.name}.toml").answer]
