"""What a fit takes up of the difference between its model and the three-phase twin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.calibrate import Calibration, by_window, problem_of
from ema_model.estimation.floor import Floor, local_rms
from ema_model.models import Model
from ema_model.models.model import Signals

Array = NDArray[np.float64]

_OF_TWINS = 0.25  # of the squares that the twins before and after the fit differ by: as much is left of true models


def after_fit(
    floors: Sequence[Floor], calibration: Calibration, twins: Sequence[Signals], taken: Array | None = None
) -> list[Floor]:
    """The floors of a calibration's windows with `left`: what no parameter takes up of the twin's difference t.

    t − J(JᵀJ + I)⁻¹Jᵀt, weighted as the fit was: J are its sensitivities, and I is the prior.  twins: as of
    `twin_error`, by window, with the calibrated parameters; taken: as of `taken_up`, where it is known.  Floors
    without a twin stay as they are.
    """
    taken = taken_up(floors, calibration, twins) if taken is None else taken
    return _floors_left(floors, twins, calibration.weighted_sensitivities, taken)


def taken_up(floors: Sequence[Floor], calibration: Calibration, twins: Sequence[Signals]) -> Array:
    """By how much a calibration's unknowns are off, as they take up what its twins differ by: (unknowns,), in σ."""
    return _solved(_parts(floors, twins, calibration.weighted_sensitivities), calibration.x.size)


def of_unseen(
    model: Model,
    floors: Sequence[Floor],
    calibration: Calibration,
    taken: Array,
    twins: Sequence[Signals],
    signals: Mapping[str, float],
) -> list[Floor]:
    """Floors of recordings that were not fitted, with `left` as of `after_fit`.

    model: the calibrated one beside them; taken: as of `taken_up`, there; twins: here.  The parameters are off by what
    they took up elsewhere, which moves this model, too; only where it starts is fitted here.
    """
    problem = problem_of(model, floors, free=calibration.free, signals=signals)
    if not problem.count:
        return list(floors)
    _, jacobian = problem.jacobians(np.zeros((1, problem.count)), in_whole_blocks=True)
    slopes = by_window(problem, jacobian[0], weighted=True)
    shared = len(calibration.free)
    moved = np.concatenate([taken[:shared], np.zeros(problem.count - shared)])
    rest = [(place, name, part, own - part @ moved) for place, name, part, own in _parts(floors, twins, slopes)]
    own_starts = [(place, name, part[:, shared:], own) for place, name, part, own in rest]
    moved[shared:] = _solved(own_starts, problem.count - shared)
    return _floors_left(floors, twins, slopes, moved)


_Part = tuple[int, str, Array, Array]  # window, signal; weighted: sensitivities (blocks, unknowns), twin's difference


def _parts(floors: Sequence[Floor], twins: Sequence[Signals], slopes: Sequence[Mapping[str, Array]]) -> list[_Part]:
    return [
        (place, name, part[name], twins[place][name] / floors[place].fit_sigma(name))
        for place, part in enumerate(slopes)
        for name in part
        if name in twins[place]
    ]


def _solved(parts: Sequence[_Part], unknowns: int) -> Array:
    """(JᵀJ + I)⁻¹Jᵀt"""
    if not parts or not unknowns:
        return np.zeros(unknowns)
    jacobian, twin = (np.concatenate(one) for one in zip(*((j, t) for _, _, j, t in parts)))
    return np.asarray(np.linalg.solve(jacobian.T @ jacobian + np.eye(unknowns), jacobian.T @ twin), dtype=float)


def _floors_left(
    floors: Sequence[Floor], twins: Sequence[Signals], slopes: Sequence[Mapping[str, Array]], taken: Array
) -> list[Floor]:
    """With `left`, where unknowns that are off by `taken` move the model by its weighted sensitivities."""
    if not taken.size:
        return list(floors)
    left: list[dict[str, Array]] = [{} for _ in floors]
    for place, name, part, own in _parts(floors, twins, slopes):
        one = floors[place]
        before, after = (local_rms(t * one.fit_sigma(name), one.block_s) for t in (own, own - part @ taken))
        besides = _OF_TWINS * (np.maximum(one.model[name], before) ** 2 - before**2)
        left[place][name] = np.sqrt(besides + np.minimum(before, after) ** 2)
    return [replace(one, left=its) for one, its in zip(floors, left)]
