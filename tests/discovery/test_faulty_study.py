"""Worn actuators with and without missing physics: the rates of the plan `faults`.

    pytest -m study -s tests/discovery/test_faulty_study.py

See support/studied.py for where its rows are kept, and for the quick form.
"""

from __future__ import annotations

from collections import Counter

import pytest
from support.studied import studied

from ema_model.faults import HEALTHY, NAMES

pytestmark = pytest.mark.study


@pytest.mark.parametrize("group", ["fault_alone", "fault_and_effect"])
def test_faults_are_told_from_missing_physics(group):
    counts: Counter[str] = Counter()
    rows = studied("faults")[group]
    for row in rows:
        true = {name for name, k, healthy in zip(NAMES, row["k_true"], HEALTHY) if k != healthy} - {"k7"}
        found, effects = set(row["faults"]) - {"k7"}, set(row["effects"])
        said = {name for name in true if any(f"fault {name} " in text for text in row["warnings"])}
        right = found == true
        counts["faults"] += right
        counts["faults, or said to explain as much"] += found | said >= true
        counts["effects"] += effects == set(row["hidden"])
        counts["both"] += right and effects == set(row["hidden"])
        ends = [row["ladder"][-1], row["holdout_ladder"][-1]]
        counts["at the floor"] += max((end for end in ends if end is not None), default=9.0) <= 1.1
        told = {name: round(value, 3) for name, value in zip(row["faults"], row["fault_values"])}
        print(f"{row['seed']:3} {sorted(true)} {row['hidden']} → {told} {sorted(effects)} {row['ladder'][-1]}")
    print(f"{len(rows)} plants, {group}: {dict(counts)}")
    assert counts["both"] >= 0.8 * len(rows)
