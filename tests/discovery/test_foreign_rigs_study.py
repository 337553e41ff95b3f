"""What discovery says of foreign rigs, scored as their README says: pytest -m study -s tests/discovery

See support/studied.py for where its rows are kept, and for the quick form.  EMAVIZ_STUDY_UNITS says which units
(1-30 without it; 1 in the quick form).  Skipped without ../shared/rig.
"""

from __future__ import annotations

import os
import shutil
from collections import Counter
from pathlib import Path
from statistics import median

import pytest
from support.foreign_rigs import RIGS, made, simulator_folder, truth_of
from support.foreign_score import COLUMNS, covered, line, tally
from support.studied import QUICK, folder, studied

pytestmark = pytest.mark.study

PLAN = Path(__file__).parent / "plans" / "foreign_rigs.toml"
UNITS = os.environ.get("EMAVIZ_STUDY_UNITS", "1" if QUICK else "1-30")
EFFECTS = 2 if QUICK else 10
MOST_UNITS_HIDDEN = 10
FEWEST_INTERVALS = 300  # of which a share is told


@pytest.fixture(scope="module")
def counts():
    """By group of the plan; each answer is printed with its line."""
    simulator_folder()  # skipped here where there is none
    recordings = folder() / f"rigs_{UNITS.replace(',', '_')}"
    units = [u for part in UNITS.split(",") for u in range(int(part.split("-")[0]), int(part.split("-")[-1]) + 1)]
    made(recordings, units, EFFECTS, units[:MOST_UNITS_HIDDEN])
    shutil.copy(PLAN, recordings / f"foreign_rigs_{UNITS}.toml")
    found = {}
    for group, rows in studied(str(recordings / f"foreign_rigs_{UNITS}.toml")).items():
        total: Counter[str] = Counter()
        widths: list[float] = []
        print(f"\n{group}")
        for row in rows:
            truth = truth_of(row["files"][0])
            intervals = covered(row, truth)
            total += tally(row, truth) + Counter(
                intervals=len(intervals), held=sum(is_held for is_held, _ in intervals)
            )
            print(f"  {Path(row['files'][0]).parent.name:18}{line(row)}")
            widths += [width for _, width in intervals]
        told = ", ".join(f"{name} {total[name]}" for name in COLUMNS)
        print(f"  {told}; of {total['cases']}, {total['showable']} showable")
        if widths:
            print(f"  {total['held']} of {len(widths)} intervals hold, ± {100.0 * median(widths):.2g} % at the median")
        found[group] = total
    return found


def of(counts, kind: str) -> Counter[str]:
    return sum((counts[f"{rig}_{kind}"] for rig in RIGS if f"{rig}_{kind}" in counts), Counter())


def test_a_verdict_never_contradicts_its_ladder(counts):
    assert not sum(counts.values(), Counter())["contradicts"]


def test_nothing_hidden_names_nothing(counts):
    clean = of(counts, "clean")
    assert clean["false"] + clean["at bound"] <= 2 / 90 * clean["cases"]
    assert counts["hobby_clean"]["drive told"] >= 28 / 30 * counts["hobby_clean"]["cases"]


@pytest.mark.parametrize("rig", ["gearservo", "ballscrew"])
@pytest.mark.parametrize("drive", ["clean", "proportional"])
def test_the_drive_is_told(counts, rig, drive):
    total = counts[f"{rig}_{drive}"]
    assert total["drive told"] >= 0.8 * total["cases"]


def test_hidden_effects_are_named(counts):
    hidden = of(counts, "hidden")
    of_names = hidden["showable"] - hidden["unknown with its variable"]
    assert hidden["false"] <= 0.02 * hidden["cases"]
    assert hidden["right"] >= 0.85 * of_names
    assert hidden["silent"] <= 0.1 * hidden["showable"]


def test_hidden_effects_that_the_file_rules_out_are_named(counts):
    """Of the same those that no value within the tolerances of the actuator's file is."""
    hidden = of(counts, "hidden")
    told = hidden["showable"] - hidden["as the file allows"]
    assert hidden["right"] >= 0.85 * (told - hidden["unknown with its variable"])
    assert hidden["silent"] - hidden["as the file allows"] <= 0.1 * told


def test_a_mess_of_small_everything_names_nothing_that_is_not_there(counts):
    real = of(counts, "real")
    assert real["false"] <= 2 / 90 * real["cases"]


def test_intervals_hold_what_is_true(counts):
    total = sum(counts.values(), Counter())
    if total["intervals"] < FEWEST_INTERVALS:
        pytest.skip(f"{total['intervals']} intervals of models that reach the floor's band are too few")
    assert 0.86 <= total["held"] / total["intervals"] <= 0.94
