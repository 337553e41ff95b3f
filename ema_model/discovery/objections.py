"""What speaks against what was found: against an effect that the evidence is for, and of held-out recordings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.parameters import on_axes
from ema_model.discovery.fingerprints import greatest, travel
from ema_model.discovery.history import Story
from ema_model.discovery.remaining import ratio
from ema_model.discovery.result import Contradiction
from ema_model.discovery.thresholds import (
    ANOTHER,
    APART,
    DISAGREES,
    LATE_BY,
    MISSED,
    PHASES_APART,
    PUT_RIGHT,
    SHARED,
    WIDER,
)
from ema_model.discovery.uncertainty import colour, signals_of
from ema_model.effects import catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.errors import InputError
from ema_model.estimation import calibrate
from ema_model.estimation.model_fit import Data, Fit, fit, floor_ratio, gather, holdout_change, resimulated
from ema_model.quantities import Axes, amount, in_sentence, number, of_signal
from ema_model.recordings import SIGNALS, Measurement

# --- what speaks against an effect that the evidence is for, in plain words -------------------------------------------
# A value that no such part has, or another one in each recording: where physics is missing that the library does not
# have, some effect bends into its place. Whether an effect is the same everywhere is asked of parts of the recordings,
# or of the halves of a single one: on each the fit takes one step from where all together ended, with the same prior;
# how far it goes is told by what is left there, not by the sensors' noise. What stands in for something else is bent
# another way by another motion.

Array = NDArray[np.float64]

_READINGS = {
    "current_reading": "current_A",
    "position_reading": "user_position_rad",
    "motor_angle_reading": "motor_position_rad",
    "motor_speed_reading": "motor_speed_rad_s",
}
_LOOSE = 0.1  # of the prior's weight, that an effect's own parameters keep: their σ is only a guess
_TELLS = 0.5  # of an amplitude, up to which its σ in a part says anything of it


def unmeasured(data: Data, key: str) -> str:
    """A sensor's error, where nothing was recorded of that sensor."""
    effect = find(catalogue_name(key))
    signals = [_READINGS[place.__name__] for place in effect.places if place.__name__ in _READINGS]
    if signals and not any(signal in one for one in data.measurements for signal in signals):
        return "the signal that it falsifies was not recorded"
    return ""


def within(before: Fit, after: Fit, key: str) -> str:
    """An effect of the file that stays where the file has it."""
    file = before.actuator
    if key not in file.effects:
        return ""
    values = after.calibration.actuator.effects[key].items()
    moved = [
        abs(value - file.effects[key][name]) / file.tolerances[path].sigma
        for name, value in values
        if (path := f"effects.{key}.{name}") in file.tolerances and file.tolerances[path].sigma > 0.0
    ]
    return "" if max(moved, default=0.0) > ANOTHER else "with it the actuator is within the file's tolerances"


def implausible(after: Fit, key: str) -> str:
    """A value that no such part has, wherever in its 90 % interval it may lie."""
    values = after.calibration.actuator.effects[key]
    for parameter in find(catalogue_name(key)).parameters:
        value, low, high = values[parameter.name], *parameter.plausible
        found = after.calibration.parameters.get(f"effects.{key}.{parameter.name}")
        least, most = (value, value) if found is None else found.interval90
        size, beside = 1.0, ""
        if parameter.plausible_at:
            size = greatest(after, parameter.plausible_at)
            beside = f" at {number(size)} {SIGNALS[parameter.plausible_at].unit}"
        elif parameter.plausible_of:
            whole = abs(after.calibration.actuator.value(parameter.plausible_of))
            size = 1.0 / max(whole, 1e-300)
            beside = f" beside a {_title(after, parameter.plausible_of)} of {number(whole)}"
        if (low is not None and most * size < low) or (high is not None and least * size > high):
            return f"its {_title(after, f'effects.{key}.{parameter.name}')} of {number(value)} is not plausible{beside}"
        if parameter.name == "period_rad" and value > travel(after):
            return "its period is longer than the travel"
    return ""


def unsteady(data: Data, after: Fit, key: str) -> str:
    """Another value of one of its parameters in each part of the recordings."""
    apart = disagreement(data, after, key)
    if apart is None:
        return ""
    values = " and ".join(number(value) for value in (min(apart.values), max(apart.values)))
    parts = "the recordings" if len(data.measurements) > 1 else "the halves of the recording"
    return f"{parts} ask for another {_title(after, apart.parameter)} each: {values}"


def _title(found: Fit, path: str) -> str:
    """'stiffness' of 'effects.hinge_moment.stiffness_Nm_rad'."""
    title = on_axes(path, found.actuator.axes).title
    return in_sentence(title.rpartition(": ")[2])


@dataclass(frozen=True, eq=False)
class Disagreement:
    """A parameter of an effect that parts of the recordings put at values apart."""

    parameter: str
    values: tuple[float, ...]  # of the parts that tell, in its unit


def disagreement(data: Data, found: Fit, key: str) -> Disagreement | None:
    """The parameter of an effect on which parts of the recordings disagree most; None where they agree."""
    from scipy.special import chdtrc  # takes a while to import

    names = [*found.calibration.parameters, *found.calibration.starts]
    own = [i for i, name in enumerate(names) if name.startswith(f"effects.{key}.")]
    first = find(catalogue_name(key)).parameters[0]
    strength = f"effects.{key}.{first.name}" if first.low <= 0.0 else ""  # the model is straight in it
    parts = [_apart(data, found, rows, own) for rows in parts_of(data, found)]
    worst, least = None, DISAGREES
    for place, i in enumerate(own):
        one = found.calibration.parameters[names[i]]
        sigma = found.actuator.tolerances[names[i]].sigma
        tell = [(one.value + sigma * step[place], sigma * error[place]) for step, error in parts]
        is_phase = names[i].endswith(ANGLES)
        limit = PHASES_APART if is_phase else APART * abs(one.value)
        if names[i].endswith("delay_s"):
            limit = max(limit, LATE_BY * max(one.sample_period_s for one in data.measurements))
        tell = [(value, error) for value, error in tell if error < max(limit, _TELLS * abs(one.value))]
        if not (is_phase or names[i] == strength):  # a step of its own size is beyond what is straight
            tell = [(value, error) for value, error in tell if abs(value - one.value) < abs(one.value)]
        if len(tell) < 2:
            continue
        values, errors = np.array(tell).T
        weights = errors**-2.0
        mean = float(np.average(values, weights=weights))
        chance = float(chdtrc(len(values) - 1, float(weights @ (values - mean) ** 2)))
        if chance < least and float(np.max(np.abs(values - one.value))) > limit:
            worst, least = Disagreement(names[i], tuple(float(value) for value in values)), chance
    return worst


def parts_of(data: Data, found: Fit) -> list[NDArray[np.bool_]]:
    """Rows of a fit's residual by recording; by halves of its time where there is but one."""
    rows = list(signals_of(data, found.plant))
    windows = [window for window in found.plant.windows for _ in data.fitted(window.measured)]
    label = np.empty(len(found.residual), np.intp)
    for (_, at), window in zip(rows, windows):
        label[at] = window.recording
    if np.ptp(label) == 0:
        middle = np.median(np.concatenate([window.time_s for window in found.plant.windows]))
        for (_, at), window in zip(rows, windows):
            label[at] = window.time_s > middle
    return [label == one for one in np.unique(label)]


def _apart(data: Data, found: Fit, rows: NDArray[np.bool_], own: Sequence[int]) -> tuple[Array, Array]:
    """The step of an effect's parameters on some rows alone, and its standard errors, in σ of their tolerances."""
    calibration = found.calibration
    jacobian = calibration.weighted_jacobian[rows]
    weight = 1.0 / colour(data, found.plant, np.where(rows, found.residual, 0.0))[rows]
    prior = np.ones(len(calibration.x))
    prior[own] = _LOOSE
    pulled = calibration.x.copy()
    pulled[own] = 0.0
    normal = (jacobian * weight[:, None]).T @ jacobian + np.diag(prior)
    moment = jacobian.T @ (weight * found.residual[rows]) + prior * pulled
    covariance = np.linalg.inv(normal)
    return -(covariance @ moment)[own], np.sqrt(np.diag(covariance))[own]


# --- held-out recordings that contradict the fitted ones, and how: a sign, a zero, a unit, another actuator -----------
# A model that meets what it was fitted to and misses by far what it was not has met a recording of something else. Each
# cheap explanation is tried by putting the recording right and simulating it anew; what brings the error down is told.
# Where a held-out recording's encoder is turned, mirrored or shifted, what depends on an angle stands elsewhere in it,
# so that it seems to deny what the fitted recordings show. It is put right by that itself: the turn at which the model,
# as it was fitted, takes from its error what it must.

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
