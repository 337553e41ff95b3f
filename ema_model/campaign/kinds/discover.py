"""Discoveries of hidden effects, and whether anyone could see them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model.actuator import Actuator
from ema_model.campaign.kinds.kind import FLAG, NUMBER, NUMBERS, TEXT, TEXTS, Kind
from ema_model.campaign.plan_axes import TaskInputs
from ema_model.comparison.compare import weights_of
from ema_model.comparison.criteria import BAND
from ema_model.discovery import discover
from ema_model.errors import InputError, quoted
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import fit, gather
from ema_model.recordings import Measurement, prepared

# --- how much hidden effects change recordings beyond what the tolerances can: whether anyone could see them ----------


def showable(
    recordings: Sequence[Measurement],
    actuator: Actuator,
    effects: Mapping[str, Mapping[str, float]],
    signals: Sequence[str] | None = None,
) -> float:
    """Expected fall of χ² at the effects' true settings."""
    data = gather([prepared(one, actuator) for one in recordings], actuator, weights_of(signals, actuator), None)
    data = data.beside(fit(data, actuator))
    base = fit(data, actuator)
    x = base.calibration.x
    with_them = data.plant(replace(actuator, effects={name: dict(given) for name, given in effects.items()}))
    problem = problem_of(with_them, data.floors, signals=data.signals)
    change = problem.residuals(x[None, :])[0, : problem.values] - base.residual
    columns = base.calibration.weighted_jacobian
    own = change - columns @ np.linalg.solve(columns.T @ columns + np.eye(len(x)), columns.T @ change)
    return float(change @ own)


# --- which effects are missing: the verdict, what was added, the error ladder -----------------------------------------

_LARGEST_GROUP = 3  # of effects that cannot be told apart, with which a name is still an answer
_SIGNALS = {"all": None, "current": ["current_A"]}


@dataclass(frozen=True)
class Settings:
    """As `emaviz discover` has them."""

    signals: str = "all"
    most_effects: int = 100
    showable_from: float = 0.0  # of χ²: hidden effects that change the recordings by less are not looked for

    def __post_init__(self) -> None:
        if self.signals not in _SIGNALS:
            raise InputError(f"no signals {quoted(self.signals)!r}; there are {', '.join(_SIGNALS)}")
        if not 0 <= self.most_effects <= 100:
            raise InputError(f"most_effects is a whole number from 0 to 100, not {self.most_effects}")


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    signals = _SIGNALS[settings.signals]
    asked: dict[str, Any] = {"signals": settings.signals, "showable": None}
    if settings.showable_from > 0.0 and inputs.effects:
        asked["showable"] = showable(inputs.fitted, inputs.actuator, inputs.effects, signals)
        if asked["showable"] < settings.showable_from:
            return asked
    found = discover(
        inputs.fitted,
        inputs.actuator,
        holdout=inputs.held,
        signals=signals,
        most_effects=settings.most_effects,
    ).to_dict()
    ladder, faults, experiment = found["ladder"], found["faults"], found["next_experiment"]
    unknown, calibrated = found["unknown"], found["calibration"]["parameters"]
    return asked | {
        "verdict": found["verdict"],
        "effects": [one["name"] for one in found["effects"]],
        "same_as": ["+".join(one["same_as"]) for one in found["effects"]],
        "parameters": json.dumps(
            {one["name"]: {name: p["value"] for name, p in one["parameters"].items()} for one in found["effects"]}
        ),
        "outside": found["parameters_outside_tolerance"],
        "at_bound": [name for name, one in calibrated.items() if one["at_bound"]],
        "calibrated": json.dumps(
            {name: [one["value"], *(one["interval90"] or (None, None))] for name, one in calibrated.items()}
        ),
        "controller_mismatch": found["controller_mismatch"],
        "transmission": None if found["transmission_seen"] is None else found["transmission_seen"]["cause"],
        "unknown": None if unknown is None else f"{unknown['variable']} × {unknown['modulator']}",
        "rungs": [rung["label"] for rung in ladder],
        "ladder": [rung["rmse"] for rung in ladder],
        "floor_band": found["floor_band"],
        "holdout_ladder": [rung["holdout_rmse"] for rung in ladder],
        "faults": list(faults),
        "fault_values": [one["value"] for one in faults.values()],
        "warnings": found["warnings"],
        "next_experiment": None if experiment is None else json.dumps(experiment, sort_keys=True),
    }


def tally(row: dict[str, Any]) -> Counter[str]:
    """What one discovery of hidden effects got right; what cannot be told from an effect counts as it, in groups."""
    hidden = set(row["hidden"])
    named = [{name, *filter(None, same.split("+"))} for name, same in zip(row["effects"], row["same_as"])]
    right = bool(named) and bool(named[0] & hidden) and len(named[0]) <= _LARGEST_GROUP
    covered = [group & hidden for group in named]
    exact = all(covered) and set().union(*covered) >= hidden and len(named) == len(hidden)
    ends = [ladder[-1] for ladder in (row["ladder"], row["holdout_ladder"]) if ladder and ladder[-1] is not None]
    counts = {
        "first": right,
        "exact": exact,
        "wrong": bool(named) and not right and len(named[0]) == 1,
        "abstained": not named,
        "floor": exact and max(ends, default=0.0) <= BAND,
    }
    return Counter({name: int(one) for name, one in counts.items()})


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    shown = [row for row in rows if row["verdict"] is not None]
    told: dict[str, Any] = {"showable": len(shown)}
    if any(row["hidden"] for row in rows):
        counts = sum((tally(row) for row in shown if row["hidden"]), Counter())
        told |= {
            "right one first": counts["first"],
            "exactly": counts["exact"],
            "wrong, sure": counts["wrong"],
            "abstained": counts["abstained"],
            "exactly, and at the floor": counts["floor"],
        }
    verdicts = Counter(row["verdict"] for row in shown)
    return told | {"verdicts": ", ".join(f"{verdict} {count}" for verdict, count in verdicts.most_common())}


KIND = Kind(
    title="Discovery",
    settings=Settings,
    columns=pa.schema(
        [
            ("signals", TEXT),
            ("showable", NUMBER),  # expected fall of χ²; null where it was not asked for
            ("verdict", TEXT),  # null where the effects cannot be seen
            ("effects", TEXTS),
            ("same_as", TEXTS),  # of each effect, the names that cannot be told from it, joined by +
            ("parameters", TEXT),  # of the effects, as JSON: their values by name
            ("outside", TEXTS),
            ("at_bound", TEXTS),  # calibrated parameters
            ("calibrated", TEXT),  # parameters of the last model as JSON: value and 90 % interval by name
            ("controller_mismatch", FLAG),
            ("transmission", TEXT),  # what the user's position leaves the motor's by; null where it does not
            ("unknown", TEXT),  # what the rest goes with: variable × modulator
            ("rungs", TEXTS),
            ("ladder", NUMBERS),  # in units of the floor
            ("floor_band", NUMBERS),  # between which nine of ten true models end
            ("holdout_ladder", NUMBERS),
            ("faults", TEXTS),
            ("fault_values", NUMBERS),
            ("warnings", TEXTS),
            ("next_experiment", TEXT),
        ]
    ),
    run=_run,
    seconds=lambda settings: 12.0,
    told=_told,
)
