"""What a session's file says of a discovery: what it was made from, its steps, and the test that was suggested last."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import msgspec

from ema_model.commands import command
from ema_model.discovery.result import Experiment
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.faults import NAMES
from emaviz.session.described import taken

MOST_STEPS = 100
_FARTHEST = 1e3  # σ that a fitted value may be off


class Recipe(msgspec.Struct, frozen=True):
    """From which the same story can be begun again: a challenge, else recordings of Compare as they were asked then."""

    challenge: str = ""  # its name, or its sealed file's in the data folder
    fitted: tuple[str, ...] = ()  # names in the data folder
    held: tuple[str, ...] = ()
    window_s: tuple[float, float] | None = None
    signals: tuple[str, ...] | None = None
    actuator: str = ""  # its file's text

    def __post_init__(self) -> None:
        if self.window_s is not None and not all(map(math.isfinite, self.window_s)):
            raise InputError("a window has finite edges")

    @property
    def files(self) -> list[str]:
        """Names in the data folder; a challenge that comes with the app has none there, which does no harm."""
        return [name for name in (self.challenge, *self.fitted, *self.held) if name]

    def renamed(self, names: Mapping[str, str]) -> Recipe:
        """With the files' names of now, by those of then."""
        fitted, held = (tuple(names.get(name, name) for name in part) for part in (self.fitted, self.held))
        challenge = names.get(self.challenge, self.challenge)
        return msgspec.structs.replace(self, challenge=challenge, fitted=fitted, held=held)


class SavedStep(msgspec.Struct, frozen=True):
    """A step after the calibration: its model, where its fit ended, the faults in it, and its rivals."""

    model: str  # as an actuator's file
    starts: dict[str, Annotated[float, msgspec.Meta(gt=-_FARTHEST, lt=_FARTHEST)]]  # σ, by path
    faults: tuple[str, ...] = ()
    same_as: tuple[str, ...] = ()  # effects and faults that cannot be told from the new one

    def __post_init__(self) -> None:
        if len(set(self.faults)) != len(self.faults) or not set(self.faults) <= set(NAMES):
            raise InputError("faults are k1 … k8, each once")


class SavedStory(msgspec.Struct, frozen=True):
    """One discovery; with the first of a session, the others."""

    recipe: Recipe
    steps: Annotated[tuple[SavedStep, ...], msgspec.Meta(max_length=MOST_STEPS)]
    experiment: Experiment | None = None
    revealed: bool = False  # the challenge's truth
    says: str = "not opened yet"
    others: tuple[SavedStory, ...] = ()

    def __post_init__(self) -> None:
        if (one := self.experiment) is not None:
            command(one.command, one.settings)
            for name in one.separates:
                if name not in NAMES:
                    find(name)
            if not all(map(math.isfinite, (one.duration_s, one.load_torque_Nm, one.expected_chi2))):
                raise InputError("a suggested test has finite numbers")

    def saved(self) -> dict[str, Any]:
        """In what JSON can hold."""
        return msgspec.to_builtins(self)


def story_of(saved: Any) -> SavedStory:
    """What `SavedStory.saved` gave; InputError if it makes no sense."""
    return taken(SavedStory, saved, "part of Discover")
