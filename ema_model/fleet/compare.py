"""Compares the units of one type: each calibrated alone, then all together, what was held out looked at last."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import low_limit, on_axes, path_inside
from ema_model.errors import InputError, quoted
from ema_model.estimation import default_free
from ema_model.estimation.problem import SIGNALS
from ema_model.fleet.block import Block, Pair, Pool, pooled, starts_at, unit_of
from ema_model.fleet.block import linearised as linearised_at
from ema_model.fleet.fit import Fitted, Together, alike, fit, together
from ema_model.fleet.result import (
    MISFIT,
    REFUSED,
    REFUSED_SHARE,
    SLOPE,
    TOLD,
    UNTOLD,
    Alone,
    Difference,
    Need,
    OfRecording,
    OfType,
    Transfer,
    UnitsCompared,
)
from ema_model.quantities import HALF_90
from ema_model.recordings import Measurement, check_one_actuator
from ema_model.recordings.read import check_same_actuator, prepared
from ema_model.recordings.recording_set import check_held_out, recordings_in

# --- units as folders of recordings: which recording is of which unit, and whether all are of one type ----------------


def units_in(folder: Path) -> dict[str, list[Path]]:
    """The recordings of each folder in a folder, by its name; InputError where there are not two with any."""
    inner = sorted(one for one in folder.iterdir() if one.is_dir() and not one.name.startswith("."))
    found = {one.name: recordings_in(one) for one in inner}
    found = {name: files for name, files in found.items() if files}
    if not found:
        raise InputError(f"{quoted(folder.name)}: holds no folders of recordings, of which each would be a unit")
    return found


def check_same_type(files: Iterable[str | os.PathLike[str]]) -> None:
    """InputError for recordings whose side files name different actuators: units are of one type."""
    check_one_actuator(files, "units that are compared are of one type")


# --- the model of each unit on the recordings of each other one -------------------------------------------------------


def transfer(fits: Sequence[Fitted]) -> Transfer:
    """All models beside one unit's recordings are one population; the recordings start as their own unit's fit says."""
    count = len(fits)
    signal = next(name for name in SIGNALS if all(name in one.unit.model.windows[0].measured for one in fits))
    error, floors, floor = np.zeros((count, count)), np.zeros((count, count)), np.zeros(count)
    for place, one in enumerate(fits):
        problem = one.unit.problem
        problem.reweighted(one.unit.floors)
        at = np.repeat(one.calibration.x[None, :], count, axis=0)
        parameters = len(one.unit.parameters)
        at[:, :parameters] = [other.calibration.x[:parameters] for other in fits]
        residuals = problem.residuals(problem.clip(at))[:, : problem.values]
        floors[:, place] = one.over_floor(residuals)
        parts = [part for part in problem.parts() if part[1] == signal]
        size = [problem.over_sigma(i, name, np.ones(rows.stop - rows.start)) for i, name, rows in parts]
        squares = [np.sum((residuals[:, rows] / over) ** 2, axis=1) for (_, _, rows), over in zip(parts, size)]
        values = sum(len(over) for over in size)
        error[:, place] = np.sqrt(np.sum(squares, axis=0) / values)
        own = [one.floors[i].sigma(signal) ** 2 for i, _, _ in parts]
        floor[place] = np.sqrt(np.sum(np.concatenate(own)) / values)
    return Transfer(signal, error, floor, floors)


# --- compares the units of one type: each calibrated alone, then all together, what was held out looked at last -------

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_HELD = 7_000_000  # of seeds, from fitted to held-out recordings' twins
_OF_TYPE = "The sigma of each fitted parameter is 1 σ by which a further unit of the type may be off its value."
_BESIDE = 4  # units that do not differ, beside which those that do are held out


def compare_units(
    units: Mapping[str, Sequence[Measurement]],
    actuator: Actuator,
    *,
    holdout: Mapping[str, Sequence[Measurement]] | None = None,
    free: Sequence[str] | None = None,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> UnitsCompared:
    """The recordings of several units of one type, by the units' names.

    free: parameters that may differ, in place of those that the actuator's file leaves free; holdout: recordings of the
    units that are not fitted, by which differences are confirmed.  Raises InputError for one unit only, and for
    recordings that cannot be compared.
    """
    tell = on_progress or (lambda text: None)
    names = tuple(units)
    check_units(units, holdout)
    paths = default_free(actuator) if free is None else free
    paths = tuple(path_inside(path, actuator.tolerances, actuator.axes) for path in paths)
    if not paths:
        raise InputError(
            f"{actuator.name}: no parameter is free to differ; give one a tolerance in the actuator's file"
        )
    fits: list[Fitted] = []
    for number, (name, recordings) in enumerate(units.items()):
        tell(f"calibrating {name} ({number + 1} of {len(units)})")
        fits.append(fit(unit_of(name, [prepared(one, actuator) for one in recordings], actuator, paths), fits))
    found = together(fits, seed, tell)
    held = _held_blocks(holdout or {}, names, actuator, paths, found.pool, seed, tell)
    pool, dropped = _confirmed(found.pool, held, actuator, names, paths)
    sound = {i for i, paid in enumerate(found.disagreements) if all(one.is_allowed_for for one in paid)}
    told = [pair for pair in pool.pairs if pair[0] in sound and len(sound) > 1]
    tell("holding each model against each unit")
    moved = transfer(fits)
    of_type = _of_type(pool, actuator, paths)
    result = UnitsCompared(
        actuator=actuator,
        units=names,
        recordings=tuple(tuple(one.name for one in recordings) for recordings in units.values()),
        held_out=tuple(tuple(one.name for one in (holdout or {}).get(name, ())) for name in names),
        differences=tuple(_difference(pool, pair, actuator, names, paths, held) for pair in told),
        dropped=dropped,
        of_recordings=tuple(_of_recordings(found, units)),
        of_type=of_type,
        alone=_alone(pool, actuator, paths),
        transfer=moved,
        needs=tuple(_needs(found, names, paths, [[one.name for one in given] for given in units.values()])),
        errors=np.array([one.error for one in fits]),
        type_actuator=_type_actuator(actuator, of_type),
        warnings=tuple(_warnings(units, fits)),
    )
    return result


def check_units(
    units: Mapping[str, Sequence[Measurement]], holdout: Mapping[str, Sequence[Measurement]] | None = None
) -> None:
    """InputError for one unit only, one without a recording, and recordings that no comparison can take together."""
    if len(units) < 2:
        only = quoted(next(iter(units), ""), 60)
        raise InputError(f"one unit only ({only}): two or more are needed to compare; name others, or leave --by out")
    if empty := next((name for name, recordings in units.items() if not recordings), None):
        raise InputError(f"unit {quoted(empty, 60)}: no recording of it is left to fit; hold out fewer")
    fitted, held = ([one for recordings in of.values() for one in recordings] for of in (units, holdout or {}))
    check_same_actuator(fitted)
    check_held_out(fitted, held)


def _held_blocks(
    holdout: Mapping[str, Sequence[Measurement]],
    names: Sequence[str],
    actuator: Actuator,
    paths: tuple[str, ...],
    pool: Pool,
    seed: int,
    tell: Progress,
) -> dict[int, Block]:
    """Blocks of what was not fitted, at the answer, by the unit's place: of units that differ, and a few others."""
    differing = {unit for unit, _ in pool.pairs}
    given = [i for i, name in enumerate(names) if holdout.get(name)]
    wanted = [i for i in given if i in differing]
    wanted += [i for i in given if i not in differing][:_BESIDE] if wanted else []
    parts = {}
    for i in sorted(wanted):
        tell(f"holding what was found against what was not fitted of {names[i]}")
        unit = unit_of(names[i], [prepared(one, actuator) for one in holdout[names[i]]], actuator, paths)
        x = pool.unit(i)
        parts[i] = linearised_at(unit, x, seed + _HELD + i, 2, starts_at(unit, x))
    return dict(zip(parts, pooled(list(parts.values())))) if parts else {}


def _confirmed(
    pool: Pool, held: Mapping[int, Block], actuator: Actuator, names: Sequence[str], paths: tuple[str, ...]
) -> tuple[Pool, tuple[Difference, ...]]:
    """Without the differences that held-out recordings contradict, the most contradicted first."""
    dropped: list[Difference] = []
    while pool.pairs:
        told = {pair: _held_out(pool, pair, held) for pair in pool.pairs}
        spoken = {pair: value + REFUSED_SHARE * pool.loss(pair) for pair, value in told.items() if value is not None}
        worst = min(spoken, key=lambda pair: spoken[pair], default=None)
        if worst is None or spoken[worst] > -REFUSED:
            break
        dropped.append(_difference(pool, worst, actuator, names, paths, held))
        pool = pool.with_pairs([one for one in pool.pairs if one != worst])
    return pool, tuple(dropped)


def _held_out(pool: Pool, pair: Pair, held: Mapping[int, Block]) -> float | None:
    """By how much more the held-out recordings are missed where a pair is shared again."""
    if pair[0] not in held:
        return None
    without = pool.with_pairs([one for one in pool.pairs if one != pair])
    return _missed(held, without) - _missed(held, pool)


def _missed(held: Mapping[int, Block], pool: Pool) -> float:
    """How far held-out recordings are from a pool's units, in −2 log likelihood but for a constant.

    The model's bias in another command is common to all units: what they share is what suits them all best there.
    """
    information, pull, cost = np.zeros((pool.parameters, pool.parameters)), np.zeros(pool.parameters), 0.0
    for unit, block in held.items():
        x = pool.unit(unit)
        left = block.pull - block.information @ x
        information, pull = information + block.information, pull + left
        cost -= float(x @ (block.pull + left))
    if len(held) > 1:
        cost -= float(pull @ np.linalg.solve(information + np.eye(len(pull)), pull))
    return cost


def _difference(
    pool: Pool, pair: Pair, actuator: Actuator, names: Sequence[str], paths: Sequence[str], held: Mapping[int, Block]
) -> Difference:
    unit, place = pair
    sigma, shared = _in_unit(pool, place, actuator, paths)
    value, known = pool.difference(pair)
    change, half = sigma * value, HALF_90 * sigma * float(np.hypot(known, SLOPE * value))
    interval = (change - half, change + half)
    return Difference(
        unit=names[unit],
        parameter=paths[place],
        alike=tuple(paths[p] for p in alike(pool, pair)[1:]),
        change=change,
        change90=interval,
        share=change / abs(shared) if shared else None,
        share90=(interval[0] / abs(shared), interval[1] / abs(shared)) if shared else None,
        evidence=pool.loss(pair),
        held_out=_held_out(pool, pair, held),
    )


def _of_recordings(found: Together, units: Mapping[str, Sequence[Measurement]]) -> Iterator[OfRecording]:
    for (name, recordings), paid in zip(units.items(), found.disagreements):
        first = [one for one in paid if not one.is_allowed_for]  # beside them nothing else of the unit is known
        for one in first or paid:
            half = HALF_90 * one.sigma
            interval = (one.value - half, one.value + half)
            recording = recordings[one.of.recording].name
            yield OfRecording(name, recording, one.of.name, one.value, interval, one.of.unit, one.is_allowed_for)


def _in_unit(pool: Pool, place: int, actuator: Actuator, paths: Sequence[str]) -> tuple[float, float]:
    """A parameter's tolerance, and what the type shares, in its unit."""
    sigma = actuator.tolerances[paths[place]].sigma
    value = actuator.value(paths[place])
    return sigma, value + sigma * float(pool.shared[place]) if value else 0.0


def _of_type(pool: Pool, actuator: Actuator, paths: Sequence[str]) -> dict[str, OfType]:
    found = {}
    for place, path in enumerate(paths):
        sigma = actuator.tolerances[path].sigma
        mean = actuator.value(path) + sigma * float(pool.shared[place])
        low = _low(path, actuator)
        known = sigma * float(pool.shared_sigma[place])
        half = HALF_90 * known
        scatter = sigma * float(pool.tau[place])
        found[path] = OfType(
            mean=max(mean, low),
            mean90=(mean - half, mean + half),
            scatter=scatter,
            sigma=float(np.hypot(scatter, known)),
            unit=on_axes(path, actuator.axes).unit,
            told=bool(known < UNTOLD * sigma),
        )
    return found


def _alone(pool: Pool, actuator: Actuator, paths: Sequence[str]) -> dict[str, Alone]:
    """Of each unit what its own block says, as far as units of the type are about what they share: the tolerances."""
    values, sigmas = [], []
    for block in pool.blocks:
        covariance = np.linalg.inv(block.information + np.eye(pool.parameters))
        values.append(pool.shared + covariance @ (block.pull - block.information @ pool.shared))
        sigmas.append(np.sqrt(np.diag(covariance)))
    tolerance = [actuator.tolerances[path].sigma for path in paths]
    value = np.array([actuator.value(path) for path in paths]) + np.array(values) * tolerance
    value = np.maximum(value, [_low(path, actuator) for path in paths])  # as the type's mean
    return {path: Alone(value[:, i], np.array(sigmas)[:, i] * tolerance[i]) for i, path in enumerate(paths)}


def _low(path: str, actuator: Actuator) -> float:
    """What a parameter cannot be below."""
    return -np.inf if path.startswith("effects.") else low_limit(path, actuator.has_one_clock)


def _type_actuator(actuator: Actuator, of_type: Mapping[str, OfType]) -> Actuator:
    """With the type's means as values, and as tolerances how far a further unit may be from them."""
    told = {path: one for path, one in of_type.items() if one.told}
    sigmas = {path: one.sigma for path, one in told.items() if one.mean > _low(path, actuator)}
    tolerances = {path: replace(one, sigma=sigmas.get(path, one.sigma)) for path, one in actuator.tolerances.items()}
    fitted = actuator.with_values({path: one.mean for path, one in told.items()})
    return replace(fitted, tolerances=tolerances, note=_OF_TYPE if sigmas else actuator.note)


def _needs(
    found: Together, names: Sequence[str], paths: Sequence[str], recordings: Sequence[Sequence[str]]
) -> list[Need]:
    """What the prior alone tells of a unit, with the recording of another that tells it there."""
    left = np.array([1.0 / np.sqrt(1.0 + np.diag(one.information)) for one in found.pool.blocks])
    needs = []
    for place, path in enumerate(paths):
        best = int(np.argmin(left[:, place]))
        told_by = ""
        if left[best, place] < TOLD:
            told_by = recordings[best][int(np.argmax(found.parts[best].by_recording[:, place]))]
        untold = [i for i in range(len(names)) if left[i, place] > UNTOLD]
        needs += [Need(names[i], path, told_by) for i in untold if told_by or len(untold) == len(names)]
    return needs


def _warnings(units: Mapping[str, Sequence[Measurement]], fits: Sequence[Fitted]) -> list[str]:
    found = []
    if all(len(recordings) == 1 for recordings in units.values()):
        found.append(
            "each unit has one recording: whether a difference is the unit's, or of the day, the load or the sensors "
            "in that recording, cannot be known; record each unit twice"
        )
    missing = [one for one in fits if one.error > MISFIT]
    if missing:
        worst = max(missing, key=lambda one: one.error)
        found.append(
            f"the models leave up to {worst.error:.1f} × the floor ({worst.unit.name}): physics is missing, and "
            "differences are judged by what is left; Discover looks for it"
        )
    loose = [one.unit.name for one in fits if not one.calibration.converged]
    if loose:
        found.append(f"the calibration of {', '.join(loose)} has not converged: what is said of it may be off")
    return found
