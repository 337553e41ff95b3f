"""Which of the refitted candidates is claimed: the best that nothing speaks against, at one order or at several."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ema_model.discovery.candidates.harmonics import Further, further_orders
from ema_model.discovery.candidates.paid_for import price
from ema_model.discovery.candidates.refit import Trial, stands_for
from ema_model.discovery.criteria import ALIKE, FAR, HALF, LARGEST_GROUP, ONE_MOTION, SECOND, TIE
from ema_model.discovery.evidence.counted import evidence
from ema_model.discovery.evidence.objections import against, ratio
from ema_model.discovery.steps.path import Story
from ema_model.effects import find
from ema_model.estimation.model_fit import holdout_error
from ema_model.quantities.titles import in_sentence

Progress = Callable[[str], None]


class Claim(NamedTuple):
    """A trial that is claimed, those that cannot be told from it, and the same with further orders of its effect."""

    best: Trial
    others: list[Trial]
    more: Trial | None


def claimed(story: Story, accepted: Sequence[Trial], tell: Progress) -> Claim | None:
    """The best trial that nothing speaks against, those that cannot be told from it, and further orders of it.

    None where none is to be claimed.  A trial that tells far less than one that is refused only bends as that one does;
    so does one by orders, where another law of the same orders tells more, and one of which a refused term tells all.
    """
    left = [trial for trial in accepted if trial.drop > SECOND * accepted[0].drop]
    by_orders: list[Trial] = []  # refused, each with the further orders of its law
    while left:
        best, others = _chosen(story, left)
        others += [
            trial for trial in left if trial is not best and trial not in others and _one_motion(story, best, trial)
        ]
        others = without_series(others)
        further = _further(story, best, tell)
        more, reason = None if further is None else further.trial, ""
        apart = of_other_parts(best, others)
        law = None if further is None else _better_law(story, more or best, by_orders)
        if len(apart) >= LARGEST_GROUP:
            reason = f"{len(apart)} others tell as much"
        elif further is not None and not further.stands_out:
            reason = f"its order {best.candidate.settings['order']:g} tells no more than its neighbours"
        elif law is not None:
            reason = f"{in_sentence(find(law.candidate.name).title)}, which is not claimed, tells more by such orders"
        # In a second opinion there is no twin, whose floor would tell a faint further order from what is left.
        steady = story.current.actuator.leaves_out_reversals
        alone_first = steady and not (more is not None and _halves(story, best, more))
        for whole in () if reason else (best, more) if alone_first else (more, best):
            if whole is None:
                continue
            keys = [*best.effects, *(whole.effects if whole is more else ())]
            spoken = against(story.data, story.current, whole.fit, keys, lambda found: story.settled(found, tell))
            if not spoken:
                return Claim(best, others, more if whole is more else None)
            reason = spoken if whole is best else reason
        story.refused[best.candidate.name] = reason
        by_orders += [] if further is None else [more or best]
        left = [trial for trial in left if trial is not best and not _is_no_more(story, trial, best)]
    return None


def _chosen(story: Story, accepted: Sequence[Trial]) -> tuple[Trial, list[Trial]]:
    """The best of the trials, and those that cannot be told from it.

    Of what cannot be told apart, a parameter outside its tolerance comes after an effect, and what takes parameters
    farther from the file, or has more of its own, after what does not.  Far above the floor what was not fitted tells
    them apart.  Of an effect and a term of its series that tells as much, it is the term.
    """
    first = accepted[0]
    is_far = ratio(story.data, first.fit) > FAR
    tied = [
        trial
        for trial in accepted
        if _short_of(story, trial, first) < TIE or (is_far and trial.drop > ALIKE * first.drop)
    ]
    simple = simplest(story, tied)
    effects = [trial for trial in simple if not stands_for(story.current, trial)] or simple[:1]
    if not is_far or story.held is None:
        best = min(effects, key=lambda trial: _short_of(story, trial, first) + price(story.data, story.current, trial))
        return best, [trial for trial in tied if trial is not best]
    unseen = {trial.candidate.name: holdout_error(story.held, trial.fit) for trial in tied}
    best = min(effects, key=lambda trial: unseen[trial.candidate.name])
    near = unseen[best.candidate.name] / ALIKE
    return best, [trial for trial in tied if trial is not best and unseen[trial.candidate.name] <= near]


def simplest(story: Story, trials: Sequence[Trial]) -> list[Trial]:
    """Those of which no term of the series tells as much: where one does, the motion shows no more than that."""
    return [trial for trial in trials if not any(_is_no_more(story, trial, other) for other in trials)]


def _is_no_more(story: Story, trial: Trial, other: Trial) -> bool:
    """Whether another trial is a term of this one's series, and tells as much."""
    return other.candidate.name in find(trial.candidate.name).terms and _short_of(story, other, trial) < TIE


def _short_of(story: Story, trial: Trial, first: Trial) -> float:
    """Evidence by which a trial tells less than another."""
    return 0.0 if trial is first else evidence(story.data, trial.fit, first.fit)


def _halves(story: Story, best: Trial, more: Trial) -> bool:
    """Whether further orders take half of what one alone leaves far above the floor, also where nothing was fitted."""
    alone = ratio(story.data, best.fit)
    if story.held is None or alone <= FAR or ratio(story.data, more.fit) > HALF * alone:
        return False
    return holdout_error(story.held, more.fit) < HALF * holdout_error(story.held, best.fit)


def _one_motion(story: Story, best: Trial, other: Trial) -> bool:
    """Whether two laws of friction, one by place and one by speed, are one in the motion that was recorded.

    An axis that goes back and forth is always as fast at the same place: what the laws change is then nearly the same,
    and what else the model lacks decides which of them tells more; what was held out may prefer the other.
    """
    laws = [find(trial.candidate.name) for trial in (best, other)]
    if {law.against for law in laws} != {"user_position", "motor_speed"} or any(law.is_load for law in laws):
        return False
    if any(place.__name__ != "moving_friction" for law in laws for place in law.places):
        return False
    one, two = (trial.fit.residual - story.current.residual for trial in (best, other))
    return float(one @ two) > ONE_MOTION * float(np.linalg.norm(one) * np.linalg.norm(two))


def without_series(others: Sequence[Trial]) -> list[Trial]:
    """Those of which no term of the series is among them: what a constant does, an arm's weight does at some angle."""
    names = {trial.candidate.name for trial in others}
    return [trial for trial in others if names.isdisjoint(find(trial.candidate.name).terms)]


def of_other_parts(best: Trial, others: Sequence[Trial]) -> list[Trial]:
    """Those that are of another part than the best: a drive's delays are alike, and any of them names the drive.

    What has the best as a term of its series is the same, seen over a short travel.
    """
    name, is_drive = best.candidate.name, find(best.candidate.name).family == "drive"
    apart = [trial for trial in others if name not in find(trial.candidate.name).terms]
    return [trial for trial in apart if find(trial.candidate.name).family != "drive"] if is_drive else apart


def _better_law(story: Story, trial: Trial, refused: Sequence[Trial]) -> Trial | None:
    """The refused trial whose law, at orders too, tells more than this one's does.

    A ripple goes with the current, a friction with the direction: what one of them is, the others' orders imitate.
    """
    for other in refused:
        more = price(story.data, story.current, other) - price(story.data, story.current, trial)
        if evidence(story.data, trial.fit, other.fit) - more > TIE:
            return other
    return None


def _further(story: Story, best: Trial, tell: Progress) -> Further | None:
    """Further orders of a periodic effect, beside it."""
    if not find(best.candidate.name).is_periodic:
        return None
    return further_orders(story.data, story.held, best, tell)
