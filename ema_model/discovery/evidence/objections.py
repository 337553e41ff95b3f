"""Whether an effect that the data pay for is claimed: what speaks against it, in plain words.

Where physics is missing that the library does not have, some effect bends into its place.  It is told by what it is
bent to: a value that no such part has, another one in each recording, an error that rises.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ema_model.actuator.parameters import on_axes
from ema_model.discovery.criteria import (
    ANOTHER,
    AS_MUCH,
    DRIVEN,
    FAR,
    LEAST_FALL,
    LEAST_SHARE,
    NONE_OF_IT,
    OF_FAINT,
    TIE,
)
from ema_model.discovery.evidence.counted import colour_of, evidence, signals_of
from ema_model.discovery.evidence.extents import greatest, travel
from ema_model.discovery.evidence.remaining import at_floor, left_by, may_be_true, used_left
from ema_model.discovery.evidence.stability import disagreement
from ema_model.discovery.evidence.uncertainty import with_intervals
from ema_model.effects import catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit, floor_ratio
from ema_model.quantities.numbers import number, with_uncertainty
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import SIGNALS

_READINGS = {
    "current_reading": "current_A",
    "position_reading": "user_position_rad",
    "motor_angle_reading": "motor_position_rad",
    "motor_speed_reading": "motor_speed_rad_s",
}


def against(data: Data, before: Fit, after: Fit, keys: Sequence[str], settled: Callable[[Fit], Fit]) -> str:
    """The first thing that speaks against the effects that a fit has beyond another; "" where nothing does.

    settled(fit): a fit calibrated to what it leaves; far above the floor the tolerances count only there.  It takes as
    long as a fit, so that it is asked for last.
    """
    return (
        next((reason for key in keys if (reason := unmeasured(data, key) or within(before, after, key))), "")
        or _worse(data, before, after)
        or _little(data, before, after)
        or _needless(data, before, keys)
        or _faint(data, before, after)
        or _strained(data, before, after)
        or outdone(data, before, after)
        or _dated(data, before, after)
        or _against_settled(data, before, after, keys, settled)
    )


def _against_settled(data: Data, before: Fit, after: Fit, keys: Sequence[str], settled: Callable[[Fit], Fit]) -> str:
    calm = settled(after)
    seen = before if calm is after else calm
    reason = next((reason for key in keys if (reason := _of_its_values(data, before, seen, calm, key))), "")
    if not reason and not calm.calibration.converged:
        reason = "the fit with it did not converge"
    if reason or calm is after:
        return reason
    first = settled(before)
    # Near the floor a settled model, too, may lack a second cause that shares the error.
    return _idle(data, first, calm) or ("" if ratio(data, after) < FAR else _little(data, first, calm))


def still_against(data: Data, base: Fit, found: Fit, key: str) -> str:
    """What speaks against one of the effects of a model, in it."""
    return _of_its_values(data, base, base if at_floor(data, found) else found, found, key)


def _of_its_values(data: Data, base: Fit, before: Fit, after: Fit, key: str) -> str:
    return (
        _bent(before, after, key)
        or implausible(after, key)
        or unsteady(data, after, key)
        or _may_be_none(data, base, after, key)
    )


def outdone(data: Data, before: Fit, after: Fit) -> str:
    """Whether the residual's own curve tells more than a model does; what brings the error to the floor tells all."""
    curve = left_by(data, before).explanation
    if curve is None or at_floor(data, after):
        return ""
    signal, residual, left = used_left(data, before, after)
    total = float(residual @ residual)
    beyond = max(total - len(residual), 3.0 * np.sqrt(2.0 * len(residual)))
    tells = curve.beyond_noise * beyond  # of χ² of the signal that is explained
    colours = [float(colour_of(data, after)[rows][0]) for name, rows in signals_of(data, after.plant) if name == signal]
    scale = colours[0] if colours else 1.0
    enough = AS_MUCH * tells - TIE * scale
    if total - float(left @ left) >= enough or evidence(data, before, after) * scale >= enough:
        return ""
    return f"a curve over the {curve.variable.replace('_', ' ')} explains more"


def _dated(data: Data, before: Fit, after: Fit) -> str:
    """Whether what happened at one moment tells more than a model; what brings the error to the floor tells all."""
    if at_floor(data, after):
        return ""
    for one in left_by(data, before).events:
        if before.chi2 - after.chi2 < AS_MUCH * one.gain:
            return f"a step at {number(one.time_s)} s of {one.name or 'the recording'} explains more"
    return ""


def ratio(data: Data, found: Fit) -> float:
    """The error of a fit in the floors that it was weighed by."""
    return floor_ratio(data.before_fit, found.plant, found.calibration.signals)


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


def _bent(before: Fit, after: Fit, key: str) -> str:
    """A parameter of the effect at its bound, or one of the actuator that is not there in the fit before.

    Far above the floor tolerances count for nothing until the model has settled.  There `before` is `after` itself, and
    any parameter of the actuator at its bound speaks against it.
    """
    parameters = after.calibration.parameters
    for path, one in parameters.items():
        if not one.at_bound or path.endswith(ANGLES):
            continue
        if path.startswith(f"effects.{key}."):
            return f"its {_title(after, path)} would stand at the bound"
        if "." not in path or path.startswith("effects."):
            continue
        if before is after or abs(one.z) - abs(before.calibration.parameters[path].z) > DRIVEN:
            return f"it drives the {_title(after, path)} to its bound"
    return ""


def implausible(after: Fit, key: str) -> str:
    """A value that no such part has."""
    values = after.calibration.actuator.effects[key]
    for parameter in find(catalogue_name(key)).parameters:
        value, low, high = values[parameter.name], *parameter.plausible
        size, beside = 1.0, ""
        if parameter.plausible_at:
            size = greatest(after, parameter.plausible_at)
            beside = f" at {number(size)} {SIGNALS[parameter.plausible_at].unit}"
        elif parameter.plausible_of:
            whole = abs(after.calibration.actuator.value(parameter.plausible_of))
            size = 1.0 / max(whole, 1e-300)
            beside = f" beside a {_title(after, parameter.plausible_of)} of {number(whole)}"
        if (low is not None and value * size < low) or (high is not None and value * size > high):
            return f"its {_title(after, f'effects.{key}.{parameter.name}')} of {number(value)} is not plausible{beside}"
        if parameter.name == "period_rad" and value > travel(after):
            return "its period is longer than the travel"
    return ""


def _worse(data: Data, before: Fit, after: Fit) -> str:
    return "the error rises with it" if ratio(data, after) > ratio(data, before) else ""


def _idle(data: Data, before: Fit, after: Fit) -> str:
    """Whether the error stays where it is once the actuator's parameters keep to their tolerances."""
    if at_floor(data, after) or ratio(data, after) < (1.0 - LEAST_FALL) * ratio(data, before):
        return ""
    return "within the tolerances of the actuator the error does not fall with it"


def _little(data: Data, before: Fit, after: Fit) -> str:
    """Whether far more is left than the effects explain."""
    if ratio(data, after) < FAR:
        return ""
    first, second = (float(one.residual @ one.residual) for one in (before, after))
    share = (first - second) / max(first - len(before.residual), len(before.residual))
    return "" if share >= LEAST_SHARE else f"it explains {100.0 * share:.0f} % of an error whose cause is not known"


def _needless(data: Data, before: Fit, keys: Sequence[str]) -> str:
    """Whether nothing is left to explain.

    Of 700 discoveries the one that added an effect to such a model added what is not there.  What is a parameter's
    value by another name is told as that one is.
    """
    if any(find(catalogue_name(key)).duplicates for key in keys):
        return ""
    left = floor_ratio(data, before.plant, before.calibration.signals)
    return "" if left > 1.0 else "without it no more than the floor is left"


def _faint(data: Data, before: Fit, after: Fit) -> str:
    """Whether a model that may be true as it is would keep most of what it leaves beyond the floor."""
    first, last = (floor_ratio(data, one.plant, one.calibration.signals) for one in (before, after))
    if not may_be_true(data, before) or last <= 1.0:
        return ""
    kept = (last**2 - 1.0) / max(first**2 - 1.0, 1e-9)
    return "" if kept < 1.0 - OF_FAINT else "a true model may leave as much, and most of it stays"


def _strained(data: Data, before: Fit, after: Fit) -> str:
    """Whether beside a model that may be true as it is, the effect needs a parameter that this has at its bound."""
    if not may_be_true(data, before):
        return ""
    known = before.calibration.parameters
    bent = [path for path, one in after.calibration.parameters.items() if one.at_bound and path in known]
    path = next((path for path in bent if "." in path and not path.endswith(ANGLES)), "")
    return path and f"a true model may leave as much, and with it the {_title(after, path)} stands at its bound"


def unsteady(data: Data, after: Fit, key: str) -> str:
    apart = disagreement(data, after, key)
    if apart is None:
        return ""
    values = " and ".join(number(value) for value in (min(apart.values), max(apart.values)))
    parts = "the recordings" if len(data.measurements) > 1 else "the halves of the recording"
    return f"{parts} ask for another {_title(after, apart.parameter)} each: {values}"


def _may_be_none(data: Data, base: Fit, after: Fit, key: str) -> str:
    """Whether the intervals that are told of an effect's strength, in each of its parts, nearly reach none of it.

    Evidence counts what a model takes; how what is left pulls at the effect from piece to piece may tell less of it.
    What is a parameter's value by another name is as open as that one's tolerance.
    """
    effect = find(catalogue_name(key))
    first = effect.parameters[0]
    if first.low > 0.0 or effect.duplicates or key in base.actuator.effects:
        return ""
    told = with_intervals(data, after).parameters
    paths = [f"effects.{key}.{name}" for name in (first.name, *effect.beside)]
    intervals = {path: told[path].interval90 for path in paths}
    if any(abs(low + high) > NONE_OF_IT * (high - low) for low, high in intervals.values()):
        return ""
    low, high = intervals[paths[0]]
    unit = on_axes(paths[0], after.actuator.axes).unit
    told_as = with_uncertainty((low + high) / 2.0, (high - low) / 2.0, unit)
    return f"its {_title(after, paths[0])} is {told_as} and may as well be none"


def _title(found: Fit, path: str) -> str:
    """'stiffness' of 'effects.hinge_moment.stiffness_Nm_rad'."""
    title = on_axes(path, found.actuator.axes).title
    return in_sentence(title.rpartition(": ")[2])
