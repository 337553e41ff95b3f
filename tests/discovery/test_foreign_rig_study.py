"""The study of discovery on rigs that nobody here wrote: right, or honestly silent.

    pytest -m study -s tests/discovery/test_foreign_rig_study.py

Needs the simulator of ../shared/rig (EMAVIZ_RIG names another folder).  Resumable like the other studies, by
EMAVIZ_STUDY.  EMAVIZ_STUDY_UNITS says which units: 1-3, or 21-23, at which nobody looked while the method was made;
without it, two of a rig's effects in one unit alone, the quick form.  The list was fixed before the method was changed.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from support.foreign_rig import Case, recorded

from ema_model.discovery import Discovery, discover

pytestmark = pytest.mark.study

FOLDER = Path(os.environ.get("EMAVIZ_STUDY") or tempfile.mkdtemp(prefix="emaviz-study-"))
FIRST, LAST = (int(part) for part in os.environ.get("EMAVIZ_STUDY_UNITS", "1-1").split("-"))
UNITS, MOST = range(FIRST, LAST + 1), 9 if "EMAVIZ_STUDY_UNITS" in os.environ else 2
LONGEST_S = 100.0  # of processor time: what takes longer gives no answer
BAND = 1.25  # times the floor, above which nothing is adequate: half way between what is and what is not to be seen
SHOWABLE = 3.0  # `change_over_floor`
OWN_DELAY_SAMPLES = 2.0  # of the drive: a delay up to so many is its own, and no wrong answer
CLEAN = [
    *(("gearservo", ()), ("ballscrew", ()), ("hobby", ())),
    *(("gearservo", ("--proportional",)), ("ballscrew", ("--proportional",))),
]
HIDDEN = {
    "gearservo": ("cogging", "spring", "asymmetric", "compliance", "saturation"),
    "ballscrew": ("load_friction", "lead_error", "constant", "stribeck", "screw_friction"),
    "hobby": ("spring", "asymmetric", "stribeck", "delay", "warmup"),
}
COLUMNS = ("right", "in group", "silent", "hardly showable", "false", "adequate above", "contradicts", "at bound",
           "no answer", "over 60 s")  # fmt: skip


class TooLong(Exception):
    """The answer is not waited for."""


def answer(case: Case, store: Path) -> dict[str, Any]:
    """What discovery says of a case, from an earlier run if there is one."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = FOLDER / "foreign.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    known = next((one for one in map(json.loads, lines) if one["key"] == case.key), None)
    if known is None:
        known = {"key": case.key, **computed(case, store)}
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(known) + "\n")
    return known


def computed(case: Case, store: Path) -> dict[str, Any]:
    run = recorded(case, store)
    started = time.process_time()

    def impatient(text: str) -> None:
        if time.process_time() - started > LONGEST_S:
            raise TooLong(text)

    hidden = {
        name: {"right": one["right"], "over_floor": max(one["change_over_floor"].values())}
        for name, one in run.truth["hidden"].items()
    }
    told: dict[str, Any] = {"hidden": hidden, "drive_rate": run.truth["drive"]["rate"]}
    try:
        found = discover(run.fitted, run.actuator, holdout=run.held, on_progress=impatient)
        told |= said(found)
    except TooLong as stopped:
        told |= {"verdict": None, "stopped": str(stopped)}
    return told | {"seconds": time.process_time() - started}


def said(found: Discovery) -> dict[str, Any]:
    unknown = found.unknown
    return {
        "verdict": found.verdict,
        "effects": [one.name for one in found.effects],
        "same_as": [list(one.same_as) for one in found.effects],
        "parameters": [{name: p.value for name, p in one.parameters.items()} | one.chosen for one in found.effects],
        "at_bound": [name for name, one in found.calibration.parameters.items() if one.at_bound],
        "outside": list(found.parameters_outside_tolerance),
        "unknown": None if unknown is None else [unknown.variable, unknown.modulator, unknown.r2],
        "curve": found.curve is not None,
        "ladder": [[rung.label, rung.rmse, rung.holdout_rmse] for rung in found.ladder],
        "not_claimed": dict(getattr(found, "not_claimed", {})),
        "warnings": list(found.warnings),
    }


def tally(told: dict[str, Any]) -> Counter[str]:
    """Counts of one answer."""
    if told["verdict"] is None:
        return Counter({"cases": 1, "no answer": 1, "over 60 s": 1})
    clear = [one for one in told["hidden"].values() if one["over_floor"] > 1.0]
    right = {name for one in clear for name in one["right"]}
    faint = bool(told["hidden"]) and max(one["over_floor"] for one in told["hidden"].values()) < SHOWABLE
    groups = [{name, *same} for name, same in zip(told["effects"], told["same_as"])]
    parameters = set(told["outside"])
    of_parameters = {"viscous_friction": "viscous", "inertia_error": "inertia", "demagnetisation": "torque_constant"}
    as_parameter = any(part in path for name in right for key, part in of_parameters.items() if key == name
                       for path in parameters)  # fmt: skip
    wrong = [group for group, values in zip(groups, told["parameters"]) if not group & right
             and not _is_the_drives(group, values, told["drive_rate"])]  # fmt: skip
    first = groups[0] if groups else set()
    rmse = told["ladder"][-1][1]
    sure = told["verdict"] in ("adequate", "effects_found")
    silent = not groups and told["verdict"] != "adequate"
    curve = bool(right & {"curve", "unknown"}) and silent and bool(told["unknown"])
    return Counter(
        {
            "cases": 1,
            "right": int(
                (bool(told["effects"]) and told["effects"][0] in right and not wrong) or as_parameter or curve
            ),
            "in group": int(bool(first & right) and told["effects"][0] not in right and not wrong),
            "silent": int(silent and not faint and not curve and not as_parameter),
            "hardly showable": int(faint and not groups),
            "false": int(bool(wrong)),
            "adequate above": int(told["verdict"] == "adequate" and rmse > BAND),
            "contradicts": int(sure and rmse > BAND),
            "at bound": int(bool(told["at_bound"])),
            "over 60 s": int(told["seconds"] > 60.0),
        }
    )


def _is_the_drives(group: set[str], values: dict[str, float], rate: float) -> bool:
    return "position_sensor_delay" in group and values.get("delay_s", 0.0) <= OWN_DELAY_SAMPLES / rate


def shown(told: dict[str, Any]) -> str:
    if told["verdict"] is None:
        return f"{told['key']:42} no answer in {told['seconds']:.0f} s: {told['stopped']}"
    ladder = " → ".join(f"{rmse:.3g}" for _, rmse, _ in told["ladder"])
    names = ", ".join("≡".join([name, *same]) for name, same in zip(told["effects"], told["same_as"]))
    bound = f" | at bound {', '.join(told['at_bound'])}" if told["at_bound"] else ""
    goes = "" if told["unknown"] is None else f" | goes with {'×'.join(told['unknown'][:2])}"
    return f"{told['key']:42} {told['verdict']:16} {names or '-'} | {ladder}{goes}{bound} ({told['seconds']:.0f} s)"


def counted(title: str, cases: list[Case], store: Path) -> Counter[str]:
    print(f"\n{title}")
    total: Counter[str] = Counter()
    for case in cases:
        told = answer(case, store)
        total += tally(told)
        print("  " + shown(told), flush=True)
    print(f"{title}: " + ", ".join(f"{column} {total[column]}" for column in COLUMNS) + f" of {total['cases']}")
    return total


def test_nothing_hidden_names_nothing(tmp_path):
    cases = [Case(rig, unit, options=options) for unit in UNITS for rig, options in CLEAN]
    cases += [Case("gearservo", unit, fitted=("chirp",), held=()) for unit in UNITS]
    total = counted("clean", cases, tmp_path)
    assert total["false"] <= 0.05 * total["cases"] and total["at bound"] <= 0.05 * total["cases"]
    assert not total["adequate above"] and not total["contradicts"] and not total["over 60 s"]


def test_hidden_effects_are_named_or_not_claimed(tmp_path):
    cases = [Case(rig, unit, ((name, 1.0),)) for unit in UNITS for rig, names in HIDDEN.items()
             for name in names[:MOST]]  # fmt: skip
    total = counted("one effect", cases, tmp_path)
    assert total["false"] <= 0.1 * total["cases"]
    assert not total["adequate above"] and not total["contradicts"] and not total["over 60 s"]


def test_a_mess_of_small_everything_names_nothing_that_is_not_there(tmp_path):
    cases = [Case(rig, unit, options=("--real",)) for unit in UNITS for rig in list(HIDDEN)[:MOST]]
    total = counted("a real mess", cases, tmp_path)
    assert total["false"] <= 0.1 * total["cases"]
    assert not total["adequate above"] and not total["contradicts"] and not total["over 60 s"]
