"""A user's own torque before it is in the model: the text as it is typed, and what its values would change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ema_model.discovery import Candidate, Story
from ema_model.discovery.candidates.preview import Preview as Room
from ema_model.discovery.candidates.preview import preview as room_for
from ema_model.discovery.steps.snapshot import Look
from ema_model.discovery.steps.step import Step
from ema_model.effects.user import Expression, UserEffect, parse
from ema_model.errors import InputError


@dataclass(frozen=True)
class Typed:
    """A text as it stands: the expression, if it is one, and what is to be said of it."""

    expression: Expression | None
    line: str


@dataclass(frozen=True, eq=False)
class Preview:
    """What a torque with these values would change, as a candidate of a picture of the story."""

    look: Look
    candidate: Candidate
    rmse: float  # with it, in floors


def typed(text: str) -> Typed:
    """Reads what stands in the field; never raises, and never runs any of it."""
    if not text.strip():
        return Typed(None, "")
    try:
        found = parse(text)
    except InputError as error:
        return Typed(None, f"✗ {error}")
    used = ", ".join(found.variables) or "no variable"
    free = ", ".join(found.parameters) or "none"
    return Typed(found, f"✓ uses {used}; parameters to fit: {free}")


class OwnPreview:
    """Holds a torque against what a story's last model leaves; the first time, a torque is compiled."""

    def __init__(self) -> None:
        self._room: tuple[Step, Room] | None = None

    def of(self, story: Story, look: Look, effect: UserEffect, settings: Mapping[str, float]) -> Preview:
        """What a torque with these settings would change; `look` is a picture of that story as it stands.

        Raises InputError where the torque has no value somewhere in these recordings, or settings out of range.
        """
        if look.assessment is None:
            raise InputError("one moment: the residual is still being analysed")
        full, step = effect.settings(dict(settings)), story.steps[-1]
        if self._room is None or self._room[0] is not step or self._room[1].name != effect.name:
            self._room = (step, room_for(story.data, story.current, effect.name, full))
        change = self._room[1].change(full)
        if not np.all(np.isfinite(change)):
            raise InputError("with these values the torque has no value somewhere, as in a division by zero")
        signatures = {**look.assessment.signatures, effect.name: change}
        shown = replace(look, assessment=replace(look.assessment, signatures=signatures))
        candidate = Candidate(effect.name, 0.0, full)
        return Preview(shown, candidate, shown.error_with(candidate))
