"""Candidates while they are scored: as algebra ranks them at once, then as the most probable are refitted."""

from __future__ import annotations

import pytest
from support.on_page import wait_until
from support.rig import Rig

from emaviz.page.discover import candidate


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
            seen.append((discovering.is_refining, len(known.refitted), known.refits is not None))
            ranked.append(look)

    discovering.events.looked.connect(looked)
    try:
        assert discovering.start()
        wait_until(lambda: not discovering.running)
    finally:
        discovering.events.looked.disconnect(looked)
    assert seen[0] == (False, 0, False) and (True, 0, False) in seen, "before anything is refitted"
    assert seen[-1][1:] == (len(ranked[-1].assessment.refits.contenders), True) and seen[-1][1] > 0
    best, first = ranked[-1].promising[0], ranked[0].promising[0]
    assert best.name == first.name == "cogging_torque" and best.refitted_drop > 0.0 and first.refitted_drop is None
    algebra, refitted = ranked[0].predicted_rmse(first), ranked[-1].predicted_rmse(best)
    assert refitted == ranked[-1].assessment.refitted[best.name] == pytest.approx(algebra, rel=0.25)
    assert "refitted" in candidate.fall(ranked[-1], best) and "≈" in candidate.fall(ranked[0], first)
    assert "Ranked by algebra" in candidate.how_known(ranked[0], True)
    assert "Ranked by refits" in candidate.how_known(ranked[-1], False)


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
    assert discovering.look.assessment.refits is None and discovering.look.promising
    assert discovering.add("cogging_torque")
    wait_until(lambda: not discovering.running)
    assert discovering.look.removable == ["cogging_torque"]
