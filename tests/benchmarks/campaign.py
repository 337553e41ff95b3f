"""Tasks a second on a local Dask cluster against plain processes, in alternating runs.

    python tests/benchmarks/campaign.py [TASKS] [TURNS] [WORKERS]

Counted from the first row to the last, so that beginning the processes does not count; then the memory of the workers.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

for beside in (Path(__file__).parents[1], Path(__file__).parents[1] / "campaign"):
    sys.path.insert(0, str(beside))  # a script finds what tests share

from processes import begun, cluster, ended  # noqa: E402
from support.cheap_plans import cheap  # noqa: E402

from ema_model.campaign import Store  # noqa: E402


def tasks_a_second(out: Path) -> float:
    """Of a campaign, from its first row to its last; prints the memory of its workers."""
    rows = sorted(Store(out).table("identify", how=True).to_pylist(), key=lambda row: row["finished_s"])
    for worker in sorted({row["worker"] for row in rows}):
        its = [row["memory_MB"] for row in rows if row["worker"] == worker]
        print(f"    {worker}: {len(its)} tasks, {its[0]:.0f} … {its[-1]:.0f} MB")
    span = rows[-1]["finished_s"] - rows[0]["finished_s"]
    busy = sum(min(row["elapsed_s"], row["finished_s"] - rows[0]["finished_s"]) for row in rows[1:])
    share = busy / span / len({row["worker"] for row in rows})
    print(f"    workers compute for {100.0 * share:.0f} % of the time, which others' load does not change")
    return (len(rows) - 1) / span


def main(tasks: int = 200, turns: int = 3, workers: int = 2) -> None:
    """Prints each turn, and the median of their ratios."""
    ratios = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = cheap(folder, tasks)
        with cluster(folder, workers) as dask:
            ways = {"processes": ("--workers", workers), "Dask": ("--scheduler", dask.address)}
            for turn in range(turns):
                rates = {}
                for way in ways if turn % 2 == 0 else reversed(ways):
                    out = folder / f"{way}-{turn}"
                    ended(begun(plan, "--out", out, *ways[way]), timeout_s=3600.0)
                    rates[way] = tasks_a_second(out)
                    print(f"  {way}: {rates[way]:.2f} tasks/s", flush=True)
                ratios.append(rates["Dask"] / rates["processes"])
                print(f"turn {turn + 1}: Dask at {100.0 * ratios[-1]:.0f} % of processes", flush=True)
    print(f"median: {100.0 * statistics.median(ratios):.0f} %")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
