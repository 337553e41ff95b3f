"""Benches of other people, read and judged as their owners would: pytest -m study -s tests/discovery/test_benches.py

EMAVIZ_STUDY names a folder that keeps the rows, so that an interrupted study goes on there; EMAVIZ_STUDY_UNITS says
which benches ("0-5"; all without it).
"""

from __future__ import annotations

import json
import os

import pytest
from support.bench_score import line, row_of
from support.benches import benches
from support.studied import folder

pytestmark = pytest.mark.study

LEAST_INTERVALS = 60  # of which a share is told


@pytest.fixture(scope="module")
def rows():
    every = benches()
    first, _, last = os.environ.get("EMAVIZ_STUDY_UNITS", f"0-{len(every) - 1}").partition("-")
    place = folder() / "benches"
    place.mkdir(parents=True, exist_ok=True)
    found = []
    for bench in every[int(first) : int(last or first) + 1]:
        saved = place / f"{bench.name}.row.json"
        if not saved.exists():
            saved.write_text(json.dumps(row_of(bench, place), default=str), encoding="utf-8")
        found.append(json.loads(saved.read_text(encoding="utf-8")))
        print(line(found[-1]), flush=True)
    return found


def test_nearly_all_are_read_and_represented(rows):
    assert sum(row["represented"] and not row["error"] for row in rows) >= 28 / 30 * len(rows)


def test_what_is_missing_is_named_without_a_stand_in(rows):
    assert [row["name"] for row in rows if not row["named"]] == []


def test_intervals_hold_what_is_true(rows):
    intervals = [one for row in rows if row["represented"] for one in row["intervals"].values()]
    held = sum(low <= true <= high for low, high, true in intervals)
    print(f"{held} of {len(intervals)} intervals hold what is true")
    if len(intervals) < LEAST_INTERVALS:
        pytest.skip(f"{len(intervals)} intervals are too few")
    assert 0.86 <= held / len(intervals) <= 0.94
