"""What a challenge gives away: its title, its story and its recordings."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

from ema_model.errors import InputError, quoted
from ema_model.files.shipped import shipped_folder

FILE = "challenge.toml"
EFFECTS = "effects"  # what is hidden: physics; the other kinds are `ema_model.practice`'s


@dataclass(frozen=True)
class Challenge:
    """Recordings of actuators that are the thesis's but for tolerances, and for what may be hidden."""

    name: str  # of its folder
    title: str
    grade: int  # 1, easy, to 5
    story: str
    training: tuple[Path, ...]  # to fit
    holdout: tuple[Path, ...]  # not to fit; must improve as well
    actuator: Path | None = None  # its file; the thesis's without one
    kind: str = EFFECTS
    thresholds: dict[str, float] = field(default_factory=dict)  # of k, where its life ends
    sealed: Path | None = None  # the file that holds all of these, which then are names in it: see `sealed_file`


def folder() -> Path:
    """Where the challenges that come with the package are."""
    return shipped_folder("challenges")


def challenges(where: Path | None = None, kind: str | None = EFFECTS) -> list[Challenge]:
    """The challenges of a folder (the package's own without one), the easy ones first; InputError tells a mistake.

    kind: the one that is wanted; None for all.
    """
    found = [_read(path) for path in sorted((where or folder()).glob(f"*/{FILE}"))]
    return sorted((one for one in found if kind in (None, one.kind)), key=lambda one: (one.grade, one.name))


def _read(path: Path) -> Challenge:
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        kind = str(told.get("kind", EFFECTS))
        given = [told[which] if kind == EFFECTS else [] for which in ("training", "holdout")]
        training, holdout = (tuple(path.with_name(str(n)) for n in names) for names in given)
        title, grade, story = str(told["title"]), int(told["grade"]), str(told["story"]).strip()
        thresholds = {str(name): float(value) for name, value in told.get("thresholds", {}).items()}
        found = Challenge(path.parent.name, title, grade, story, training, holdout, kind=kind, thresholds=thresholds)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{quoted(path)}: not a challenge: {quoted(error)}; mend it or remove its folder") from None
    except KeyError as error:
        raise InputError(f"{quoted(path)}: {error.args[0]} is missing; add it") from None
    missing = [file.name for file in (*found.training, *found.holdout) if not file.is_file()]
    if missing:
        raise InputError(
            f"{quoted(path)}: there is no {quoted(missing[0])} beside it; run python -m ema_model.challenges"
        )
    return found
