"""Makes the recordings of a challenge, knows them again, and tells its answer."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ema_model.actuator import load_actuator
from ema_model.challenges.challenge import EFFECTS, Challenge, challenges, folder
from ema_model.challenges.truth import read_toml
from ema_model.errors import InputError, quoted
from ema_model.files.opened import shown
from ema_model.practice.kinds import KINDS
from ema_model.practice.kinds.kind import Kind, Progress, Revealed, Truth
from ema_model.text import InWords

STORY = "challenge.md"  # beside the recordings: by its first line a folder is known again


def shipped(kind: str | None = None) -> list[Challenge]:
    """Those that come with the package, of one kind or of all that are made."""
    return [one for one in challenges(kind=None) if one.kind != EFFECTS and kind in (None, one.kind)]


def make(one: Challenge, where: Path, tell: Progress = lambda text, share: None) -> None:
    """Makes the recordings into a folder that is not there yet, or is empty: whole, or not at all.

    tell(text, share): what goes on, which may raise to end it.  InputError where the folder cannot be made.
    """
    kind, truth = _known(one)
    draft = where.with_name(f".{where.name}.part")
    try:
        if where.exists() and (not where.is_dir() or any(where.iterdir())):
            raise InputError(f"{shown(where)}: exists already; name another folder")
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        with _sound(one):
            kind.make(truth, load_actuator(), draft, tell)
        (draft / STORY).write_text(f"{_first(one)}\n\n{one.story}\n", encoding="utf-8")
        if where.exists():
            where.rmdir()
        draft.rename(where)
    except OSError as error:
        raise InputError(f"{shown(where)}: cannot be made ({error.strerror}); name another folder") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def challenge_in(where: Path) -> Challenge | None:
    """The challenge whose recordings a folder holds."""
    try:
        with (where / STORY).open(encoding="utf-8") as file:
            first = file.readline(1000).rstrip("\n")
    except (OSError, UnicodeDecodeError):
        return None
    return next((one for one in shipped() if _first(one) == first), None)


def reveal(one: Challenge, found: InWords | None = None) -> Revealed:
    """The answer, beside what was found."""
    kind, truth = _known(one)
    with _sound(one):
        return kind.reveal(truth, load_actuator(), found)


def command(one: Challenge, where: str) -> str:
    """The command line that goes on with the recordings in a folder."""
    return KINDS[one.kind].command(where, one.thresholds)


def _first(one: Challenge) -> str:
    return f"# {one.title} ({one.name})"


def _known(one: Challenge) -> tuple[Kind, Truth]:
    kind = KINDS.get(one.kind)
    if kind is None:
        raise InputError(f"challenge {quoted(one.name)}: no such kind as {quoted(one.kind)} ({', '.join(KINDS)})")
    return kind, read_toml(folder() / "truth" / f"{one.name}.toml")


@contextmanager
def _sound(one: Challenge) -> Iterator[None]:
    try:
        yield
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"challenge {quoted(one.name)}: its truth makes no sense ({quoted(error)})") from None
