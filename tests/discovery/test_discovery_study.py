"""The studies of discovery: what is named, for every effect of the library, and what is not there.

    pytest -m study -s tests/discovery/test_discovery_study.py

Their rows are those of the plans `discovery`, `current_only`, `further_physics`, `two_effects` and `outside`; see
support/studied.py for where they are kept, and for the quick forms.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections import Counter
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded
from support.studied import studied

from ema_model.campaign.kinds import tally
from ema_model.campaign.task import NEEDS_LOAD, effect_of
from ema_model.discovery import discover
from ema_model.effects import CATALOGUE

pytestmark = pytest.mark.study

FLOOR = 1.0


def counts(rows: list[dict[str, Any]]) -> Counter[str]:
    """What discoveries of what can be seen got right."""
    shown = [row for row in rows if row["verdict"] is not None]
    return sum((tally(row) for row in shown), Counter(showable=len(shown)))


def test_nothing_hidden_is_adequate():
    rows = studied("discovery")["nothing_hidden"]
    assert sum(row["verdict"] == "adequate" for row in rows) >= 0.99 * len(rows)


@pytest.mark.parametrize("plan", ["discovery", "current_only"])
def test_each_effect_is_named(plan):
    total = counts(studied(plan)["named"])
    assert total["first"] >= 0.95 * total["showable"]
    assert total["exact"] >= 0.90 * total["showable"]
    assert total["wrong"] <= 0.02 * total["showable"]
    assert total["floor"] >= total["exact"]


@pytest.mark.parametrize("group", ["drive", "sensors", "actuator"])
def test_further_physics_is_named_or_told_as_unknown(group):
    """Of the drive, of sensors, of friction by place and time: a name, or none and the variable that it goes with."""
    shown = [row for row in studied("further_physics")[group] if row["verdict"] is not None]
    total = sum((tally(row) for row in shown), Counter())
    open_ones = sum(not row["effects"] and bool(row["unknown"]) for row in shown)
    outside = sum(not row["effects"] and bool(row["outside"]) for row in shown)
    assert total["first"] + open_ones + outside >= 0.9 * len(shown)
    assert total["wrong"] <= 0.01 * len(shown)


def test_two_effects():
    """Pairs drawn at random, both clear or strong."""
    total = counts(studied("two_effects")["two"])
    assert total["first"] >= 0.95 * total["showable"]
    assert total["exact"] >= 0.80 * total["showable"]


@pytest.mark.parametrize("law", ["sqrt", "sine_cubed"])
def test_outside_the_library(law):
    """Friction ∝ √|ω|, a torque ∝ sin³θ: unknown, and a curve brings what was held out to the floor."""
    unknown, falls = 0, []
    print(f"\n{law}: case, seed, verdict, held out before and after, fall of the excess over the floor")
    for row in studied("outside")[law]:
        before, after = row["holdout_ladder"][0], row["holdout_ladder"][-1]
        if before < 1.2:  # hardly above the floor: nothing that a curve could mend
            continue
        unknown += row["verdict"] == "unknown_effect"
        falls.append((before - after) / (before - FLOOR))
        told = f"{row['verdict']:15}{before:8.2f}{after:8.2f}{100.0 * falls[-1]:8.0f} %"
        print(f"  {row['case']} {row['seed']} {told}")
    print(f"  unknown_effect in {unknown} of {len(falls)}; excess down by {100.0 * np.median(falls):.0f} % (median)")
    assert unknown >= 0.9 * len(falls)
    assert np.median(falls) >= 0.8


FOLDER = Path(os.environ.get("EMAVIZ_STUDY") or tempfile.mkdtemp(prefix="emaviz-study-"))
SEEDS = range(5000, 5000 + int(os.environ.get("EMAVIZ_STUDY_SEEDS", "5")))
HIDDEN = [name for name, effect in CATALOGUE.items() if not effect.duplicates and name != "pendulum_load"]


@cache
def remembered() -> dict[str, dict[str, object]]:
    """Answers of earlier runs, by key."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    store = FOLDER / "study.jsonl"
    lines = store.read_text(encoding="utf-8").splitlines() if store.is_file() else []
    return {known["key"]: known for known in map(json.loads, lines)}


def remembered_or(key: str, compute):
    """An answer, computed only if no earlier run has it."""
    if key not in remembered():
        remembered()[key] = {"key": key, **compute()}
        with (FOLDER / "study.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(remembered()[key]) + "\n")
    return remembered()[key]


SHORT = {"slow sine": [SINE], "small step": [("step", {"final_rad": 0.005}, 0.5)], "chirp": [("chirp", {}, 0.5)]}


def test_next_experiment_breaks_ties():
    """One recording alone leaves ties; the suggested experiment is made with the same plant, and both are fitted."""
    counts: Counter[str] = Counter()
    print("\nties after one recording: named, the same as, suggestion, then what both recordings name")
    for title, commands in SHORT.items():
        for name in HIDDEN:
            for seed in SEEDS[:2]:
                answer = remembered_or(f"tie/{title}/{name}/{seed}", partial(after_suggestion, name, seed, commands))
                if not answer["tie"]:
                    continue
                counts["ties"] += 1
                counts["suggested"] += answer["suggested"] is not None
                counts["broken"] += bool(answer["broken"])
                counts["right"] += bool(answer["broken"]) and answer["then"] == name
                print(f"  {title}, {name}: {answer['tie']} → {answer['suggested']} → {answer['then']}")
    print(f"  {counts['ties']} ties, {counts['suggested']} with a suggestion, {counts['broken']} broken by it, "
          f"{counts['right']} of them for the truth")  # fmt: skip
    assert counts["broken"] >= 0.9 * counts["suggested"]


def after_suggestion(name: str, seed: int, commands) -> dict[str, object]:
    """The tie that a recording leaves, the suggested experiment, and what is named with it."""
    effects = {name: effect_of(name, 2, seed)}
    load = 20.0 if name in NEEDS_LOAD else 0.0
    recordings = recorded(seed, commands=commands, effects=effects, load=load)
    found = discover(recordings, ACTUATOR, most_effects=1)
    one, best = (found.effects or [None])[0], found.next_experiment
    answer: dict[str, object] = {"tie": None, "suggested": None, "broken": False, "then": None}
    if one is None or not one.same_as:
        return answer
    answer["tie"] = [one.name, *one.same_as]
    if best is None:
        return answer
    answer["suggested"] = f"{best.command} {best.settings}, {best.duration_s:g} s, load {best.load_torque_Nm:g} N·m"
    more = recorded(seed + 1, commands=[(best.command, best.settings, best.duration_s)], effects=effects,
                    load=best.load_torque_Nm, plant_seed=seed)  # fmt: skip
    again = discover([*recordings, *more], ACTUATOR, candidates=[one.name, *one.same_as], most_effects=1)
    first = [other for other in again.effects if other.name in answer["tie"]]
    answer["then"] = first[0].name if first else ", ".join(again.parameters_outside_tolerance) or again.verdict
    answer["broken"] = bool(first) and not set(first[0].same_as) & set(best.separates)
    return answer
