"""An effect that is claimed only together with a fault.

Beside a fault that nobody knows of, the recordings may ask for another strength of an effect each, or what was not
fitted may agree with none.  Both in the model, they stand or fall together.
"""

from __future__ import annotations

from collections.abc import Callable

from ema_model.discovery.candidates.faults import tried_faults
from ema_model.discovery.candidates.paid_for import pays, worth
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.evidence.objections import against
from ema_model.discovery.evidence.remaining import at_floor
from ema_model.discovery.steps.path import Story
from ema_model.estimation.model_fit import in_floors_of

Progress = Callable[[str], None]


def beside_a_fault(story: Story, trial: Trial, tell: Progress) -> Trial | None:
    """The fault beside an effect that is not claimed alone, both in the model; None where they are not claimed either.

    What two causes are said to share must be explained by them: the model with both is at the floor.
    """
    if worth(story.data, story.current, trial) < LEAST_BIC:
        return None
    for fault in tried_faults(story.data, trial.fit, (), tell):
        data, held = in_floors_of(fault.fit, story.data, story.held)
        if not at_floor(data, fault.fit) or not pays(trial.fit, fault, data, held):
            continue
        if not against(data, story.current, fault.fit, [*trial.effects], lambda found: found):
            return fault
    return None
