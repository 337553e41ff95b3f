"""The thesis's evaluation: its printed numbers from its printed rows, and ours put beside them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ema_model.campaign import load_plan
from ema_model.campaign.thesis import (
    ALGORITHMS,
    BY_NAME,
    CASES,
    EVERY,
    FAMILIES,
    FAULTS,
    MULTIPLE,
    SINGLE,
    Spread,
    case_of,
    missed,
    performance_coefficients,
    points,
    printed_means,
    printed_rows,
    scores,
    settled_at,
    stops,
)
from ema_model.faults import NAMES, error_percent, physical, vector
from ema_model.identification.run import ROBUST


def row(case, algorithm, k=None, error=None, time=1.0, **more):
    """As a campaign keeps an identification."""
    truth = BY_NAME[case].k
    k = truth if k is None else k
    error = error_percent(k, truth) if error is None else error
    return {
        "algorithm": algorithm,
        "k_true": truth.tolist(),
        "error_percent": error,
        "error_wrapped_percent": min(error, 1.0),
        "answer_s": time,
        **dict(zip(NAMES, k)),
        **more,
    }


def as_the_thesis_printed():
    """Its 330 rows as if a campaign had made them, with the means of its times."""
    return [
        row(one.case, one.algorithm, one.k, one.error_percent, printed_means()[one.case, one.algorithm].time_s)
        for one in printed_rows()
    ]


def test_the_eleven_cases_are_the_thesis_s():
    assert len(CASES) == 11
    assert len(printed_rows()) == 330
    assert len(printed_means()) == 33 == len({(one.case, one.algorithm) for one in printed_rows()})
    assert case_of(vector({"k1": 0.3})) is None
    assert case_of([0.0133, 0.05, 0.003, 0, 0, 0.012, 0.5, 0.35]) is BY_NAME[MULTIPLE]


def test_printed_errors_follow_from_printed_k_and_printed_means_from_printed_errors():
    rounding = 0.005 + 100.0 / math.sqrt(6.5) * 0.5e-4
    for one in printed_rows():
        assert error_percent(one.k, one.truth) == pytest.approx(one.error_percent, abs=rounding + 1e-9), one
    for one in scores(as_the_thesis_printed(), tuple(ALGORITHMS)):
        mean = printed_means()[one.case.name, one.algorithm].error_percent
        assert one.error.mean == pytest.approx(mean, abs=0.0101), (one.case.name, one.algorithm)  # it cuts some off
        assert one.error == one.printed and one.difference == 0.0 and one.k == one.printed_k
        assert one.time_s.mean == one.printed_time_s and one.error.count == 10


def test_the_thesis_s_rows_give_its_coefficients():
    """T 5.39–5.43, as far as errors with two digits tell: half a unit of Err moves the smallest by some per cent."""
    made = performance_coefficients(scores(as_the_thesis_printed(), tuple(ALGORITHMS)))
    assert {one.fault for one in made} == {*FAULTS, MULTIPLE, SINGLE} and len(made) == 21
    for one in made:
        assert one.printed is not None
        assert one.error_percent == pytest.approx(one.printed.error_percent, abs=0.0151)
        assert one.time_s == pytest.approx(one.printed.time_s, abs=0.51)
        assert one.percent == pytest.approx(one.printed.coefficient_percent, abs=0.6), one
    for fault in (*FAULTS, MULTIPLE):
        assert sum(one.percent for one in made if one.fault == fault) == pytest.approx(200.0)


def test_spreads_and_scores_of_made_up_rows():
    assert Spread.of([1.0, 2.0, 3.0]) == Spread(2.0, 1.0, 3)
    assert Spread.of([1.0]).mean == 1.0 and math.isnan(Spread.of([1.0]).deviation)
    k = vector({"k1": 0.35})
    made = [row("friction_low", "ssa", k, time=2.0), row("friction_low", "ssa", time=4.0), row("gain_high", ROBUST)]
    found = {(one.case.name, one.algorithm): one for one in scores(made)}
    assert len(found) == 34  # the thesis's 33, and the robust one that was run
    one = found["friction_low", "ssa"]
    off = 100.0 * 0.1 / math.sqrt(6.5)
    assert one.error.mean == pytest.approx(off / 2) and one.error.deviation == pytest.approx(off / math.sqrt(2))
    assert one.wrapped.mean == pytest.approx(0.5) and one.time_s == Spread(3.0, math.sqrt(2.0), 2)
    assert one.k == pytest.approx(0.3) and one.printed_k == pytest.approx(0.2344, abs=1e-4)
    assert one.printed is not None and one.difference == pytest.approx(off / 2 - one.printed.mean)
    robust = found["gain_high", ROBUST]
    assert robust.printed is None and robust.difference is None and robust.printed_time_s is None
    assert found["gain_low", "do"].difference is None  # the thesis has it, we have not


def test_runs_that_missed_are_told_apart():
    made = [row("gain_low", "hba", error=error) for error in (1.0, 2.0, 5.0, 20.0)]
    (one,) = missed(made)
    assert (one.count, one.missed) == (4, 1) and one.error_of_others == pytest.approx(8.0 / 3.0)
    assert (one.printed_count, one.printed_missed) == (110, 1)  # of table 5.17
    (ssa,) = missed([row("gain_low", "ssa")])
    assert ssa.printed_missed == sum(one.error_percent > 5.0 for one in printed_rows() if one.algorithm == "ssa") >= 4


def test_a_coefficient_needs_every_algorithm_on_low_and_high():
    made = [
        row(f"friction_{size}", name, error=error, time=time)
        for name, error, time in (("ssa", 2.0, 3.0), ("hba", 1.0, 2.0), ("do", 4.0, 1.0))
        for size in ("low", "high")
    ]
    found = performance_coefficients(scores(made))
    assert [(one.fault, one.algorithm) for one in found] == [("friction", name) for name in ALGORITHMS]
    assert [one.percent for one in found] == pytest.approx([50.0, 100.0 * (1 - 2 / 12), 100.0 * (1 - 4 / 12)])
    assert performance_coefficients(scores(made[:-1])) == []
    assert EVERY == (*ALGORITHMS, ROBUST)


def test_effort_and_stops_of_made_up_rows():
    history = [2.0, 1.0, 0.5, 0.5049, 0.5]
    assert settled_at(history) == 2 and settled_at([1.0]) == 0

    def searched(algorithm, iterations, error, rmse):
        more = {"population": 10, "iterations": iterations, "evaluations": 10 * iterations}
        errors = [9.0, 8.0, 7.0, 6.0, error]
        return row(MULTIPLE, algorithm, error=error, rmse_history_A=rmse, error_history_percent=errors, **more)

    made = [searched("hba", 25, error, history) for error in (1.0, 2.0, 3.0)] + [searched("hba", 50, 1.0, [1.0, 1e-4])]
    low, high = points(made)
    assert (low.iterations, low.evaluations, low.error_percent, low.count) == (25, 250.0, 2.0, 3)
    assert low.low_percent == pytest.approx(1.1) and low.high_percent == pytest.approx(2.9) and high.count == 1
    (stop,) = stops(made)
    assert (stop.algorithm, stop.count, stop.reached, stop.least_A, stop.settled) == ("hba", 4, 1, 1e-4, 2.0)
    assert stop.error_settled_percent == 7.0 and stop.error_percent == 1.5


def test_the_quick_plan_is_a_part_of_the_whole_one():
    """So that the whole one goes on from its rows."""
    whole, quick = load_plan("thesis"), load_plan("thesis_quick")
    assert {task.name for task in quick.tasks} < {task.name for task in whole.tasks}
    for plan, runs in ((whole, 10), (quick, 1)):
        for group, algorithms in (("thesis", 3), ("robust", 1)):
            tasks = [task for task in plan.tasks if task.group == group]
            assert len(tasks) == 11 * algorithms * runs
            truths = [vector(task.simulated.faults) for task in tasks if task.simulated is not None]
            assert {case.name for k in truths if (case := case_of(k)) is not None} == set(BY_NAME)
    settings = {task.settings["fitness"] for task in whole.tasks if task.group == "thesis"}
    assert settings == {"raw"}


def test_severities_are_the_thesis_s():
    """Backlash × 2, 5, 10, 50, 100; friction × 1 … 3; G × 0.5 … 1.5 (T 3.5.1–3.5.5)."""
    k = {family.name: [physical(vector(one.settings)) for one in family.severities] for family in FAMILIES}
    np.testing.assert_allclose([one.backlash_factor for one in k["backlash"]], [2, 5, 10, 50, 100])
    np.testing.assert_allclose([one.friction_factor for one in k["friction"]], [1, 1.5, 2, 2.5, 3])
    np.testing.assert_allclose([one.gain_factor for one in k["gain"]], [0.5, 0.75, 1, 1.25, 1.5])
    np.testing.assert_allclose([one.turns[2] for one in k["short_circuit"]], [1, 0.75, 0.5, 0.25, 0.02])
