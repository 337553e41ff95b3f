"""Held-out recordings that contradict the fitted ones, and how: a sign, a zero, a unit, another actuator.

A model that meets what it was fitted to and misses by far what it was not has met a recording of something else.  Each
cheap explanation is tried by putting the recording right and simulating it anew; what brings the error down is told.

Where a held-out recording's encoder is turned, mirrored or shifted, what depends on an angle stands elsewhere in it, so
that it seems to deny what the fitted recordings show.  It is put right by that itself: the turn at which the model, as
it was fitted, takes from its error what it must.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.parameters import on_axes
from ema_model.discovery.criteria import ANOTHER, MISSED, PUT_RIGHT, SHARED, WIDER
from ema_model.discovery.history import Story
from ema_model.discovery.remaining import ratio
from ema_model.discovery.result import Contradiction
from ema_model.effects import catalogue_name, find
from ema_model.errors import InputError
from ema_model.estimation import calibrate
from ema_model.estimation.model_fit import Data, Fit, fit, floor_ratio, gather, holdout_change, resimulated
from ema_model.quantities import Axes, amount, in_sentence, number, of_signal
from ema_model.recordings import Measurement

Array = NDArray[np.float64]

_COMPARED = ("user_position_rad", "motor_position_rad", "current_A", "motor_torque_Nm")
_POSITIONS = ("user_position_rad", "motor_position_rad")
_DEGREES = ("degrees", 180.0 / math.pi)
_THOUSAND = 1e3
_CLOSE = 6.0  # times, within which a ratio of sizes may be that of two units: motions differ, too
_BY_ANGLE = frozenset({"motor_angle", "user_position"})
_A_PERIOD = 12  # turns that are tried within a period
_MOST_TRIED = 720  # of one recording; a map is simulated in milliseconds
_MIRRORED = 1.5  # times, by which the error must be less with an angle that is mirrored as well
_FINER = (0.5, 0.25, 0.125, 0.0625)  # of the first step, to which the best one is then sought


@dataclass(frozen=True, eq=False)
class _Attempt:
    signal: str
    how: str
    what: str  # "the other sign", "a zero that is 0.12 rad off"
    measurement: Measurement


def contradictions(story: Story, tell: Callable[[str], None]) -> list[Contradiction]:
    """One for each held-out recording that the last model misses by far more than the fitted ones."""
    if story.held is None:
        return []
    found, limit = [], MISSED * max(1.0, ratio(story.data, story.current))
    for place, measurement in enumerate(story.held.measurements):
        alone = alone_of(story.held, story.current, place)
        if alone is None:
            continue
        before = resimulated(alone, story.current.calibration.actuator)[0]
        if before > limit:
            tell(f"asking why {measurement.name} is at odds")
            found.append(_explained(story, alone, before, limit))
    return found


def _explained(story: Story, alone: Data, before: float, limit: float) -> Contradiction:
    (measurement,) = alone.measurements
    axes = story.current.actuator.axes
    tried = [(after, one) for one in _attempts(story, alone) if (after := _with(story, alone, one)) is not None]
    after, best = min(tried, key=lambda pair: pair[0], default=(math.inf, None))
    name = measurement.name or "the held-out recording"
    missed = f"{name} contradicts the fitted recordings: {number(before, 2)} times the floor"
    if best is not None and after < PUT_RIGHT * before and after <= limit:
        title = in_sentence(of_signal(best.signal, axes).title)
        sentence = f"{missed}, and {number(after, 2)} with {best.what} of its {title}."
        return Contradiction(name, best.signal, best.how, sentence, before, after)
    again, others = _another(story, alone)
    if others and again < PUT_RIGHT * before:
        told = f"{missed}, and {number(again, 2)} as another actuator's, with {', '.join(others)}."
        return Contradiction(name, None, "actuator", told, before, again)
    least = min(after, again, before)
    told = f"{missed}; no other sign, zero or unit of a signal and no other actuator explains it."
    return Contradiction(name, None, "unknown", told, before, least)


def _attempts(story: Story, alone: Data) -> Iterator[_Attempt]:
    """The recording with one reading put right."""
    (measurement,) = alone.measurements
    plant = alone.plant(story.current.calibration.actuator)
    shown = calibrate(plant, alone.floors, free=(), signals=alone.signals, start={}).signals
    axes = story.current.actuator.axes
    names = [name for name in _COMPARED if name in measurement]
    simulates = plant.simulates_commands
    for name in (*names, *(("command_rad",) if simulates else ())):
        yield _Attempt(name, "sign", "the other sign", _scaled(measurement, name, -1.0))
    for name in _POSITIONS if simulates else ():
        away = _away([window.measured for window in plant.windows], shown, name)
        if name in measurement and away:
            what = f"a zero that is {amount(abs(away), of_signal(name, axes).unit)} off"
            yield _Attempt(name, "zero", what, measurement.with_signals(**{name: measurement[name] - away}))
    if not simulates and "motor_position_rad" in measurement:
        for part in range(1, 8):  # of a turn: what depends on the angle is elsewhere
            turned = measurement["motor_position_rad"] + 0.25 * math.pi * part
            what = f"a zero that is {amount(0.25 * math.pi * part, 'rad')} off"
            yield _Attempt("motor_position_rad", "zero", what, measurement.with_signals(motor_position_rad=turned))
    sizes = _sizes(story, measurement)
    for name, size in sizes.items():
        for unit, factor in _units(name, axes):
            for times in (factor, 1.0 / factor):
                if 1.0 / _CLOSE < size / times < _CLOSE:
                    what = f"{unit} as the unit" if times > 1.0 else f"a unit that is {number(factor, 3)} times greater"
                    yield _Attempt(name, "unit", what, _scaled(measurement, name, 1.0 / times))


def _units(name: str, axes: Axes) -> list[tuple[str, float]]:
    """Units that a signal may have been recorded in by mistake, and how many of them make one of its own."""
    unit = of_signal(name, axes).unit
    angular = [_DEGREES] if unit == "rad" else []
    return [*angular, (f"m{unit}", _THOUSAND)]


def _sizes(story: Story, measurement: Measurement) -> dict[str, float]:
    """How much larger each signal of a recording is than in the fitted recordings."""
    found = {}
    for name in (*_COMPARED, "command_rad"):
        known = [float(np.std(one[name])) for one in story.data.measurements if name in one]
        if name in measurement and known and min(known) > 0.0:
            found[name] = float(np.std(measurement[name])) / float(np.median(known))
    return found


def _scaled(measurement: Measurement, name: str, factor: float) -> Measurement:
    more = {"motor_position_rad": ("motor_speed_rad_s",)}.get(name, ()) if factor < 0.0 else ()
    return measurement.with_signals(**{n: factor * measurement[n] for n in (name, *more) if n in measurement})


def _away(measured: list[dict[str, Array]], shown: list[dict[str, Array]], name: str) -> float:
    """By how much a signal is off its model all the time."""
    parts = [its[name] - model[name] for its, model in zip(measured, shown) if name in its and name in model]
    return float(np.median(np.concatenate(parts))) if parts else 0.0


def _with(story: Story, alone: Data, one: _Attempt) -> float | None:
    """The error with a reading put right, in floors; None where it cannot be simulated."""
    actuator = story.current.calibration.actuator
    try:
        data = gather([one.measurement], actuator, alone.signals, alone.stretches)
        return resimulated(data, actuator)[0]
    except (InputError, FloatingPointError):
        return None


def _another(story: Story, alone: Data) -> tuple[float, list[str]]:
    """The error with parameters of its own, and those that are others than the fitted recordings'."""
    fitted = story.current.calibration.actuator
    own = [path for path in fitted.tolerances if not path.startswith(("effects.", "sensors."))]
    wide = {path: replace(fitted.tolerances[path], sigma=WIDER * fitted.tolerances[path].sigma) for path in own}
    found = fit(alone, replace(fitted, tolerances=wide))
    after = floor_ratio(alone, found.plant, found.calibration.signals)
    others = []
    for path, one in found.calibration.parameters.items():
        if WIDER * abs(one.z) > ANOTHER and path in wide:
            shown = on_axes(path, fitted.axes)
            others.append(
                f"{in_sentence(shown.title)} {amount(one.value, shown.unit)} for {amount(one.initial, shown.unit)}"
            )
    return after, others


def alone_of(held: Data, found: Fit, place: int) -> Data | None:
    """One of the held-out recordings."""
    windows = held.plant(found.calibration.actuator).windows
    floors = [one for window, one in zip(windows, held.floors) if window.recording == place]
    stretches = None if held.stretches is None else [held.stretches[place]]
    measurements = [held.measurements[place]]
    return (
        replace(held, measurements=measurements, stretches=stretches, floors=floors, after_fit=()) if floors else None
    )


# --- a held-out recording whose encoder is turned: put right by what depends on the angle -----------------------------


class _Turn(NamedTuple):
    by_rad: float  # that the motor's angle is greater by
    is_mirrored: bool


def goes_by_angle(key: str) -> bool:
    """Whether an effect, by its key in a model, stands elsewhere where the encoder is turned."""
    return find(catalogue_name(key)).against in _BY_ANGLE


def put_right(story: Story, found: Fit, keys: Sequence[str], tell: Callable[[str], None]) -> bool:
    """Turns the held-out recordings that deny effects, by their keys in a fit, only where they stand.

    The story goes on with them as they are read then, and says so among its disagreements.  Returned is whether any was
    turned.
    """
    if story.held is None or story.current.plant.simulates_commands:
        return False
    turned, held = [], list(story.held.measurements)
    for place, measurement in enumerate(held):
        tell(f"asking whether the encoder of {measurement.name} is turned")
        right = _turned_back(story, found, keys, place)
        if right is not None:
            held[place], contradiction = right
            turned.append(contradiction)
    if turned:
        names = {one.recording for one in turned}
        story.hold_out(replace(story.held, measurements=held))
        story.turned = [*(one for one in story.turned if one.recording not in names), *turned]
    return bool(turned)


def _turned_back(story: Story, found: Fit, keys: Sequence[str], place: int) -> tuple[Measurement, Contradiction] | None:
    """A held-out recording as its encoder must be read for a fit, and what is said of it; None where none does."""
    assert story.held is not None
    alone, bare = alone_of(story.held, found, place), alone_of(story.held, story.current, place)
    if alone is None or bare is None:
        return None
    (measurement,) = alone.measurements
    without = resimulated(bare, story.current.calibration.actuator)[0]
    as_it_is = _error(alone, found, measurement)
    by_angle = [key for key in keys if goes_by_angle(key)]
    after, best = _best_turn(alone, found, by_angle, measurement)
    # What is true takes as much from the square of the error as it changes.
    change = holdout_change(bare, story.current, found)
    if after >= as_it_is or without**2 - after**2 < SHARED * change**2:
        return None
    name = measurement.name or "the held-out recording"
    said = (
        f"{name} contradicts the fitted recordings: with {in_sentence(find(catalogue_name(by_angle[0])).title)} it is "
        f"off by {number(as_it_is, 2)} times the floor, and by {number(after, 2)} with its encoder "
        f"{_in_words(_orders_of(found, by_angle), best)}."
    )
    how = "sign" if best.is_mirrored else "zero"
    return _turned(measurement, best, found), Contradiction(name, "motor_position_rad", how, said, as_it_is, after)


def _orders_of(found: Fit, keys: Sequence[str]) -> list[float]:
    return [found.actuator.effects[key].get("order", 1.0) for key in keys]


def _in_words(orders: Sequence[float], turn: _Turn) -> str:
    """'turned by 90°, or by 30° more or less, as often as one likes'."""
    by = math.remainder(turn.by_rad, 2.0 * math.pi)
    degrees = f"{number(math.degrees(abs(by)), 3)}°"
    parts = ["mirrored"] if turn.is_mirrored else []
    if not turn.is_mirrored or abs(by) > 1e-6:
        parts.append(f"turned by {degrees} {'forward' if by >= 0.0 else 'backward'}")
    again = ""
    if len(set(orders)) == 1 and orders[0] > 1.0:
        again = f" (or by any number of {number(360.0 / orders[0], 3)}° more, after which it repeats)"
    return " and ".join(parts) + again


def _best_turn(alone: Data, found: Fit, keys: Sequence[str], measurement: Measurement) -> tuple[float, _Turn]:
    """The least error of a fit over all turns, in floors, and the turn."""
    step, turns = _turns(_orders_of(found, keys))
    errors = [(_error(alone, found, _turned(measurement, turn, found)), turn) for turn in turns]
    # One wave alone, mirrored, is the same as turned.
    least, best = min(errors, key=lambda one: one[0] * (_MIRRORED if one[1].is_mirrored else 1.0))
    for share in _FINER:
        for sign in (-1.0, 1.0):
            turn = best._replace(by_rad=best.by_rad + sign * share * step)
            error = _error(alone, found, _turned(measurement, turn, found))
            if error < least:
                least, best = error, turn
    return least, best


def _turns(orders: Sequence[float]) -> tuple[float, Iterator[_Turn]]:
    """The step between the turns that are tried, rad, and all of them.

    Within one period where nothing else in the model tells the angle, else over a whole turn.
    """
    highest = max([1.0, *orders])
    span = 2.0 * math.pi / (highest if len(set(orders)) == 1 else 1.0)
    count = min(_MOST_TRIED // 2, _A_PERIOD * math.ceil(span * highest / (2.0 * math.pi) - 1e-9))
    step = span / count
    mirrors = (False, True)
    return step, (_Turn(step * n, mirrored) for mirrored in mirrors for n in range(count))


def _turned(measurement: Measurement, turn: _Turn, found: Fit) -> Measurement:
    """The recording with the encoder's angle so much greater, or mirrored before; the user's goes along."""
    sign = -1.0 if turn.is_mirrored else 1.0
    gear = found.actuator.transmission.gear_ratio
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
