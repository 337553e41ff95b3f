"""Candidates while they are scored: as algebra ranks them at once, then as the most probable are refitted."""

from __future__ import annotations

import random
import time

import pytest
from support.on_page import wait_until
from support.rig import Rig

from ema_model.discovery.snapshot import user_begins
from ema_model.effects.user import parse, user_torque
from emaviz.page import discover_candidate
from emaviz.page.discover_candidate import reach


@pytest.fixture(scope="module")
def discovering(tmp_path_factory):
    rig = Rig(tmp_path_factory.mktemp("data"))
    rig.discovering.source.choose("first_bench_run")
    yield rig.discovering
    rig.close()


def test_candidates_are_shown_as_algebra_ranks_them_and_again_as_each_is_refitted(discovering):
    seen, ranked = [], []

    def looked(look):
        if look is not None and look.assessment is not None:
            known = look.assessment
            seen.append((discovering.is_refining, len(known.refitted), known.is_refined))
            ranked.append(look)

    discovering.events.looked.connect(looked)
    try:
        assert discovering.start()
        wait_until(lambda: not discovering.running)
    finally:
        discovering.events.looked.disconnect(looked)
    assert seen[0] == (False, 0, False) and (True, 0, False) in seen, "before anything is refitted"
    assert seen[-1][1:] == (len(discovering._shown.told.refits.contenders), True) and seen[-1][1] > 0
    best, first = ranked[-1].promising[0], ranked[0].promising[0]
    assert best.name == first.name == "cogging_torque" and best.refitted_drop > 0.0 and first.refitted_drop is None
    algebra, refitted = ranked[0].predicted_rmse(first), ranked[-1].predicted_rmse(best)
    assert refitted == ranked[-1].assessment.refitted[best.name] == pytest.approx(algebra, rel=0.25)
    assert "refitted" in discover_candidate.fall(ranked[-1], best) and "≈" in discover_candidate.fall(ranked[0], first)
    improbable = [one for one in ranked[-1].promising if ranked[-1].probability(one) < 0.01]
    assert discover_candidate.chance(ranked[-1], best) == "> 99.9 % probable" and improbable
    assert {discover_candidate.chance(ranked[-1], one) for one in improbable} == {"not the next"}, (
        "whatever it would take away"
    )
    assert "Ranked by algebra" in discover_candidate.how_known(ranked[0], True)
    assert "Ranked by refits" in discover_candidate.how_known(ranked[-1], False)


def test_a_step_that_is_asked_for_ends_the_refits(discovering):
    asked = []

    def looked(look):
        if discovering.is_refining and not asked:
            asked.append(discovering.add("cogging_torque"))  # which the page lets wait until the refits have ended

    discovering.events.looked.connect(looked)
    try:
        assert discovering.start()
        wait_until(lambda: not discovering.running)
    finally:
        discovering.events.looked.disconnect(looked)
    assert asked == [False] and not discovering.job.finished, "they were stopped"
    assert not discovering.look.assessment.is_refined and discovering.look.promising
    assert discovering.add("cogging_torque")
    wait_until(lambda: not discovering.running)
    assert discovering.look.removable == ["cogging_torque"]


def test_an_own_law_begins_as_what_is_left_suggests_and_its_compilation_is_stopped_at_once(discovering):
    while discovering.look is None or discovering.look.removable or not discovering.look.promising:
        if discovering.look is None:
            assert discovering.start()
        else:
            discovering.undo()
        wait_until(lambda: not discovering.running)
    text = f"-c*tanh(omega/v) + A*sin(h*theta) + {random.random():.6f}*0"  # new, so that it is compiled
    begins = user_begins(discovering.look, parse(text))
    speed = discovering.look.residuals.variables["motor_speed"]
    assert begins["v"].value == pytest.approx((speed**2).mean() ** 0.5) and begins["v"].value > 10.0
    assert 1e-3 < begins["c"].value < 0.1 and begins["c"].words == "N·m"
    assert begins["h"].value == 14.0, "the order of the best candidate"
    low, high = reach(begins["v"].value)
    assert -low == high >= 5.0 * begins["v"].value
    said = []
    discovering.job.progressed.connect(lambda text, *_: said.append(text))
    own = user_torque(text, {"v": (low, high)})
    assert discovering.add_own(own, {name: one.value for name, one in begins.items()})
    wait_until(lambda: any("compiling it" in one for one in said))
    time.sleep(0.5)
    asked = time.perf_counter()
    discovering.job.stop()
    wait_until(lambda: not discovering.running)
    assert time.perf_counter() - asked < 1.0 and not discovering.look.removable
