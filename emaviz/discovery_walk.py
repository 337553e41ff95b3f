"""The walk of `ema_model.discovery.discover`, on a story that a person has begun: adds what pays, step by step."""

from __future__ import annotations

from collections.abc import Callable

from ema_model.discovery import Story
from ema_model.discovery.harmonics import is_periodic, with_further_orders
from ema_model.discovery.trial import Trial, pays
from ema_model.discovery.unknown import curve_instead, is_a_shape
from ema_model.effects import CATALOGUE, find

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates
_TIE = 10.0  # of χ², within which rivals cannot be told apart
_MOST_EFFECTS = 3


def walk(story: Story, tell: Callable[[str], None]) -> None:
    """Adds effects until none pays, then the residual's own curve if nothing has a name; tell may raise to stop."""
    while len({one.name for one in story.added}) < _MOST_EFFECTS:
        tell("scoring the candidates")
        left = story.left()
        trials = story.tried(story.ranked(None, left), _REFITTED_SHARE, _MOST_REFITTED, tell)
        accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        if not accepted:
            break
        best, others = _chosen(accepted)
        if curve_instead(story.data, story.held, story.current, best, left.explanation, tell):
            break
        more = (
            with_further_orders(story.data, story.held, best.fit, best.candidate.name, tell)
            if is_periodic(best.candidate.name)
            else None
        )
        orders = [settings["order"] for settings in more.effects.values()] if more else []
        if is_a_shape([best.candidate.settings.get("order", 0.0), *orders]):
            break
        story.add(best, ties=[trial.candidate.name for trial in others])
        tell(f"{best.candidate.name.replace('_', ' ')} is added")
        if more:
            story.add(more, f"+ {best.candidate.name} of orders {', '.join(f'{order:g}' for order in orders)}")
            tell("further orders are added")
    if any(one.name in CATALOGUE and not find(one.name).duplicates for one in story.added):
        return
    _add_curve(story, tell)


def _add_curve(story: Story, tell: Callable[[str], None]) -> None:
    """The curve of what is unknown; parameters that only bent toward it go back, if it can be drawn without them."""
    bent = story.steps[1:]
    try:
        story.restart()
        whole = story.curve(story.left().explanation, tell)
    finally:  # also when it was stopped
        story.steps += bent
    if whole:
        story.restart()
        story.add(whole)
    elif bent and (curve := story.curve(story.left().explanation, tell)):
        story.add(curve)


def _chosen(accepted: list[Trial]) -> tuple[Trial, list[Trial]]:
    """The best, and those that cannot be told from it; a parameter outside its tolerance comes after an effect."""
    tied = [trial for trial in accepted if accepted[0].drop - trial.drop < _TIE]
    best = next((trial for trial in tied if not find(trial.candidate.name).duplicates), tied[0])
    return best, [trial for trial in tied if trial is not best]
