"""Whether a saved model is what was found: its file read back and simulated beside the recordings again."""

from __future__ import annotations

import os
from dataclasses import dataclass

from ema_model.actuator import load_actuator
from ema_model.discovery.result import Discovery, Rung
from ema_model.estimation.model_fit import resimulated

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
