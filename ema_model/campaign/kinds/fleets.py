"""Fleets that are made: whether what differs between units is found, all of it and nothing else.

A difference counts as found where the unit is right and the parameters that are named for it are among those that its
recordings tell only together; of two units, either may be said to differ.  The set is exact where each is found and
nothing else is said.
"""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model.actuator import Actuator
from ema_model.campaign.kinds.kind import FLAG, NUMBER, TEXTS, Kind
from ema_model.campaign.plan_axes import TaskInputs
from ema_model.errors import InputError
from ema_model.fleet.compare import compare_units
from ema_model.fleet.result import Difference, UnitsCompared
from ema_model.recordings import Measurement
from ema_model.simulated_fleets import RUNS, UNSEEN, Fleet, draw, recorded


@dataclass(frozen=True)
class Settings:
    """Which fleets; what is 0 or −1 is drawn."""

    units: int = 0
    differing: int = -1  # parameters; drawn from 1 to 3
    size: float = 5.0  # of the differences, σ of what a unit's recordings tell
    spread: float = 0.0  # of a tolerance, by which all units scatter
    without_step: bool = False  # the recording that tells most parameters apart
    holdout: bool = True

    def __post_init__(self) -> None:
        if not (self.units == 0 or 2 <= self.units <= 20) or not -1 <= self.differing <= 3:
            raise InputError("units are from 2 to 20, or 0 to be drawn; differing from 0 to 3, or -1 to be drawn")


def fleet_of(settings: Settings, actuator: Actuator, seed: int) -> Fleet:
    """The fleet of a task."""
    return draw(
        actuator,
        seed,
        units=settings.units or None,
        differing=None if settings.differing < 0 else settings.differing,
        size=settings.size,
        spread=settings.spread,
        runs=tuple(name for name in RUNS if not (settings.without_step and name == "step")),
    )


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    fleet = fleet_of(settings, inputs.actuator, seed)
    unseen = tuple(UNSEEN) if settings.holdout else ()
    fitted: dict[str, list[Measurement]] = {}
    held: dict[str, list[Measurement]] = {}
    for number, name in enumerate(fleet.names):
        every = recorded(fleet.unit(number), seed, number, (*fleet.runs, *unseen))
        fitted[name] = [every[run] for run in fleet.runs]
        held[name] = [every[run] for run in unseen]
    begun = perf_counter()
    found = compare_units(fitted, inputs.actuator, holdout=held, seed=seed)
    return scored(fleet, found) | {"answer_s": perf_counter() - begun}


def scored(fleet: Fleet, found: UnitsCompared) -> dict[str, Any]:
    """What was found beside the truth."""
    left = list(found.differences)
    met: list[tuple[Difference, float]] = []  # with the true change, in the parameter's unit
    missed = []
    for one in fleet.differences:
        for unit in one.units:
            change = one.change * fleet.actuator.tolerances[one.parameter].sigma
            match = next((d for d in left if _is_met(d, fleet, unit, one.parameter, one.together)), None)
            if match is None:
                missed.append(f"{fleet.names[unit]} {one.parameter}")
            else:
                left.remove(match)
                met.append((match, change if match.unit == fleet.names[unit] else -change))
    own = [(one, change) for one, change in met if one.parameter in _parameters(fleet)]
    return {
        "units": float(len(fleet.names)),
        "true": float(len(met) + len(missed)),
        "found": float(len(met)),
        "exact": not missed and not left,
        "claimed": bool(found.differences),
        "scatter": [*found.scattering],
        "missed": missed,
        "false": [f"{one.unit} {'+'.join(one.together)}" for one in left],
        "contradicted": [f"{one.unit} {one.parameter}" for one in found.dropped],
        "covered": float(sum(one.change90[0] <= change <= one.change90[1] for one, change in own)),
        "counted": float(len(own)),
        "right_sign": float(sum(one.change * change > 0.0 for one, change in own)),
    }


def _parameters(fleet: Fleet) -> set[str]:
    return {one.parameter for one in fleet.differences}


def _is_met(found: Difference, fleet: Fleet, unit: int, parameter: str, together: tuple[str, ...]) -> bool:
    right = found.unit == fleet.names[unit] or len(fleet.names) == 2
    return right and parameter in found.together and set(found.together) <= {parameter, *together}


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    counted = sum(row["counted"] for row in rows)
    true = sum(row["true"] for row in rows)
    told: dict[str, Any] = {
        "exact set": f"{sum(row['exact'] for row in rows)} of {len(rows)}",
        "fleets with a false claim": sum(bool(row["false"]) for row in rows),
        "fleets said to scatter": sum(bool(row["scatter"]) for row in rows),
    }
    if not true:
        return told
    return told | {
        "differences found": f"{sum(row['found'] for row in rows):g} of {true:g}",
        "90 % interval holds it, %": f"{100.0 * sum(row['covered'] for row in rows) / max(counted, 1.0):.1f}",
        "right sign": f"{sum(row['right_sign'] for row in rows):g} of {counted:g}",
        "dropped by held-out recordings": sum(len(row["contradicted"]) for row in rows),
        "units, median": f"{np.median([row['units'] for row in rows]):g}",
    }


KIND = Kind(
    title="Fleets",
    settings=Settings,
    columns=pa.schema(
        [
            ("units", NUMBER),
            ("true", NUMBER),  # differences, a unit each
            ("found", NUMBER),
            ("exact", FLAG),
            ("claimed", FLAG),
            ("scatter", TEXTS),  # parameters in which all units are said to scatter
            ("missed", TEXTS),
            ("false", TEXTS),
            ("contradicted", TEXTS),
            ("covered", NUMBER),  # of those counted, by the interval
            ("counted", NUMBER),  # found under the parameter's own name
            ("right_sign", NUMBER),
        ]
    ),
    run=_run,
    seconds=lambda settings: 1.0 + 1.6 * (settings.units or 11),
    told=_told,
    from_recordings=False,
)
