"""In what the recordings of one unit may disagree, and what it does to the model's errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.floor import POSITIONS
from ema_model.estimation.problem import Problem

Array = NDArray[np.float64]

_CURRENT = "current_A"
_BIAS = "sensors.current_bias_A"
_WIDE = 3.0  # of the file's tolerances of a sensor's zero, 1 σ of what is known of one recording's
# Of a sample, 1 σ of a delay that the model itself is off by in another command: in fleets without any (seeds 76000 to
# 76003) a step's current seemed up to half a sample late in all units alike.
_MODEL = 0.25


@dataclass(frozen=True)
class Candidate:
    """In what one recording may disagree with the others of its unit; counted in its σ."""

    recording: int  # its place
    name: str  # "current_zero" or "current_delay"
    sigma: float  # 1 σ of what is known beforehand
    model: float  # of it, 1 σ of what the model is off by
    unit: str


def _currents(problem: Problem, recording: int) -> Iterator[tuple[int, slice]]:
    """Of a recording: each window, and where the residuals of its current stand."""
    for window, name, rows in problem.parts():
        if name == _CURRENT and problem.model.windows[window].recording == recording:
            yield window, rows


def candidates_of(problem: Problem, residual: Array) -> tuple[tuple[Candidate, ...], Array]:
    """All of a unit, and what each does to the residual (values,): (values, so many)."""
    model = problem.model
    bias = model.actuator.tolerances.get(_BIAS)
    found: list[Candidate] = []
    columns: list[Array] = []
    for place, recorded in enumerate(model.measurements):
        if _CURRENT not in recorded or len(model.measurements) < 2:
            continue
        zero, late = np.zeros(problem.values), np.zeros(problem.values)
        period_s = recorded.sample_period_s
        for window, rows in _currents(problem, place):
            at = model.windows[window]
            one = problem.over_sigma(window, _CURRENT, np.ones(rows.stop - rows.start))
            shown = at.measured[_CURRENT] + residual[rows] / one
            zero[rows], late[rows] = one, -period_s * np.gradient(shown, at.block_s) * one
        if bias is not None:
            found.append(Candidate(place, "current_zero", _WIDE * bias.sigma, 0.0, "A"))
            columns.append(zero * _WIDE * bias.sigma)
        if any(position in recorded for position in POSITIONS):
            found.append(Candidate(place, "current_delay", period_s, _MODEL, "s"))
            columns.append(late)
    return tuple(found), np.stack(columns, axis=1) if columns else np.zeros((problem.values, 0))
