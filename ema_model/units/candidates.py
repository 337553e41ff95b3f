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
_RESISTANCE = "motor.resistance_Ohm"
_COPPER_1_K = 0.0039  # of a winding's resistance, a kelvin: IEC 60034-1
_WARM_K = 20.0  # 1 σ of how much warmer one recording's winding may be
_WIDE = 3.0  # of the file's tolerances of a sensor's zero, 1 σ of what is known of one recording's
# Of a sample, 1 σ of a delay that the model itself is off by in another command: in fleets without any (seeds 76000 to
# 76003) a step's current seemed up to half a sample late in all units alike.
_MODEL = 0.25
_LATE_BENT = 0.3  # a sharp current that comes later is no multiple of its slope
# Steps of a winding warmer by 10 to 60 K than in another step are told to be by −4 to +31 %; up to 45 K no difference
# between units follows from it, at 60 K one does.
_WARM_BENT, _WARMEST = 0.15, 2.25


@dataclass(frozen=True)
class Candidate:
    """In what one recording may disagree with the others of its unit; counted in its σ."""

    recording: int  # its place
    name: str  # "current_zero", "current_delay" or "winding_temperature"
    sigma: float  # 1 σ of what is known beforehand
    unit: str
    model: float = 0.0  # of it, 1 σ of what the model is off by
    bent: float = 0.0  # of its size, 1 σ of how far what it does is no multiple of that
    farthest: float = np.inf  # up to which what is said of the unit does not suffer by it
    parameter: int | None = None  # the one that does the same to all recordings, by its place


def _parts_of(problem: Problem, recording: int) -> Iterator[tuple[int, str, slice]]:
    """Of a recording: each window, the name of a signal in it, and where that one's residuals stand."""
    for window, name, rows in problem.parts():
        if problem.model.windows[window].recording == recording:
            yield window, name, rows


def candidates_of(problem: Problem, residual: Array, slope: Array) -> tuple[tuple[Candidate, ...], Array]:
    """All of a unit, and what each does to the residual (values,): (values, so many).

    slope (values, unknowns): what the problem's unknowns do to it.
    """
    model = problem.model
    bias = model.actuator.tolerances.get(_BIAS)
    warm = _warmth(problem, slope)
    found: list[Candidate] = []
    columns: list[Array] = []
    for place, recorded in enumerate(model.measurements):
        if len(model.measurements) < 2:
            continue
        if warm is not None:
            found.append(Candidate(place, "winding_temperature", _WARM_K, "K", 0.0, _WARM_BENT, _WARMEST, warm[0]))
            warmer = np.zeros(problem.values)
            for _, _, rows in _parts_of(problem, place):
                warmer[rows] = warm[1][rows]
            columns.append(warmer)
        if _CURRENT not in recorded:
            continue
        zero, late = np.zeros(problem.values), np.zeros(problem.values)
        period_s = recorded.sample_period_s
        for window, name, rows in _parts_of(problem, place):
            if name != _CURRENT:
                continue
            at = model.windows[window]
            one = problem.over_sigma(window, _CURRENT, np.ones(rows.stop - rows.start))
            shown = at.measured[_CURRENT] + residual[rows] / one
            zero[rows], late[rows] = one, -period_s * np.gradient(shown, at.block_s) * one
        if bias is not None:
            found.append(Candidate(place, "current_zero", _WIDE * bias.sigma, "A"))
            columns.append(zero * _WIDE * bias.sigma)
        if any(position in recorded for position in POSITIONS):
            found.append(Candidate(place, "current_delay", period_s, "s", _MODEL, _LATE_BENT, 0.0))
            columns.append(late)
    return tuple(found), np.stack(columns, axis=1) if columns else np.zeros((problem.values, 0))


def _warmth(problem: Problem, slope: Array) -> tuple[int, Array] | None:
    """The resistance's place among the unknowns, and what a winding warmer by 1 σ does to all recordings."""
    paths = [one.name for one in problem.unknowns]
    if _RESISTANCE not in paths:
        return None
    place, actuator = paths.index(_RESISTANCE), problem.model.actuator
    of_sigma = _COPPER_1_K * actuator.value(_RESISTANCE) / actuator.tolerances[_RESISTANCE].sigma
    return place, slope[:, place] * _WARM_K * of_sigma
