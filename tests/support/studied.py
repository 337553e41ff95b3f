"""The rows of the studies' plans, which the study tests ask for their rates.

EMAVIZ_STUDY names a folder that keeps them, so that an interrupted study goes on there; EMAVIZ_STUDY_QUICK=1 takes the
quick forms, whose rates are of a few tasks; EMAVIZ_STUDY_SCHEDULER names a Dask cluster in place of processes here.
"""

from __future__ import annotations

import os
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from ema_model.campaign import Store, load_plan, run_plan, scheduler
from ema_model.campaign.kinds import KINDS
from ema_model.campaign.store import Campaign, report_text

QUICK = os.environ.get("EMAVIZ_STUDY_QUICK") == "1"


@cache
def folder() -> Path:
    """Where they are kept."""
    named = os.environ.get("EMAVIZ_STUDY")
    return Path(named) if named else Path(tempfile.mkdtemp(prefix="emaviz-study-"))


@cache
def studied(plan: str) -> dict[str, list[dict[str, Any]]]:
    """By group, the rows of a plan, computed as far as they are not there; an error among them is a failure."""
    loaded = load_plan(f"{plan}_quick" if QUICK and "." not in plan else plan)
    out = folder() / Path(plan).stem
    run_plan(loaded, out, scheduler(os.environ.get("EMAVIZ_STUDY_SCHEDULER"), None))
    store = Store(out)
    print(f"\n{report_text(Campaign(store))}")
    rows = [row for kind in KINDS for row in store.table(kind).to_pylist()]
    failed = [f"{row['group']}, {row['case']}, seed {row['seed']}: {row['error']}" for row in rows if row["error"]]
    assert not failed, "\n".join(failed)
    return {group: [row for row in rows if row["group"] == group] for group in store.header.kinds}
