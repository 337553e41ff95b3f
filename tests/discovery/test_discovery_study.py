"""The study of discovery: what is named, for every effect of the library, and what is not there.

    pytest -m study -s tests/discovery/test_discovery_study.py

Resumable: each case's answer is a line of study.jsonl in EMAVIZ_STUDY (a folder; a temporary one without it), and
is not computed again.  EMAVIZ_STUDY_SEEDS says how many seeds (5).
"""

from __future__ import annotations

import json
import os
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hidden_effects import ACTUATOR, SINE, recorded

from ema_model.comparison.compare import prepared, weights_of
from ema_model.discovery import discover
from ema_model.discovery.fitting import fit, gather, with_effect
from ema_model.effects import CATALOGUE

pytestmark = pytest.mark.study

FOLDER = Path(os.environ.get("EMAVIZ_STUDY") or tempfile.mkdtemp(prefix="emaviz-study-"))
SEEDS = range(5000, 5000 + int(os.environ.get("EMAVIZ_STUDY_SEEDS", "5")))
COMMANDS = [("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5), SINE]
UNSEEN = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.5)]
SHOWABLE = 25.0
NEEDS_LOAD = ("gear_load_friction", "load_dependent_friction")
HIDDEN = [name for name, effect in CATALOGUE.items() if not effect.duplicates and name != "pendulum_load"]


COLUMNS = {"first": 8, "exact": 8, "wrong": 8, "abstained": 11, "showable": 13}


def case(name: str, severity: int, seed: int) -> dict[str, object]:
    """One answer, computed or remembered."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    store = FOLDER / "study.jsonl"
    key = f"{name}/{severity}/{seed}"
    if store.is_file():
        for line in store.read_text(encoding="utf-8").splitlines():
            if (known := json.loads(line))["key"] == key:
                return known
    answer = {"key": key, **computed(name, severity, seed)}
    with store.open("a", encoding="utf-8") as file:
        file.write(json.dumps(answer) + "\n")
    return answer


def computed(name: str, severity: int, seed: int) -> dict[str, object]:
    """What discovery says of a hidden effect ("" for none)."""
    effects = {}
    if name:
        first = CATALOGUE[name].parameters[0].name
        effects = {name: {first: CATALOGUE[name].severities[severity]}}
        if "order" in {p.name for p in CATALOGUE[name].parameters}:
            random = np.random.default_rng(seed)
            effects[name] |= {"order": 12.0, "phase_rad": float(random.uniform(-3.0, 3.0))}
    load = 20.0 if name in NEEDS_LOAD else 0.0
    recordings = recorded(seed, commands=COMMANDS, effects=effects, load=load)
    unseen = recorded(seed, commands=UNSEEN, effects=effects, load=load)
    found = discover(recordings, ACTUATOR, holdout=unseen)
    return {
        "verdict": found.verdict,
        "effects": [one.name for one in found.effects],
        "same_as": [list(one.same_as) for one in found.effects],
        "ladder": [rung.rmse for rung in found.ladder],
        "holdout": [rung.holdout_rmse for rung in found.ladder],
        "showable": showable(recordings, effects) if effects else 0.0,
    }


def showable(recordings, effects) -> float:
    """Fall of χ² that the true effect, at its true settings, brings."""
    inside = [prepared(recording, ACTUATOR) for recording in recordings]
    data = gather(inside, ACTUATOR, weights_of(None, ACTUATOR), None)
    base = fit(data, ACTUATOR)
    [(name, settings)] = effects.items()
    return base.chi2 - fit(data, with_effect(ACTUATOR, name, settings), base.starts).chi2


def test_nothing_hidden_is_adequate():
    answers = [case("", 0, seed) for seed in range(7000, 7000 + 20 * len(SEEDS))]
    adequate = sum(answer["verdict"] == "adequate" for answer in answers)
    print(f"\nnothing hidden: adequate in {adequate} of {len(answers)}")
    assert adequate >= 0.99 * len(answers)


def test_each_effect_is_named():
    total: Counter[str] = Counter()
    print(f"\n{'effect':26}{'first':>8}{'exact':>8}{'wrong':>8}{'abstained':>11}{'of showable':>13}   named instead")
    for name in HIDDEN:
        row: Counter[str] = Counter()
        others: Counter[str] = Counter()
        for severity in range(3):
            for seed in SEEDS:
                answer = case(name, severity, seed)
                if answer["showable"] < SHOWABLE:
                    continue
                effects = answer["effects"]
                group = {effects[0], *answer["same_as"][0]} if effects else set()
                row["showable"] += 1
                row["first"] += name in group
                row["exact"] += effects == [name]
                row["abstained"] += not effects
                row["wrong"] += bool(effects) and name not in group and len(group) == 1
                if effects and effects[0] != name:
                    others[effects[0]] += 1
        told = ", ".join(f"{other} {count}" for other, count in others.most_common(3))
        counts = "".join(f"{row[what]:{width}}" for what, width in COLUMNS.items())
        print(f"{name:26}{counts}   {told}")
        total += row
    count = total["showable"]
    print(f"{'all':26}" + "".join(f"{100.0 * total[k] / count:7.1f} %" for k in ("first", "exact", "wrong")))
    assert total["first"] >= 0.95 * count
    assert total["exact"] >= 0.90 * count
    assert total["wrong"] <= 0.02 * count
