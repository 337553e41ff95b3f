"""A sudden step of k between two flights: a part replaced, or a fault that came at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.tracking.criteria import JUMP_AFTER, JUMP_BACK, JUMP_LEAST, JUMP_ON, JUMP_WINDOW

Array = NDArray[np.float64]


def jump(k: Array, variance: Array, common: Array, healthy: float) -> int | None:
    """The place of the first flight after a step, of the flights (n,) of one k; None where there is none.

    Only one that JUMP_AFTER flights follow is looked for, so that it is found as soon as it can be.  Medians of three
    flights on either side tell its size, the differences of the flights beside it how large it must be.  What the base
    parameters may add in other commands is no step: k is without what is known of it, common (flights, parameters) is
    what is not.
    """
    at = len(k) - JUMP_AFTER
    if at < JUMP_AFTER + 1:
        return None
    before, after = float(np.median(k[at - 3 : at])), float(np.median(k[at : at + 3]))
    window = k[max(0, at - JUMP_WINDOW) :]
    steps = np.diff(window)
    beside = np.delete(steps, len(window) - JUMP_AFTER - 1)
    spread = max(
        1.4826 * float(np.median(np.abs(beside - np.median(beside)))),
        float(np.sqrt(2.0 * np.median(variance[max(0, at - JUMP_WINDOW) :]))),
    )
    step = after - before - 3.0 * float(np.median(beside))
    of_unit = np.linalg.norm(np.mean(common[at : at + 3], axis=0) - np.mean(common[at - 3 : at], axis=0))
    spread = float(np.hypot(spread, of_unit))
    back = abs(after - healthy) < abs(before - healthy)
    if abs(step) <= max(JUMP_LEAST, (JUMP_BACK if back else JUMP_ON) * spread):
        return None
    return at - 1 + int(np.argmax(np.abs(np.diff(k[at - 2 : at + 2]))))  # medians leave it open by one
