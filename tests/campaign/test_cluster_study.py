"""Two thousand identifications on a local Dask cluster, with kills: pytest -m study -s tests/campaign

EMAVIZ_STUDY_TASKS says how many (2000); EMAVIZ_STUDY (a folder) keeps what was computed.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import pytest
from processes import begun, cluster, ended, kill, rows_of, wait_for

from ema_model.campaign import Store

pytestmark = pytest.mark.study

TASKS = int(os.environ.get("EMAVIZ_STUDY_TASKS", "2000"))
PLAN = """
title = "Cheap identifications"
[runs.chirp]
command = "chirp"
duration_s = 0.05
[groups.worn]
does = "identify"
runs = "chirp"
faults = {{ uniform = {{ k1 = [0.0, 0.5], k8 = [0.2, 0.8] }} }}
parameters_known = true
noise_A = 0.45
algorithm = "do"
population = 4
iterations = 2
seeds = {{ from = 0, count = {tasks} }}
"""


def test_two_thousand_identifications_survive_kills(tmp_path):
    folder = Path(os.environ.get("EMAVIZ_STUDY") or tmp_path)
    plan = folder / "plan.toml"
    plan.write_text(PLAN.format(tasks=TASKS))
    on_dask, here = folder / "dask", folder / "here"
    started = time.perf_counter()
    with cluster(folder) as one:
        client = begun(plan, "--out", on_dask, "--scheduler", one.address)
        wait_for(lambda: rows_of(on_dask) > TASKS // 3, 3000.0)
        kill(one.worker_processes()[0])
        wait_for(lambda: rows_of(on_dask) > 2 * TASKS // 3, 3000.0)
        kill(client.pid)
        client.communicate()
        kept = rows_of(on_dask)
        print("\n", ended(begun(plan, "--out", on_dask, "--scheduler", one.address), timeout_s=3000.0))
        begun_tasks = Counter(one.times_begun())
    print(f"{kept} rows when the client was killed; Dask in {time.perf_counter() - started:.0f} s")
    twice = sum(count - 1 for count in begun_tasks.values())
    print(f"{len(begun_tasks)} tasks begun, {twice} of them a second time")
    started = time.perf_counter()
    print(ended(begun(plan, "--out", here, "--workers", "2"), timeout_s=3000.0))
    print(f"processes in {time.perf_counter() - started:.0f} s")
    for name in ("dask", "here"):
        rows = Store(folder / name).table("identify", how=True).to_pylist()
        assert len(rows) == TASKS and not any(row["error"] for row in rows)
        for worker in sorted({row["worker"] for row in rows}):
            its = sorted((row for row in rows if row["worker"] == worker), key=lambda row: row["finished_s"])
            told = ", ".join(f"{its[i]['memory_MB']:.0f}" for i in (0, len(its) // 2, -1))
            print(f"{name} {worker}: {len(its)} tasks, {told} MB at the first, the middle, the last")
    assert (on_dask / "identify.parquet").read_bytes() == (here / "identify.parquet").read_bytes()
    # what is begun again is what was being computed, or waited for its turn on a worker, when something was killed
    assert twice <= 12
