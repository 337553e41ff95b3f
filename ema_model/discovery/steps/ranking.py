"""Effects of the library and faults of the actuator in one ranking: what may be missing from a model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.candidates.faults import scored_faults
from ema_model.discovery.result import Candidate
from ema_model.discovery.steps.path import Story
from ema_model.faults import BY_NAME

Array = NDArray[np.float64]


def with_faults(story: Story, effects: Sequence[Candidate]) -> list[Candidate]:
    """Ranked effects and the faults that the last model lacks, the most promising first."""
    faults = [one.candidate for one in scored_faults(story.data, story.current)]
    return sorted([*effects, *faults], key=lambda one: -one.predicted_drop)


def signatures(story: Story, ranked: Sequence[Candidate]) -> dict[str, Array]:
    """`Story.signatures` of effects and faults: (values,) each."""
    faults = {one.candidate.name: one.signature for one in scored_faults(story.data, story.current)}
    effects = story.signatures([one for one in ranked if one.name not in BY_NAME])
    return effects | {one.name: faults[one.name] for one in ranked if one.name in faults}
