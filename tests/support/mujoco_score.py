"""What is said of a plant of MuJoCo, beside what is true of it (tests/benchmarks/mujoco_plants.py writes both)."""

from __future__ import annotations

import json
import time
import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import ema_model as em
from ema_model.actuator import Actuator
from ema_model.comparison.result import Comparison
from ema_model.comparison.thresholds import BAND
from ema_model.discovery import Discovery
from ema_model.discovery.thresholds import LARGEST_GROUP

COLUMNS = ("showable", "right", "exact", "part", "wrong", "silent", "unknown with its variable", "hardly showable")
# What the two positions show by themselves, by what it goes with.
_BEYOND_THE_MOTOR = {"acceleration": "torsional_compliance", "direction": "backlash"}
_AS_PARAMETER = ("dry_friction", "inertia_error", "backlash")  # which the file has a parameter for


def truth_of(folder: Path) -> dict[str, Any]:
    """What the plant was simulated with."""
    return json.loads((folder / "truth.json").read_text(encoding="utf-8"))


def row_of(folder: Path) -> dict[str, Any]:
    """The answer to a plant's files; `error` where there is none."""
    began, used = time.monotonic(), time.process_time()
    row: dict[str, Any] = {"name": folder.name, "error": ""}
    try:
        actuator = em.load_actuator(folder / "base.toml")
        fitted, held = ([folder / f"{name}.csv" for name in names] for names in (("fit_1", "fit_2"), ("held",)))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            row |= _said(em.discover(fitted, actuator, holdout=held))
    except em.InputError as error:
        row["error"] = str(error)
    return row | {"seconds": time.monotonic() - began, "processor_s": time.process_time() - used}


def _said(found: Discovery) -> dict[str, Any]:
    effects = {one.name: one for one in [*found.effects, *found.freed]}
    known = dict(found.calibration.parameters)
    known |= {f"{one.name}.{name}": value for one in effects.values() for name, value in one.parameters.items()}
    masses = found.two_masses_seen is not None
    return {
        "verdict": found.verdict,
        "claims": [
            {
                "name": one.name,
                "same_as": [*one.same_as],
                "stands_for": one.stands_for,
                "probability": one.probability,
                "values": {name: value.value for name, value in one.parameters.items()},
            }
            for one in effects.values()
        ],
        "faults": {name: one.value for name, one in found.faults.items()},
        "outside": [*found.parameters_outside_tolerance],
        "shaft": "torsional_compliance" if masses else getattr(found.transmission_seen, "cause", ""),
        "unknown": "" if found.unknown is None else f"{found.unknown.variable} × {found.unknown.modulator}",
        "mismatch": found.controller_seen is not None or found.loop_lag is not None,
        "ladder": [[*map(str, rung.change.names), rung.rmse, rung.holdout_rmse] for rung in found.ladder],
        "intervals": {name: [value.value, *value.interval90] for name, value in known.items()},
        "said": str(found).splitlines()[:6],
    }


def tally(row: Mapping[str, Any], truth: Mapping[str, Any]) -> Counter[str]:
    """Counts of one answer.

    right: what comes first is hidden, or in one group of three at most with what is, or a parameter outside its
    tolerance says it, and nothing that is not hidden is named; exact: so is all that is showable; wrong: something is
    named, with the probability that a name asks for, that is not hidden.  Of what the library does not hold no name is
    right.
    """
    hidden = truth["hidden"]
    held = {name: one for name, one in hidden.items() if one["in_library"]}
    shown = [name for name, one in held.items() if one["showable"]]
    groups = [(one, {one["name"], *one["same_as"]}) for one in row["claims"]]
    groups += [({"name": name, "stands_for": ""}, {name}) for name in row["faults"] if name != "k7"]

    def covers(claim: Mapping[str, Any], group: set[str], name: str) -> bool:
        one = held[name]
        return bool(group & {*one["right"]}) or any(part in claim["stands_for"] for part in one["outside"])

    def says(name: str) -> bool:
        return (
            any(covers(*one, name) for one in groups)
            or any(part in path for part in held[name]["outside"] for path in row["outside"])
            or _BEYOND_THE_MOTOR.get(row["shaft"], row["shaft"]) == name
        )

    wrong = [claim["name"] for claim, group in groups if not any(covers(claim, group, name) for name in held)]
    first = bool(groups) and len(groups[0][1]) <= LARGEST_GROUP and any(covers(*groups[0], name) for name in held)
    told = [name for name in held if says(name)]
    right = bool(shown) and not wrong and (first or (not groups and bool(told)))
    strange = len(held) < len(hidden) and not held
    clean = not hidden
    return Counter(
        {
            "cases": 1,
            "showable": int(bool(shown)),
            "right": int(right),
            "exact": int(right and set(told) >= set(shown)),
            "part": int(right and not set(told) >= set(shown)),
            "wrong": int(bool(wrong)),
            "silent": int(bool(shown) and not wrong and not right and not row["unknown"]),
            "unknown with its variable": int(bool(shown) and not wrong and not right and bool(row["unknown"])),
            "hardly showable": int(bool(held) and not shown),
            "clean": int(clean),
            "clean adequate": int(clean and row["verdict"] == "adequate" and not groups),
            "outside the library": int(strange),
            "outside, no name": int(strange and not wrong and row["verdict"] != "adequate"),
        }
    )


def covered(row: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, bool]:
    """Whether each told 90 % interval of a known value holds it; none of a model that leaves more than a true one.

    What is known of dry friction is all of it, which stands in two values where an effect tells a part.
    """
    ends = row["ladder"][-1][-2] if row.get("ladder") else None
    if ends is None or ends > BAND or row["unknown"]:
        return {}
    true = dict(truth["parameters"])
    named = {one["name"] for one in row["claims"]}
    for name in named & {*truth["hidden"]}:
        true |= {f"{name}.{key}": value for key, value in truth["hidden"][name]["values"].items()}
    if "dry_friction" in named:
        del true["motor.dynamic_friction_Nm"]
    return {
        path: row["intervals"][path][1] <= value <= row["intervals"][path][2]
        for path, value in true.items()
        if path in row["intervals"] and None not in row["intervals"][path]
    }


def line(row: Mapping[str, Any], truth: Mapping[str, Any]) -> str:
    """The answer in a line."""
    shows = (f"{n}{'' if one['showable'] else '(faint)'}" for n, one in truth["hidden"].items())
    is_true = f"{row['name']} {truth['kind']:12} hidden {'+'.join(shows) or '-'}"
    if row["error"]:
        return f"{is_true} | REFUSED {row['error']}"
    counts = tally(row, truth)
    marks = [
        name for name in ("wrong", "exact", "part", "silent", "clean adequate", "outside, no name") if counts[name]
    ]
    said = [
        "≡".join([one["name"], *one["same_as"]]) + (f" {one['probability']:.4f}" if one["probability"] else "")
        for one in row["claims"]
    ]
    said += [f"{name}={value:.2g}" for name, value in row["faults"].items()]
    steps = " → ".join("?" if one[-2] is None else f"{one[-2]:.3g}" for one in row["ladder"])
    held = row["ladder"][-1][-1]
    beside = [f"outside {', '.join(row['outside'])}"] if row["outside"] else []
    beside += [f"goes with {row['unknown']}"] if row["unknown"] else []
    beside += [f"shaft: {row['shaft']}"] if row["shaft"] else []
    beside += ["not the file's controller"] if row["mismatch"] else []
    return (
        f"{is_true} | {'/'.join(marks) or 'other'} | {row['verdict']} | {', '.join(said) or '-'} | {steps}; held out "
        f"{'?' if held is None else f'{held:.3g}'} | {'; '.join(beside) or '-'} | {row['seconds']:.0f} s, "
        f"{row['processor_s']:.0f} s of processor"
    )


def true_model(folder: Path) -> tuple[Actuator, dict[str, dict[str, float]]]:
    """The owner's model with its true values, and the hidden effects with theirs."""
    truth = truth_of(folder)
    hidden = {name: one["values"] for name, one in truth["hidden"].items()}
    values = dict(truth["parameters"])
    if "backlash" in hidden:
        values["transmission.backlash_rad"] = hidden["backlash"]["width_rad"]
    effects = {name: one for name, one in hidden.items() if name not in _AS_PARAMETER or name == "inertia_error"}
    return em.load_actuator(folder / "base.toml").with_values(values), effects


def compared(folder: Path) -> Comparison:
    """The true model beside the plant's recordings, its parameters calibrated from their true values."""
    actuator, effects = true_model(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return em.compare(
            [folder / "fit_1.csv", folder / "fit_2.csv"],
            actuator,
            effects=effects or None,
            holdout=[folder / "held.csv"],
        )
