"""What a fit takes up of the difference between its model and the three-phase twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.calibrate import Calibration
from ema_model.estimation.floor import Floor, local_rms
from ema_model.models.model import Signals

Array = NDArray[np.float64]


def after_fit(floors: Sequence[Floor], calibration: Calibration, twins: Sequence[Signals]) -> list[Floor]:
    """The floors of a calibration's windows with `left`: what no parameter takes up of the twin's difference t.

    t − J(JᵀJ + I)⁻¹Jᵀt, weighted as the fit was: J are its sensitivities, and I is the prior.  twins: as of
    `twin_error`, by window, with the calibrated parameters.  Floors without a twin stay as they are.
    """
    parts = [
        (place, name, part[name], twins[place][name] / floors[place].fit_sigma(name))
        for place, part in enumerate(calibration.weighted_sensitivities)
        for name in part
        if name in twins[place]
    ]
    if not parts or not calibration.x.size:
        return list(floors)
    jacobian, twin = (np.concatenate(one) for one in zip(*((j, t) for _, _, j, t in parts)))
    taken = np.linalg.solve(jacobian.T @ jacobian + np.eye(calibration.x.size), jacobian.T @ twin)
    left: list[dict[str, Array]] = [{} for _ in floors]
    for place, name, part, own in parts:
        one = floors[place]
        before, after = (local_rms(t * one.fit_sigma(name), one.block_s) for t in (own, own - part @ taken))
        besides = 0.5 * (np.maximum(one.model[name], before) ** 2 - before**2)  # also by how much two twins differ
        left[place][name] = np.sqrt(besides + np.minimum(before, after) ** 2)
    return [replace(one, left=its) for one, its in zip(floors, left)]


def of_unseen(floors: Sequence[Floor], fitted: Sequence[Floor]) -> list[Floor]:
    """Floors of recordings that were not fitted, of which as much is left, by signal, as of those that were."""
    shares = {name: _share_left(fitted, name) for name in {name for one in fitted for name in one.left}}
    return [
        replace(one, left={name: share * one.model[name] for name, share in shares.items() if name in one.model})
        for one in floors
    ]


def _share_left(fitted: Sequence[Floor], name: str) -> float:
    known = [one for one in fitted if name in one.left]
    left = sum(float(one.counts @ one.left[name] ** 2) for one in known)
    whole = sum(float(one.counts @ one.model[name] ** 2) for one in known)
    return float(np.sqrt(left / whole)) if whole else 1.0
