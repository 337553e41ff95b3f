"""How far a model is from recordings when it runs freely: from their first state on, driven by what was put in alone.

In a closed loop the command is put in, in an open loop the recorded current, torque or force.  Nothing of the measured
motion is fed back, so that errors add up as they do for whoever simulates with the model: the measure of published
benchmarks, in the signal's own unit.  A model that was fitted by inverse dynamics, whose controller is not known, is
put in open loop for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.models import Model, Window
from ema_model.models.open_loop import FreeMotion, free_motion
from ema_model.quantities import SIGNALS, in_sentence, of_signal
from ema_model.recordings import Measurement
from ema_model.result import NULL

Array = NDArray[np.float64]
Pair = tuple[Array, Array]  # measured and simulated, (n,) each

_MOTION = ("motor_position_rad", "user_position_rad", "motor_speed_rad_s")
# Of an error, that it may differ by where a hundred-thousandth more or less is put in: of motions that go on it is up
# to 0.04, of those that stop and start 0.3 and more.
_STEADY = 0.1
A_MAP = "a static map has no motion over time"


@dataclass(frozen=True)
class Score:
    """How far a free simulation is from a measured signal; NaN where there is none that means anything."""

    rmse: float  # rms of measurement − simulation, in the signal's unit
    mae: float  # mean absolute error, likewise
    percent_of_range: float  # the rms error, of the measured signal's range
    reason: str = ""  # why there is no number


@dataclass(frozen=True)
class Simulated:
    """Of one signal, over all recordings together."""

    fitted: Score
    holdout: Score | None = None  # of recordings that were not fitted; None where there are none
    at_fitted_offset: Score | None = None  # of the same in open loop, with the fitted recordings' offset, not their own


@dataclass(frozen=True)
class FreeError:
    """How far the model is from one signal when it runs freely from the recordings' first state on."""

    rmse: Annotated[float, Meta(description="rms error over all fitted recordings; null: see reason", extra=NULL)]
    mae: Annotated[float, Meta(description="mean absolute error, likewise", extra=NULL)]
    percent_of_range: Annotated[float, Meta(description="rmse, % of the measured signal's range", extra=NULL)]
    reason: Annotated[str, Meta(description="why there is no number; empty where there is one")]
    holdout_rmse: Annotated[float, Meta(description="rmse of recordings that were not fitted; null: none", extra=NULL)]
    holdout_mae: Annotated[float, Meta(description="mae of the same", extra=NULL)]
    holdout_percent_of_range: Annotated[float, Meta(description="percent_of_range of the same", extra=NULL)]
    holdout_reason: Annotated[str, Meta(description="why there is no number of those that were held out")]
    holdout_rmse_at_fitted_offset: Annotated[
        float,
        Meta(
            description="holdout_rmse in open loop with the fitted recordings' offset, not with their own", extra=NULL
        ),
    ]
    unit: Annotated[str, Meta(description="of rmse and mae")]


def errors_in_units(simulation: Mapping[str, Simulated]) -> dict[str, FreeError]:
    """The free simulation's errors by signal, in the signals' units."""
    found = {}
    for name, one in simulation.items():
        held, same = one.holdout or without(""), one.at_fitted_offset or without("")
        found[name] = FreeError(
            rmse=one.fitted.rmse,
            mae=one.fitted.mae,
            percent_of_range=one.fitted.percent_of_range,
            reason=one.fitted.reason,
            holdout_rmse=held.rmse,
            holdout_mae=held.mae,
            holdout_percent_of_range=held.percent_of_range,
            holdout_reason=held.reason,
            holdout_rmse_at_fitted_offset=same.rmse,
            unit=SIGNALS[name].unit,
        )
    return found


def scored(fitted: Mapping[str, Pair], holdout: Mapping[str, Pair]) -> dict[str, Simulated]:
    """Of each signal: those measured and simulated over the fitted recordings and over held-out ones."""
    return {
        name: Simulated(score(*pair), score(*holdout[name]) if name in holdout else None)
        for name, pair in fitted.items()
    }


def score(measured: Array, simulated: Array) -> Score:
    """Of one signal; all (n,)."""
    error = measured - simulated
    if not np.all(np.isfinite(error)):
        return without("the simulation diverges")
    rmse, spread = float(np.sqrt(np.mean(error**2))), float(np.ptp(measured))
    return Score(rmse, float(np.mean(np.abs(error))), 100.0 * rmse / spread if spread > 0.0 else math.nan)


def without(reason: str) -> Score:
    """No number, and why."""
    return Score(math.nan, math.nan, math.nan, reason)


def is_by_motion(model: Model) -> bool:
    """Whether a model takes the measured motion in, so that what it shows is no free simulation."""
    return model.windows[0].command is None


def in_open_loop(
    recordings: Sequence[Measurement], holdout: Sequence[Measurement], actuator: Actuator
) -> dict[str, Simulated]:
    """Of the motion of an actuator that was fitted by inverse dynamics, by the signals' names inside.

    In each recording one offset of the recorded current or torque is estimated, and where it starts; held-out
    recordings are simulated with the fitted ones' mean offset as well.  Where the error is as large as the signal's own
    deviation from its mean, the simulation tells nothing of it, and there is no number but the reason.
    """
    names = [name for name in _MOTION if any(name in one for one in recordings)]
    if any(one.is_map for one in recordings):
        return {name: Simulated(without(A_MAP)) for name in names}
    try:
        fitted = free_motion(recordings, actuator)
    except InputError as error:
        return {name: Simulated(without(str(error))) for name in names}
    found = _scores(fitted, actuator)
    if not holdout:
        return {name: Simulated(one) for name, one in found.items()}
    try:
        own, same = (free_motion(holdout, actuator, of) for of in (None, float(np.mean(fitted.offsets))))
    except InputError as error:
        return {name: Simulated(one, without(str(error))) for name, one in found.items()}
    held, without_own = _scores(own, actuator), _scores(same, actuator)
    return {name: Simulated(one, held.get(name), without_own.get(name)) for name, one in found.items()}


def _scores(motion: FreeMotion, actuator: Actuator) -> dict[str, Score]:
    every, *beside = (pairs(motion.windows, signals) for signals in (motion.signals, *motion.beside))
    return {
        name: _where_stable(name, every[name], [one[name] for one in beside], actuator)
        for name in _MOTION
        if name in every
    }


def pairs(windows: Sequence[Window], simulated: Sequence[Mapping[str, Array]]) -> dict[str, Pair]:
    """Of each signal what was measured and what was simulated, all windows one after another."""
    found = {}
    for name in dict.fromkeys(name for window in windows for name in window.measured):
        parts = [
            (window.measured[name], shown[name])
            for window, shown in zip(windows, simulated)
            if name in window.measured and name in shown
        ]
        if parts:
            found[name] = np.concatenate([one for one, _ in parts]), np.concatenate([one for _, one in parts])
    return found


def _where_stable(name: str, pair: Pair, beside: Sequence[Pair], actuator: Actuator) -> Score:
    """The score, or why there is none: what adds up in open loop is as large as the signal, or is never the same.

    Where a motor stops and starts, a trifle decides when: the error is then one of many that as well might be.
    """
    found = score(*pair)
    if found.reason:
        return found
    own = float(np.std(pair[0]))
    errors = [score(*one).rmse for one in beside]
    steady = all(abs(one - found.rmse) <= _STEADY * found.rmse for one in errors)
    if found.rmse < own and steady:
        return found
    shown = of_signal(actuator.axes.signal(name), actuator.axes).scaled([found.rmse, own])
    title = in_sentence(shown.title)
    if found.rmse < own:
        return without("in open loop a hundred-thousandth more or less put in leads elsewhere")
    return without(
        f"in open loop the error adds up to {shown.text(found.rmse)} rms, "
        f"and the {title} itself departs from its mean by {shown.text(own)}"
    )
