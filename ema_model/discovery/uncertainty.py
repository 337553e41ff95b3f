"""How sure a model's parameters are where what is left is no noise: told, and fitted, by its own size and colour.

χ² counts in units of the sensors' noise, as if values were independent.  Where physics is missing that the model
cannot have, what is left is neither: it is large, and it comes in few shapes that last.  It then tells as much less of
a parameter as its power at its own frequencies stands above white noise; at the floor it tells as much as noise does.

The spectrum is the residual's own, over whole windows and over pieces of them, since errors may last and may come in
bursts: the higher of the two counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation import Calibration
from ema_model.estimation.calibrate import calibrated, problem_of
from ema_model.estimation.least_squares import by_pieces, posterior
from ema_model.estimation.model_fit import Data, Fit, fit
from ema_model.models import Model
from ema_model.quantities import HALF_90
from ema_model.remembered import remembered

Array = NDArray[np.float64]

_PIECE = 256  # values, an eighth of a second
_OF_FILE = 2.0 / HALF_90  # times that a tolerance counts which nothing checks
_ROUNDS = 6  # of fits at most, each without the parameters that the one before drove to their bounds
_OUTSIDE = 3.0  # σ of a parameter's tolerance, beyond which it lies outside
_TOGETHER = 0.7  # correlation from which on two are drawn by the same


def colour(data: Data, plant: Model, residual: Array) -> Array:
    """How many times above white noise of the floor's size a residual is where its power lies: (values,), at least 1.

    χ² over it is the number of independent values that a signal of such a spectrum has.
    """
    parts: dict[str, list[slice]] = {}
    for name, rows in signals_of(data, plant):
        parts.setdefault(name, []).append(rows)
    found = np.ones(len(residual))
    for its in parts.values():
        whole = [residual[rows] for rows in its]
        if np.mean(np.concatenate(whole) ** 2) <= 1.0:
            continue  # within what sensors and the model's own limits leave: the floor tells how that is correlated
        pieces = [piece for one in whole for piece in np.array_split(one, max(1, round(len(one) / _PIECE)))]
        density = max(1.0, _density(whole), _density(pieces))
        for rows in its:
            found[rows] = density
    return found


def signals_of(data: Data, plant: Model) -> Iterator[tuple[str, slice]]:
    """The fitted signals of each window with their rows in a residual, in its order."""
    row = 0
    for window in plant.windows:
        for name in data.fitted(window.measured):
            yield name, slice(row, row + window.blocks)
            row += window.blocks


@remembered(of=1)  # the fit
def colour_of(data: Data, found: Fit) -> Array:
    """`colour` of what a fit leaves."""
    return colour(data, found.plant, found.residual)


def _density(parts: list[Array]) -> float:
    """Mean of a spectrum, weighted by itself; 1 for white noise of variance 1, whose periodogram scatters so."""
    fourth = second = 0.0
    for values in parts:
        power = np.abs(np.fft.rfft(values)) ** 2 / len(values)
        fourth += float(power @ power)
        second += float(power.sum())
    return 0.5 * fourth / second if second > 0.0 else 0.0


@remembered(of=1)  # the fit: a page asks at every look
def with_intervals(data: Data, found: Fit) -> Calibration:
    """A fit's calibration with 90 % intervals that count what is left as it is: as many values as it has shapes.

    At the floor, too, what is left may last, where a model is not quite the rig's.  How its pieces in time pull at each
    parameter tells how far that may be off (White, Econometrica 48 (1980), by clusters); the wider interval counts.
    What the file alone tells, without a controller the scale of all torques above all, nothing checks there: of its
    tolerances, which are somebody's guess, two σ count.
    """
    calibration = found.calibration
    jacobian = calibration.weighted_jacobian / np.sqrt(colour_of(data, found))[:, None]
    covariance = posterior(jacobian)
    problem = problem_of(found.plant, data.floors, free=calibration.free, signals=data.signals)
    variance, most = np.diag(covariance), 1.0 if found.plant.simulates_commands else _OF_FILE
    by_file = np.sum(covariance**2, axis=1)  # of it, what the tolerances leave open
    wider = np.sqrt(np.maximum(1.0 + (most**2 - 1.0) * by_file / variance, _by_pieces(data, found) / variance))
    told = calibrated(problem, calibration.x, covariance * np.outer(wider, wider), most)
    parameters = {name: replace(told[name], at_bound=one.at_bound) for name, one in calibration.parameters.items()}
    return replace(calibration, parameters=parameters).as_result


def _by_pieces(data: Data, found: Fit) -> Array:
    """Variance of each unknown, in σ² of its tolerance, from how pieces of the windows pull at it: (unknowns,)."""
    windows = [i for i, one in enumerate(found.plant.windows) for _ in data.fitted(one.measured)]
    parts = [(window, rows) for window, (_, rows) in zip(windows, signals_of(data, found.plant))]
    calibration = found.calibration
    return np.max(
        [np.diag(one) for one in by_pieces(calibration.weighted_jacobian, calibration.residual, parts)], axis=0
    )


def settled(data: Data, found: Fit, tell: Callable[[str], None]) -> Fit:
    """The same model fitted with what it leaves as its floor: its tolerances then count as much as they should.

    A parameter of the actuator that what is missing still drives to its bound stays as the file says.
    """
    size = {name: float(np.sqrt(colour_of(data, found)[rows][0])) for name, rows in signals_of(data, found.plant)}
    floors = [
        replace(
            one,
            noise={name: size.get(name, 1.0) * value for name, value in one.noise.items()},
            model={name: size.get(name, 1.0) * values for name, values in one.model.items()},
        )
        for one in data.floors
    ]
    quiet, again, held = replace(data, floors=floors), found, ()
    for _ in range(_ROUNDS):
        again = fit(quiet, found.actuator, again.starts, tell, found.faults, held)
        driven = [path for path, one in again.calibration.parameters.items() if one.at_bound and is_base(path)]
        if not driven:
            break
        held = (*held, *driven)
    calibration = again.calibration
    rows = np.concatenate([np.full(at.stop - at.start, size[name]) for name, at in signals_of(data, found.plant)])
    residual = calibration.residual * rows
    return replace(
        again,
        calibration=replace(
            calibration,
            residual=residual,
            chi2_per_value=float(residual @ residual) / len(residual),
            weighted_sensitivities=[
                {name: size[name] * values for name, values in part.items()}
                for part in calibration.weighted_sensitivities
            ],
        ),
    )


def is_base(path: str) -> bool:
    """Whether a parameter is the actuator's own, and no fault's or effect's."""
    return "." in path and not path.startswith("effects.")


def outside_tolerance(data: Data, found: Fit) -> list[str]:
    """Paths of the actuator's parameters whose value no tolerance of its file allows.

    Without a controller one scale holds all torques, so that several parameters share what draws at them, and none of
    them may be far off.  If the file is right, the estimates, in σ of the tolerances, are spread by 1 − C where C is
    the posterior's covariance: what counts is how far one is off in that, and of those drawn together, the farthest.
    """
    calibration = found.calibration
    if found.plant.simulates_commands:
        return [name for name in calibration.outside_tolerance if is_base(name)]
    jacobian = calibration.weighted_jacobian / np.sqrt(colour_of(data, found))[:, None]
    expected = np.eye(calibration.x.size) - posterior(jacobian)
    spread = np.sqrt(np.maximum(np.diag(expected), np.finfo(float).eps))
    together = np.abs(expected / np.outer(spread, spread)) > _TOGETHER
    told: list[int] = []
    for i in np.argsort(-np.abs(calibration.x[: len(calibration.free)])):
        is_far = abs(calibration.x[i]) > _OUTSIDE * spread[i]
        if is_far and is_base(calibration.free[i]) and not together[i, told].any():
            told.append(int(i))
    return [calibration.free[i] for i in sorted(told)]
