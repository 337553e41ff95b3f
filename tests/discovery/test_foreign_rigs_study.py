"""What discovery says of foreign rigs, scored as their README says: pytest -m study -s tests/discovery

See support/studied.py for where its rows are kept, and for the quick form.  Skipped without ../shared/rig.
"""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

import pytest
from support.foreign_rigs import RIG, made, truth_of
from support.studied import QUICK, folder, studied

from ema_model.actuator import load_actuator
from ema_model.actuator.naming import on_axes
from ema_model.effects import CATALOGUE

pytestmark = [
    pytest.mark.study,
    pytest.mark.skipif(not (RIG / "rig.py").exists(), reason="no foreign rigs: ../shared/rig is not there"),
]

PLAN = Path(__file__).parent / "plans" / "foreign_rigs.toml"
SHOWN, HARDLY = 3.0, 1.0  # change over the floor


@pytest.fixture(scope="module")
def rows():
    recordings = folder() / "rigs"
    made(recordings, QUICK)
    shutil.copy(PLAN, recordings / "foreign_rigs.toml")
    return studied(str(recordings / "foreign_rigs.toml"))


def scored(row) -> str:
    """right, wrong, or silent; hidden effects that nobody can show are scored as none."""
    hidden = truth_of(row["files"][0])["hidden"]
    named = [{name, *filter(None, same.split("+"))} for name, same in zip(row["effects"], row["same_as"])]
    shown = {name: one for name, one in hidden.items() if max(one["change_over_floor"].values()) >= HARDLY}
    if not shown:
        sure = [group for group in named if group != {"position_sensor_delay"}]
        return "wrong" if sure else "right"
    (one,) = shown.values()
    right = set(one["right"])
    if right & {"curve", "unknown"} and row["verdict"] in ("unknown_effect", "partly_explained"):
        return "right"
    axes = load_actuator(RIG / f"{row['group']}.toml").axes
    outside = {
        on_axes(CATALOGUE[name].duplicates, axes).path
        for name in right & CATALOGUE.keys()
        if CATALOGUE[name].duplicates
    }
    if (named and named[0] & right) or outside & set(row["outside"]):
        return "right"
    return "wrong" if named or max(one["change_over_floor"].values()) > SHOWN else "silent"


def test_what_is_named_on_foreign_rigs(rows):
    for rig, its in rows.items():
        counts: Counter[str] = Counter()
        print(f"\n{rig}")
        for row in its:
            verdict = scored(row)
            counts[verdict] += 1
            told = ", ".join(row["effects"]) or row["verdict"]
            print(f"  {Path(row['files'][0]).parent.name:22}{verdict:8}{told}")
        print(f"  {dict(counts)}")
        clean = [row for row in its if Path(row["files"][0]).parent.name.startswith("clean")]
        assert clean and all(scored(row) == "right" for row in clean)
