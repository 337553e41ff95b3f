"""What rows say together: tables for a terminal and for Markdown, and the report with its figures."""

from __future__ import annotations

import re
from itertools import pairwise

import pytest
from support.cheap_plans import written

from ema_model.campaign import Store, load_plan
from ema_model.campaign.kinds import covered, tally
from ema_model.campaign.rows import common
from ema_model.campaign.store import Campaign, header_of, progress_table, report_text, summaries
from ema_model.faults import HEALTHY, NAMES

GROUPS = """
[groups.found]
CHEAP
faults = [{ k1 = 0.2 }, { k6 = 0.3, k7 = 0.98 }]
seeds = { from = 0, count = 4 }

[groups.named]
does = "discover"
runs = "short"
effects = [{}, { cogging_torque = { amplitude_Nm = 0.01 } }]
seeds = { from = 0, count = 3 }

[groups.shown]
does = "compare"
runs = "short"
seeds = { from = 0, count = 2 }
"""


def identified(task, i):
    k = dict(zip(NAMES, common(task)["k_true"]))
    found = {name: value + 0.01 * i for name, value in k.items()}
    return {
        **found,
        **{f"{name}_low": value - 0.015 for name, value in found.items()},
        **{f"{name}_high": value + 0.015 for name, value in found.items()},
        "algorithm": "do",
        "population": 4,
        "iterations": 2,
        "error_percent": float(i),
        "error_wrapped_percent": float(i),
        "rmse_A": 0.1,
        "healthy": i == 0,
        "alarms": ["k1"] * (i > 0),
        "adequate": True,
        "ambiguous": [],
        "evaluations": 12,
        "rmse_history_A": [1.0, 0.5, 0.1 + 0.1 * i],
    }


def discovered(task, i):
    hidden = list(task.simulated.effects)
    named = {0: ["cogging_torque"], 1: ["hinge_moment"], 2: []}[i]
    return {
        "signals": "all",
        "verdict": "effects_found" if named and hidden else "adequate",
        "effects": named if hidden else [],
        "same_as": [""] if named and hidden else [],
        "ladder": [2.0, 1.0],
        "floor_band": [0.95, 1.05],
        "holdout_ladder": [2.0, None],
    }


def compared(task, i):
    return {
        "adequate": i == 0,
        "signal": "current_A",
        "over_floor": 1.2,
        "floor_band": [0.9, 1.1],
        "orders": [12.0],
    } | ({"variable": "motor_speed", "modulator": "1"} if i else {})


def held_beside(task, i):
    method = task.settings["method"]
    error = {"discover": 30.0, "bam_m1": 20.0, "bam_m3": 50.0}[method] + 20.0 * (task.group == "ahead")
    better_fitted = {"discover": 25.0, "bam_m1": 19.0, "bam_m3": 21.0 - 5.0 * (task.group == "ahead")}[method]
    numbers = {"fitted_error": better_fitted, "held_out_error": error, "held_out_errors": [error]}
    named = {"effects": ["mesh_friction"], "verdict": "partly_explained"} if method == "discover" else {}
    return {"method": method, "measure": "following", "unit": "mrad", "answer_s": 2.5, **numbers, **named}


ANSWER = {"identify": identified, "discover": discovered, "compare": compared, "benchmark": held_beside}


@pytest.fixture
def store(tmp_path):
    """A campaign with an answer of each kind, and an error."""
    plan = load_plan(written(tmp_path, GROUPS))
    header = header_of(plan.title, "About it.", plan.tasks)
    store = Store.writing(tmp_path / "out", header, plan.text, plan.tasks)
    for task in plan.tasks:
        how = {"elapsed_s": 1.5, "worker": "here:1", "memory_MB": 300.0, "finished_s": 1e9 + task.seed}
        row = common(task) | ANSWER[task.kind](task, task.seed) | how
        if task.group == "shown" and task.seed == 1:
            row = common(task) | how | {"error": "FloatingPointError: it | diverged"}
        store.append(task.kind, [row])
    store.close()
    return Store(tmp_path / "out")


def test_tables_count_what_was_right(store):
    compare, discover, identify = summaries(store)
    cells = [dict(zip(identify.heads, line)) for line in identify.lines]
    assert [cell["case"] for cell in cells] == ["all", "k1=0.2", "k6=0.3 k7=0.98"]
    assert (cells[0]["tasks"], cells[0]["healthy"], cells[0]["with alarms"]) == ("8", "2", "6")
    assert (cells[1]["Err % median"], cells[1]["worst"]) == ("1.50", "3.00")
    assert cells[1]["90 % intervals that hold k1 … k8, %"] == "50 50 50 50 50 50 0 50"
    cells = [dict(zip(discover.heads, line)) for line in discover.lines]
    assert cells[0]["verdicts"] == "adequate 4, effects_found 2"
    assert [cells[2][name] for name in ("showable", "right one first", "exactly", "wrong, sure", "abstained")] == list(
        "31111"
    )
    cells = [dict(zip(compare.heads, line)) for line in compare.lines]
    assert (cells[0]["tasks"], cells[0]["errors"], cells[0]["strongest order"]) == ("2", "1", "12: 1")
    assert (cells[0]["error over floor, median"], cells[0]["in its 90 % band"]) == ("1.20", "0")


def test_a_name_counts_with_what_cannot_be_told_from_it():
    row = {"hidden": ["a", "b"], "ladder": [1.0], "holdout_ladder": [1.3]}
    both = tally(row | {"effects": ["x", "b"], "same_as": ["a+y", ""]})
    assert both["first"] and both["exact"] and not both["floor"] and not both["wrong"]
    assert not tally(row | {"effects": ["x"], "same_as": ["a+y+z"]})["first"]  # a group of four says little
    assert tally(row | {"effects": ["x"], "same_as": [""]})["wrong"]


def test_an_interval_of_the_phase_goes_round():
    row = {"k_true": [*HEALTHY[:6], 0.02, 0.5]}
    row |= {f"{name}_low": 0.0 for name in NAMES} | {f"{name}_high": 1.0 for name in NAMES}
    assert all(covered(row))
    assert covered(row | {"k7_low": 0.97, "k7_high": 1.03})[6]
    assert not covered(row | {"k7_low": 0.9, "k7_high": 0.99})[6]


def test_markdown_tells_version_and_commit(store):
    told = report_text(Campaign(store))
    assert re.search(r"Made with emaviz \S+ \(commit \S+, sources [0-9a-f]{12}\), numpy ", told)
    assert "| found | k1=0.2 | 4 | 0 | 1.50 |" in told
    assert "- shown, , seed 1: FloatingPointError: it | diverged" in told or "seed 1: FloatingPointError" in told
    assert "plan: done" in progress_table(Campaign(store))


def test_the_report_is_one_file_with_its_figures(store, tmp_path):
    path = tmp_path / "report.html"
    Campaign(store).export(path)
    text = path.read_text(encoding="utf-8")
    for anchor in ("tasks", "results", "distributions", "answers", "convergence", "errors", "effort"):
        assert f'<section id="{anchor}">' in text
    assert text.count('class="figure"') == 1 + 8 + 2 + 1 + 2
    assert "FloatingPointError" in text


def test_where_discovery_is_behind_stands_first(tmp_path):
    group = 'does = "benchmark"\nruns = "short"\nmethod = ["discover", "bam_m1", "bam_m3"]\n'
    plan = load_plan(written(tmp_path, f"[groups.ahead]\n{group}[groups.behind]\n{group}"))
    store = Store.writing(tmp_path / "out", header_of(plan.title, "", plan.tasks), plan.text, plan.tasks)
    for task in plan.tasks:
        how = {"elapsed_s": 1.5, "worker": "here:1", "memory_MB": 300.0, "finished_s": 1e9}
        store.append(task.kind, [common(task) | how | ANSWER[task.kind](task, 0)])
    store.close()
    store = Store(tmp_path / "out")
    told = report_text(Campaign(store))
    assert "| 50 mrad (discover) | 70 mrad (bam_m3) | 40 mrad (bam_m1) |" in told  # of the group ahead
    assert "| behind | method discover | 1 | 0 | – | – | – | 25 mrad | 30 mrad | mesh_friction |" in told
    Campaign(store).export(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    section = text[text.index('<section id="benchmarks">') :]
    section = section[: section.index("</section>")]
    assert "Behind the method that its training error chooses: behind, 1.50 times." in section
    assert section.index("behind</td>") < section.index("ahead</td>") and "2.5 s" in section
    cells = re.findall(r"<td[^>]*>([^<]*)</td>", section)
    averages = dict(pairwise(cells))
    assert (averages["in hindsight"], averages["by training error"]) == ("30", "45")
    assert section.count('class="figure"') == 1


def test_an_empty_campaign_has_a_report(tmp_path):
    plan = load_plan(written(tmp_path, GROUPS))
    Store.writing(tmp_path / "out", header_of("T", "", plan.tasks), plan.text, plan.tasks).close()
    store = Store(tmp_path / "out")
    Campaign(store).export(tmp_path / "report.html")
    assert "0 of 16 tasks have a row" in progress_table(Campaign(store)) and report_text(Campaign(store))
