"""A found model simulated again: freely over whole recordings, and as its saved file has it."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.free_simulation import Simulated, in_open_loop, is_by_motion, pairs, scored
from ema_model.discovery.result import Discovery, Rung
from ema_model.estimation.model_fit import Data, Fit, holdout_signals, resimulated
from ema_model.models import Window, model_for
from ema_model.models.measured_motion import evaluation_stretches
from ema_model.models.model import Signals
from ema_model.remembered import remembered

Array = NDArray[np.float64]

_WORSE = 1.03  # times the last rung's error, up to which a saved model counts as the one that was found


@dataclass(frozen=True)
class Verified:
    """The error of a saved model in units of the floor, pooled over signals: 1 is the floor."""

    rmse: float
    holdout_rmse: float | None  # of the recordings that were held out
    is_worse: bool  # than the last rung of the ladder


def verified(found: Discovery, path: str | os.PathLike[str]) -> Verified:
    """The error of a model that was saved to an actuator file, as of `emaviz compare --no-calibrate` with it.

    Only where the recordings start is fitted; they are counted in the floors of the ladder.
    Raises InputError for a file that cannot be read back.
    """
    actuator = load_actuator(os.fspath(path))
    rmse, *_ = resimulated(found.data, actuator)
    held = None if found.held is None else resimulated(found.held, actuator)[0]
    last: Rung = found.ladder[-1]
    pairs = [(rmse, last.rmse), (held, last.holdout_rmse)]
    worse = any(now is not None and then is not None and not now <= _WORSE * then for now, then in pairs)
    return Verified(rmse, held, worse)


@remembered(of=2)  # the fit: a page asks at every look
def free_simulation(data: Data, held: Data | None, found: Fit) -> dict[str, Simulated]:
    """How far a fit is from each signal when it runs freely over whole recordings, by the signals' names in files."""
    actuator = found.calibration.actuator
    if is_by_motion(found.plant):
        errors = in_open_loop(data.measurements, () if held is None else held.measurements, actuator)
    else:
        unseen = {} if held is None else pairs(*_whole(held, actuator, holdout_signals(held, found)))
        errors = scored(pairs(*_whole(data, actuator, found.calibration.signals)), unseen)
    return {actuator.axes.signal(name): one for name, one in errors.items()}


def _whole(
    data: Data, actuator: Actuator, signals: Sequence[Signals]
) -> tuple[Sequence[Window], Sequence[Mapping[str, Array]]]:
    """The windows of whole recordings, and the model's signals there; signals: those of the parts that were fitted."""
    if data.stretches is None:
        return data.plant(actuator).windows, signals
    whole = model_for(data.measurements, actuator, stretches=evaluation_stretches(data.measurements, actuator))
    shown = [whole.signals(place) for place in range(len(whole.windows))]
    return whole.windows, [{name: values[0] for name, values in one.items()} for one in shown]
