"""What discovery says of plants simulated with MuJoCo, a kind that nobody tuned to: pytest -m study -s tests/discovery

    mujoco-env/bin/python tests/benchmarks/mujoco_plants.py FOLDER       # in an environment of MuJoCo's own
    EMAVIZ_MUJOCO=FOLDER python -m pytest -m study -s tests/discovery/test_mujoco_plants_study.py

Skipped without the folder.  EMAVIZ_STUDY names a folder that keeps the rows, so that an interrupted study goes on
there; EMAVIZ_STUDY_UNITS says which plants ("0-9"; all without it).  The folder holds the same as a plan, too:
emaviz campaign FOLDER/mujoco_plants.toml --out DIR.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from pathlib import Path

import pytest
from support.mujoco_score import COLUMNS, compared, covered, line, row_of, tally, truth_of
from support.studied import folder

pytestmark = pytest.mark.study

FEWEST_INTERVALS = 100  # of which a share is told
WAITS_S = float(os.environ.get("EMAVIZ_MUJOCO_WAITS_S", "0"))  # for a plant that is still being simulated
MOST_FLOORS = 1.3  # of a true model: where a motion sticks and slides MuJoCo's friction gives a little


@pytest.fixture(scope="module")
def plants() -> list[Path]:
    """Their folders."""
    named = os.environ.get("EMAVIZ_MUJOCO")
    if not named:
        pytest.skip("EMAVIZ_MUJOCO names no folder of plants; tests/benchmarks/mujoco_plants.py writes one")
    first, _, last = os.environ.get("EMAVIZ_STUDY_UNITS", "0-99").partition("-")
    seeds = range(int(first), int(last or first) + 1)
    every = [Path(named) / f"plant_{seed:03d}" for seed in sorted(seeds, key=_turn)]
    return [one for one in every if _is_there(one)]


def _turn(seed: int) -> int:
    """The order of work, as the plants are made in: mixed, so that an interrupted study is a sample of the whole."""
    return seed * 37 % 100


def _is_there(plant: Path) -> bool:
    return WAITS_S > 0.0 or (plant / "truth.json").is_file()


@pytest.fixture(scope="module")
def answers(plants):
    """Row and truth of each; each answer is printed with its line."""
    place = folder() / "mujoco"
    place.mkdir(parents=True, exist_ok=True)
    found = []
    for plant in plants:
        until = time.monotonic() + WAITS_S
        while not (plant / "truth.json").is_file() and time.monotonic() < until:
            time.sleep(1.0)
        saved = place / f"{plant.name}.row.json"
        if not saved.exists():
            saved.write_text(json.dumps(row_of(plant), default=str), encoding="utf-8")
        row, truth = json.loads(saved.read_text(encoding="utf-8")), truth_of(plant)
        found.append((row, truth))
        print(line(row, truth), flush=True)
    return found


@pytest.fixture(scope="module")
def total(answers) -> Counter[str]:
    counts = sum((tally(row, truth) for row, truth in answers if not row["error"]), Counter())
    print(", ".join(f"{name} {counts[name]}" for name in COLUMNS), f"of {counts['cases']}")
    return counts


def test_every_plant_is_read(answers):
    assert [row["name"] for row, _ in answers if row["error"]] == []


def test_what_is_showable_is_named(total):
    assert total["right"] >= 0.85 * total["showable"]


def test_hardly_any_name_is_wrong(total):
    assert total["wrong"] <= 0.01 * total["cases"]


def test_nothing_hidden_names_nothing(total):
    assert total["clean adequate"] >= 0.95 * total["clean"]


def test_what_the_library_does_not_hold_gets_no_name(total):
    assert total["outside, no name"] >= 0.85 * total["outside the library"]


def test_intervals_hold_what_is_true(answers):
    held = [one for row, truth in answers if not row["error"] for one in covered(row, truth).values()]
    print(f"{sum(held)} of {len(held)} intervals hold what is true")
    if len(held) < FEWEST_INTERVALS:
        pytest.skip(f"{len(held)} intervals are too few")
    assert 0.86 <= sum(held) / len(held) <= 0.94


def test_a_true_model_is_adequate(plants):
    """Of the first plants whose physics the library holds: else units, signs or axes would differ, not discovery."""
    known = [one for one in plants if all(effect["in_library"] for effect in truth_of(one)["hidden"].values())][:5]
    over = {one.name: compared(one).over_floor for one in known}
    print(", ".join(f"{name} {value:.3g}" for name, value in over.items()))
    assert all(value <= MOST_FLOORS for value in over.values())
