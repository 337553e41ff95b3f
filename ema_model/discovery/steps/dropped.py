"""Effects that are taken out of a model again: what later ones have made idle, and what they have bent."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ema_model.discovery.candidates.refit import fitted_count
from ema_model.discovery.criteria import HALF, LEAST_BIC
from ema_model.discovery.evidence.counted import evidence
from ema_model.discovery.evidence.objections import against, ratio, still_against
from ema_model.discovery.steps.path import Story
from ema_model.estimation.model_fit import Fit

Progress = Callable[[str], None]


def drop_idle(story: Story, tell: Progress) -> None:
    """Takes out effects that later ones have made idle."""
    for one in story.added[:-1]:
        tell(f"trying without {one.name}")
        smaller = story.without(one.key, tell)
        needed = fitted_count(one.key, smaller.actuator.axes) * np.log(len(smaller.residual)) + LEAST_BIC
        if evidence(story.data, smaller, story.current) < needed:
            story.remove(one.key, smaller)


def drop_doubtful(story: Story, tell: Progress) -> None:
    """Takes out effects that the last model bends away from what they were claimed as, and what rested on them."""
    while len({one.name for one in story.added}) > 1:
        doubts = {one.key: still_against(story.data, story.base, story.current, one.key) for one in story.added}
        key = next((key for key in reversed(doubts) if doubts[key]), None)
        if key is None:
            return
        later = story.added[[*doubts].index(key) + 1 :]
        _take_out(story, key, doubts[key], tell)
        for one in reversed(later):  # each was claimed beside what is gone
            smaller = story.without(one.key, tell)
            reason = against(story.data, smaller, story.current, [one.key], lambda found: story.settled(found, tell))
            if reason and not _needed(story, smaller, tell):
                _take_out(story, one.key, reason, tell, smaller)


def _needed(story: Story, smaller: Fit, tell: Progress) -> bool:
    """Whether the error doubles without an effect, the actuator's parameters keeping to their tolerances."""
    with_it, without = (ratio(story.data, story.settled(one, tell)) for one in (story.current, smaller))
    return with_it < HALF * without


def _take_out(story: Story, key: str, reason: str, tell: Progress, found: Fit | None = None) -> None:
    name = next(one.name for one in story.added if one.key == key)
    tell(f"taking out {name}")
    story.refused[name] = reason
    story.remove(key, found)
