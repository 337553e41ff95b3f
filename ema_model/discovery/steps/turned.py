"""Held-out recordings whose encoder is turned, mirrored or shifted against the fitted ones'.

What depends on an angle stands elsewhere in them, so that they seem to deny what the fitted recordings pay for.  They
are put right by the effect itself: the turn at which its wave, as it was fitted, takes from their error what it must.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ema_model.discovery.candidates.harmonics import further_orders
from ema_model.discovery.candidates.paid_for import pays
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.criteria import MISSED, SHARED
from ema_model.discovery.evidence.objections import ratio
from ema_model.discovery.result import Contradiction
from ema_model.discovery.steps.contradiction import alone_of
from ema_model.discovery.steps.path import Story
from ema_model.effects import catalogue_name, find
from ema_model.errors import InputError
from ema_model.estimation.model_fit import Data, Fit, holdout_change, holdout_error, resimulated
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import Measurement

Progress = Callable[[str], None]

_BY_ANGLE = frozenset({"motor_angle", "user_position"})
_A_PERIOD = 12  # turns that are tried within a period
_MOST_TRIED = 720  # of one recording; a map is simulated in milliseconds
_MIRRORED = 1.5  # times, by which the error must be less with an angle that is mirrored as well
_FINER = (0.5, 0.25, 0.125, 0.0625)  # of the first step, to which the best one is then sought


class _Turn(NamedTuple):
    by_rad: float  # that the motor's angle is greater by
    is_mirrored: bool


def put_right(story: Story, trials: Sequence[Trial], tell: Progress) -> bool:
    """Turns the held-out recordings that deny an effect only where it stands; whether any was turned.

    The story goes on with them as they are read then, and says so among its disagreements.
    """
    if story.held is None or story.current.plant.simulates_commands:
        return False
    for trial in trials:
        if not _by_angle(trial) or not pays(story.current, trial, story.data, None):
            continue
        whole = _with_further_orders(story, trial, tell)
        is_paid = pays(story.current, trial, story.data, story.held)
        if is_paid and holdout_error(story.held, whole.fit) < MISSED * max(1.0, ratio(story.data, whole.fit)):
            return False
        turned, held = [], list(story.held.measurements)
        for place, measurement in enumerate(held):
            tell(f"asking whether the encoder of {measurement.name} is turned")
            found = _found(story, whole, place)
            if found is not None:
                held[place], contradiction = found
                turned.append(contradiction)
        if not turned:
            continue
        before = story.held
        story.hold_out(replace(before, measurements=held))
        if pays(story.current, trial, story.data, story.held):
            names = {one.recording for one in turned}
            story.turned = [*(one for one in story.turned if one.recording not in names), *turned]
            return True
        story.hold_out(before)
    return False


def _with_further_orders(story: Story, trial: Trial, tell: Progress) -> Trial:
    """The trial with all orders of its law that the fitted recordings pay for: one alone repeats within a turn."""
    if not find(trial.candidate.name).is_periodic:
        return trial
    further = further_orders(story.data, None, trial, tell)
    return trial if further is None or further.trial is None else further.trial


def _by_angle(trial: Trial) -> bool:
    return bool(trial.effects) and all(map(_goes_by_angle, trial.effects))


def _goes_by_angle(key: str) -> bool:
    return find(catalogue_name(key)).against in _BY_ANGLE


def _found(story: Story, trial: Trial, place: int) -> tuple[Measurement, Contradiction] | None:
    """A held-out recording as its encoder must be read for the trial, and what is said of it; None where none does."""
    assert story.held is not None
    alone, bare = alone_of(story.held, trial.fit, place), alone_of(story.held, story.current, place)
    if alone is None or bare is None:
        return None
    (measurement,) = alone.measurements
    without = resimulated(bare, story.current.calibration.actuator)[0]
    as_it_is = _error(alone, trial.fit, measurement)
    after, best = _best(alone, trial, measurement, story)
    # What is true takes as much from the square of the error as it changes.
    change = holdout_change(bare, story.current, trial.fit)
    if after >= as_it_is or without**2 - after**2 < SHARED * change**2:
        return None
    name = measurement.name or "the held-out recording"
    said = (
        f"{name} contradicts the fitted recordings: with {in_sentence(find(trial.candidate.name).title)} it is off by "
    )
    said += (
        f"{number(as_it_is, 2)} times the floor, and by {number(after, 2)} with its encoder {_in_words(trial, best)}."
    )
    how = "sign" if best.is_mirrored else "zero"
    right = _turned(measurement, best, story)
    return right, Contradiction(name, "motor_position_rad", how, said, as_it_is, after)


def _in_words(trial: Trial, turn: _Turn) -> str:
    """'turned by 90°, or by 30° more or less, as often as one likes'."""
    by = math.remainder(turn.by_rad, 2.0 * math.pi)
    degrees = f"{number(math.degrees(abs(by)), 3)}°"
    parts = ["mirrored"] if turn.is_mirrored else []
    if not turn.is_mirrored or abs(by) > 1e-6:
        parts.append(f"turned by {degrees} {'forward' if by >= 0.0 else 'backward'}")
    orders = {trial.fit.actuator.effects[key].get("order", 1.0) for key in trial.fit.effects if _goes_by_angle(key)}
    again = ""
    if len(orders) == 1 and (order := orders.pop()) > 1.0:
        again = f" (or by any number of {number(360.0 / order, 3)}° more, after which it repeats)"
    return " and ".join(parts) + again


def _best(alone: Data, trial: Trial, measurement: Measurement, story: Story) -> tuple[float, _Turn]:
    """The least error of the trial over all turns, in floors, and the turn."""
    step, turns = _turns(trial, story)
    errors = [(_error(alone, trial.fit, _turned(measurement, turn, story)), turn) for turn in turns]
    # One wave alone, mirrored, is the same as turned.
    least, best = min(errors, key=lambda one: one[0] * (_MIRRORED if one[1].is_mirrored else 1.0))
    for share in _FINER:
        for sign in (-1.0, 1.0):
            turn = best._replace(by_rad=best.by_rad + sign * share * step)
            error = _error(alone, trial.fit, _turned(measurement, turn, story))
            if error < least:
                least, best = error, turn
    return least, best


def _turns(trial: Trial, story: Story) -> tuple[float, Iterator[_Turn]]:
    """The step between the turns that are tried, rad, and all of them.

    Within one period where nothing else in the model tells the angle, else over a whole turn.
    """
    others = [key for key in trial.fit.effects if _goes_by_angle(key)]
    orders = [trial.fit.actuator.effects[key].get("order", 1.0) for key in others]
    highest = max([1.0, *orders])
    span = 2.0 * math.pi / (highest if len(set(orders)) == 1 else 1.0)
    count = min(_MOST_TRIED // 2, _A_PERIOD * math.ceil(span * highest / (2.0 * math.pi) - 1e-9))
    step = span / count
    mirrors = (False, True)
    return step, (_Turn(step * n, mirrored) for mirrored in mirrors for n in range(count))


def _turned(measurement: Measurement, turn: _Turn, story: Story) -> Measurement:
    """The recording with the encoder's angle so much greater, or mirrored before; the user's goes along."""
    sign = -1.0 if turn.is_mirrored else 1.0
    gear = story.current.actuator.transmission.gear_ratio
    by = {"motor_position_rad": turn.by_rad, "user_position_rad": gear * turn.by_rad, "motor_speed_rad_s": 0.0}
    changed = {name: sign * measurement[name] + more for name, more in by.items() if name in measurement}
    return measurement.with_signals(**changed)


def _error(alone: Data, found: Fit, measurement: Measurement) -> float:
    """Of one recording, in floors."""
    try:
        error = resimulated(replace(alone, measurements=[measurement]), found.calibration.actuator)[0]
    except (InputError, FloatingPointError):
        return math.inf
    return error if np.isfinite(error) else math.inf
