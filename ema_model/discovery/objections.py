"""What speaks against an effect that the evidence is for, in plain words: a value that no such part has, or another one
in each recording.

Where physics is missing that the library does not have, some effect bends into its place.  Whether an effect is the
same everywhere is asked of parts of the recordings, or of the halves of a single one: on each the fit takes one step
from where all together ended, with the same prior; how far it goes is told by what is left there, not by the sensors'
noise.  What stands in for something else is bent another way by another motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator.parameters import on_axes
from ema_model.discovery.criteria import ANOTHER, APART, DISAGREES, LATE_BY, PHASES_APART
from ema_model.discovery.fingerprints import greatest, travel
from ema_model.discovery.uncertainty import colour, signals_of
from ema_model.effects import catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit
from ema_model.quantities import in_sentence, number
from ema_model.recordings import SIGNALS

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
