"""A second opinion: what the measured motion needs of the motor, where the closed loop is left unexplained.

A closed loop fails where its plant or its controller is not the real one.  Inverse dynamics has no controller, and the
controller's own law (`controller_seen`) no plant: asked apart, they tell which of the two is to blame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ema_model.actuator import Actuator, Tolerance
from ema_model.actuator.parameters import INVERSE_PLACES
from ema_model.comparison.loop_lag import LoopLag
from ema_model.comparison.thresholds import BAND, MISSED
from ema_model.discovery.history import Story, calibrated_story
from ema_model.discovery.loop import ControllerSeen, by_inverse_dynamics, controller_seen
from ema_model.discovery.remaining import at_floor, ratio
from ema_model.discovery.result import Added, Candidate, Change
from ema_model.discovery.thresholds import APART, GONE, HALF, HEARD, LOOP_TOLD, MUCH_BETTER, NAMED
from ema_model.discovery.uncertainty import with_intervals
from ema_model.discovery.words import LOOP_UNTOLD
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError
from ema_model.estimation import Calibrated

CLOSED_LOOP, INVERSE_DYNAMICS = "closed_loop", "inverse_dynamics"
_DELAY = "sensors.delay_s"
_DELAY_SIGMA_S = 1e-3  # between two channels of a usual logger
_LOOP = "sensors.apparent_inertia"
_LOOP_ADDS = 0.05  # and as much is 1 σ: a current loop is ten times as fast as its motor, or more


@dataclass(frozen=True, eq=False)
class Opinion:
    """Inverse dynamics beside the same recordings, and the controller that they show."""

    story: Story
    seen: ControllerSeen | None

    @property
    def blames_controller(self) -> bool:
        """Whether the drive's current is not what the file's controller makes of the measured motion."""
        return self.seen is not None and self.seen.differs

    def again(self, closed: Story) -> Opinion:
        """With the controller that both models, as they stand now, show."""
        return Opinion(self.story, _seen(closed, self.story))

    def explains_better(self, closed: Story) -> bool:
        """Whether it explains what flowed: to its floor, or far better than the closed loop does.

        A gain that is another than the file's is seen without any plant: better is then enough.
        """
        first, last = ratio(closed.data, closed.base), ratio(closed.data, closed.current)
        of_drive = any(find(one.name).family == "drive" for one in closed.added if one.name in CATALOGUE)
        if last <= BAND or (of_drive and last <= LOOP_TOLD * first):  # what was added to the drive's loop explains it
            return False
        left = ratio(self.story.data, self.story.current)
        sure = self.seen is not None and self.seen.holds and any(gain.differs for gain in self.seen.gains)
        return left <= BAND or left <= (1.0 if sure else MUCH_BETTER) * last

    def settles(self, closed: Story, may_be_faulty: bool) -> bool:
        """Whether the loop need not be searched on: this explains what flowed to its floor, or so much better.

        So much that the loop may halve its error, and would be given up still.  A drive's own effect beside another
        one is left to the loop, which alone can tell the two; and where the actuator may have a fault, that is the
        loop's to tell, as play and the proportional gain are nothing that the motor needs a current for.
        """
        if not self.explains_better(closed):
            return False
        left = ratio(self.story.data, self.story.current)
        far_less = left <= HALF * MUCH_BETTER * ratio(closed.data, closed.current)
        return (far_less and not may_be_faulty) or at_floor(self.story.data, self.story.current)


def second_opinion(story: Story, tell: Callable[[str], None], before: Opinion | None = None) -> Opinion | None:
    """Inverse dynamics, calibrated; None where the closed loop leaves no more than its band, or it cannot be asked.

    before: what was said of an earlier step; the motion needs the same of the motor, and only the controller is seen
    anew.
    """
    if not story.repeatable or not story.current.plant.simulates_commands or at_floor(story.data, story.current):
        return None
    if before is not None:
        return before.again(story)
    without = by_inverse_dynamics(story.data.measurements, story.base.actuator)
    if without is None:
        return None
    tell("asking inverse dynamics for a second opinion")
    held = () if story.held is None else story.held.measurements
    try:
        other = calibrated_story(story.data.measurements, as_logged(without), held, None, tell)
    except InputError:  # too little motion, or a held-out recording without a current
        return None
    return Opinion(other, _seen(story, other))


def _seen(story: Story, other: Story) -> ControllerSeen | None:
    late = other.current.calibration.actuator.sensors.delay_s
    return controller_seen(story.current.plant, story.current.calibration.actuator, late)


def taken_over(story: Story, opinion: Opinion) -> None:
    """Goes on with inverse dynamics: what its effects are, the closed loop has no say in but to agree."""
    opinion = opinion.again(story)
    story.loop_lag = other_loop(story)
    both = [
        mine.name for mine in story.added for its in opinion.story.added if mine.name == its.name and _agree(mine, its)
    ]
    alone = {one.name for one in story.added if one.name in CATALOGUE} - {one.name for one in opinion.story.added}
    story.support = {one.name: (INVERSE_DYNAMICS,) for one in opinion.story.added}
    story.support |= {name: (CLOSED_LOOP, INVERSE_DYNAMICS) for name in both}
    reason = "only the closed loop asks for it, and not what the measured motion needs of the motor"
    story.refused |= dict.fromkeys(alone, reason)
    story.take_over(opinion.story)
    first = story.steps[0]
    story.steps[0] = replace(first, rung=replace(first.rung, change=Change("without_controller")))
    if opinion.blames_controller:
        story.controller_seen = opinion.seen
    elif story.loop_lag is None:
        story.warnings.append(LOOP_UNTOLD)


def other_loop(story: Story) -> LoopLag | None:
    """How late the loop was seen to follow its command, where what was added since has not explained it."""
    return story.loop_lag if ratio(story.data, story.current) >= MISSED else None


def compared(story: Story, opinion: Opinion, tell: Callable[[str], None]) -> None:
    """Asks inverse dynamics for each effect of the closed loop; one that it plainly contradicts is taken out."""
    heard = ratio(opinion.story.data, opinion.story.base) <= HEARD
    for one in [one for one in story.added if one.name in CATALOGUE]:
        story.support[one.name] = (CLOSED_LOOP,)
        if not _acts(one.name):
            continue
        tell(f"asking inverse dynamics for {one.name}")
        settings = dict(story.current.calibration.actuator.effects[one.key])
        other = opinion.story
        trial = other.trial(Candidate(one.name, 0.0, settings), tell)
        first = find(one.name).parameters[0].name
        path, its = f"effects.{one.key}.{first}", f"effects.{one.name}.{first}"
        mine, there = with_intervals(story.data, story.current), with_intervals(other.data, trial.fit)
        if path not in mine.parameters or its not in there.parameters:
            continue
        here, seen = mine.parameters[path], there.parameters[its]
        if abs(seen.value - here.value) <= max(APART * abs(here.value), _half(here) + _half(seen)):
            if other.gain(trial.fit) > NAMED:
                story.support[one.name] = (CLOSED_LOOP, INVERSE_DYNAMICS)
        elif heard and abs(seen.value) + _half(seen) < GONE * abs(here.value):
            story.refused[one.name] = "the motion and the current alone, without the controller, show none of it"
            story.remove(one.key)


def support_of(story: Story, name: str) -> tuple[str, ...]:
    """The models that bear out an effect of a story."""
    own = CLOSED_LOOP if story.current.plant.simulates_commands else INVERSE_DYNAMICS
    return story.support.get(name, (own,))


def as_logged(actuator: Actuator) -> Actuator:
    """An actuator without its controller, free in what a log does to the current beside the motion as well.

    That is a delay; and of a drive that the model takes for an ideal current source, the log may hold the command: how
    much inertia its current loop adds to that.
    """
    tolerances = {**actuator.tolerances, _DELAY: Tolerance(_DELAY_SIGMA_S, True)}
    sensors = replace(actuator.sensors, delay_s=0.0)
    if actuator.inverter.kind == "current":
        tolerances[_LOOP] = Tolerance(_LOOP_ADDS, True)
        sensors = replace(sensors, apparent_inertia=_LOOP_ADDS)
    return replace(actuator, tolerances=tolerances, sensors=sensors)


def _acts(name: str) -> bool:
    """Whether all that an effect does is there in inverse dynamics, and free to be asked for."""
    effect = find(name)
    return not effect.states and not effect.duplicates and all(p.__name__ in INVERSE_PLACES for p in effect.places)


def _agree(one: Added, other: Added) -> bool:
    first = find(one.name).parameters[0].name
    mine, its = one.parameters.get(first), other.parameters.get(first)
    if mine is None or its is None:
        return False
    return abs(mine.value - its.value) <= max(APART * abs(its.value), _half(mine) + _half(its))


def _half(one: Calibrated) -> float:
    low, high = one.interval90
    return 0.5 * (high - low)
