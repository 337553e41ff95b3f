"""The verdict of a discovery, bound to its ladder: nothing is said that the error does not bear out."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.comparison.explain import Explanation
from ema_model.discovery.evidence.remaining import lasts, silence, within_band
from ema_model.discovery.result import Added, misses_unseen
from ema_model.discovery.steps.path import Story


def verdict_of(story: Story, named: Sequence[Added], unknown: Explanation | None, interrupted: bool = False) -> str:
    """One of `VERDICTS`; named: the library's effects in the last model; unknown: what the last model leaves."""
    if interrupted:
        return "interrupted"
    if not story.repeatable:
        return "not_repeatable"
    done = explains_all(story) and story.transmission_seen is None
    if named:
        return "effects_found" if done else "partly_explained"
    if silence(story.data, story.current):
        return "uninformative"
    if not story.base.calibration.converged and not story.added:
        return "not_converged"  # an unfinished fit looks exactly like missing physics
    if done:
        noise = unknown is None and not lasts(story.data, story.current)
        return "adequate" if noise else "unknown_effect"
    return "partly_explained" if story.added else "unknown_effect"


def explains_all(story: Story) -> bool:
    """Whether what is left may be noise and the model's floor: within its band, and not far off what was not fitted."""
    return within_band(story.data, story.current) and not misses_unseen(story.ladder[-1], story.disagreements)
