"""Effects weighed again in the last model, against what told nearly as much when they were added.

Where two causes share the error, the first is chosen beside all that the second leaves, which falls a little with the
one or the other of two that are alike, a fault and an effect among them.  Once both causes are in the model, the data
tell them apart.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ema_model.discovery.candidates.faults import fault_trial
from ema_model.discovery.candidates.paid_for import price
from ema_model.discovery.candidates.refit import Trial, settings_in, tried
from ema_model.discovery.criteria import NEAR_AS_MUCH, TIE
from ema_model.discovery.evidence.counted import evidence
from ema_model.discovery.evidence.objections import against
from ema_model.discovery.steps.path import Story
from ema_model.effects import catalogue_name
from ema_model.estimation.model_fit import Fit

Progress = Callable[[str], None]

_MOST = 2  # rivals of an effect, of either kind


def near(best: Trial, trials: Sequence[Trial]) -> list[Trial]:
    """Those of one step that told nearly as much as the one that was added, the best first."""
    others = sorted((one for one in trials if one.candidate.name != best.candidate.name), key=lambda one: -one.drop)
    close = [one for one in others if one.drop > NEAR_AS_MUCH * best.drop]
    effects, faults = ([one for one in close if bool(one.faults) is fault] for fault in (False, True))
    return effects[:_MOST] + faults[:_MOST]


def weigh_again(story: Story, rivals: Mapping[str, Sequence[Trial]], tell: Progress) -> None:
    """Puts a rival in the place of an effect that it outdoes now; names it beside one that it equals, and no other.

    rivals: by the effect's key, as of `near`.  The last effect was weighed against its own in this very model.
    """
    rivals = {key: [one for one in its if not one.faults] for key, its in rivals.items()}
    for one in story.added[:-1]:
        orders = [other for other in story.added if catalogue_name(other.key) == catalogue_name(one.key)]
        present = story.current.actuator.effects
        new = [rival for rival in rivals.get(one.key, ()) if rival.candidate.name not in present]
        if not new or len(orders) > 1:
            continue
        smaller = story.without(one.key, tell)
        for rival in new:
            name = rival.candidate.name
            tell(f"weighing {name} against {one.name} again")
            trial = tried(story.data, smaller, rival.candidate, settings_in(rival.fit, rival.effects), tell)
            own = price(story.data, smaller, replace(trial, effects={one.name: {}}))
            more = price(story.data, smaller, trial) - own
            if evidence(story.data, story.current, trial.fit) - more > TIE:
                if not against(story.data, smaller, trial.fit, [name], lambda fit: story.settled(fit, tell)):
                    story.swap(one.key, trial)
                    break
            else:
                equal = evidence(story.data, trial.fit, story.current) + more < TIE
                story.tie(one.key, name, equal)


def fault_instead(story: Story, rivals: Mapping[str, Sequence[Trial]], tell: Progress) -> Trial | None:
    """The fault that tells more than an effect of the last model in its place; None where there is none.

    In its place and in the last effect's, too, which may only have mended what the first one got wrong.
    rivals: as of `weigh_again`.
    """
    for one in story.added[:-1]:
        for rival in rivals.get(one.key, ()):
            if not rival.faults or rival.faults[0] in story.current.faults:
                continue
            tell(f"weighing the fault {rival.candidate.name} against {one.name} again")
            smaller = story.without(one.key, tell)
            last = story.added[-1].key
            if _outdoes(story, smaller, rival, [one.key], tell):
                return rival
            if _outdoes(story, story.without(last, tell, smaller), rival, [one.key, last], tell):
                return rival
    return None


def _outdoes(story: Story, smaller: Fit, rival: Trial, keys: Sequence[str], tell: Progress) -> bool:
    """Whether a fault tells more than effects of the last model do beside the rest of it."""
    trial = fault_trial(story.data, smaller, rival.candidate, tell)
    own = replace(trial, effects={key: {} for key in keys}, faults=())
    more = price(story.data, smaller, trial) - price(story.data, smaller, own)
    return evidence(story.data, story.current, trial.fit) - more > TIE
