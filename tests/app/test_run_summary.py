"""What the list of runs says of each, the guide's words while a step runs, and which actuator a new workspace shows."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.quantities import with_uncertainty
from emaviz.page.discover import step
from emaviz.session.files import RecordedRuns, summary


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ({}, ("run", "")),
        ({"found": {"do": {"healthy": True, "alarms": []}}}, ("identification", "healthy")),
        ({"found": {"do": {"healthy": False, "alarms": ["k2", "k1"]}}}, ("identification", "not healthy: k1, k2")),
        (
            {
                "discovery": {
                    "verdict": "effects_found",
                    "effects": [{"name": "cogging_torque"}],
                    "ladder": [{"rmse": 1.69}, {"rmse": 0.757}],
                }
            },
            ("discovery", "cogging torque: 1.69 → 0.757 × floor"),
        ),
        (
            {"discovery": {"verdict": "unknown_effect", "effects": [], "ladder": [{"rmse": None}]}},
            ("discovery", "unknown effect"),
        ),
        ({"comparison": {"sentences": ["The model explains it.", "More."]}}, ("comparison", "The model explains it.")),
        ({"comparison": {}}, ("comparison", "")),
        ({"track": {"faults": {"k1": {"trend": True}, "k2": {"trend": False}}}}, ("tracking", "trend of k1")),
    ],
)
def test_a_run_is_named_by_what_it_is(said, told):
    assert summary(said) == told


def test_a_damaged_run_is_listed_as_one(tmp_path):
    (tmp_path / "bad.rrd").write_bytes(b"nothing")
    entry = RecordedRuns(tmp_path).entry("bad.rrd")
    assert (entry.kind, entry.says, entry.found) == ("run", "", {})


def test_the_guide_does_not_go_back_while_the_next_step_is_looked_for():
    look: Any = SimpleNamespace(removable=["cogging"], assessment=None, rmse=0.8)
    assert step(look, True, None, False)[0] == 4
    calibrating: Any = SimpleNamespace(removable=[], assessment=None, rmse=2.0)
    assert step(calibrating, True, None, False)[0] == 2


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((7.03e-4, 8.7e-8, "rad"), "703.000 ± 0.087 µrad"),
        ((0.0201, 0.00085, "N·m"), "20.1 ± 0.85 mN·m"),
        ((0.146, 0.012, ""), "0.146 ± 0.012"),
        ((1.25, 0.0004, ""), "1.25000 ± 0.00040"),
        ((1.39e-5, 3.2e-7, "kg·m²"), "(13.9 ± 0.32)·10⁻⁶ kg·m²"),
        ((1.39e-5, 3.2e-7, "N·m·s/rad"), "13.9 ± 0.32 µN·m·s/rad"),
        ((1.42e6, 18365.0, "N·m/rad³"), "1.420 ± 0.018 MN·m/rad³"),
    ],
)
def test_a_value_has_the_digits_that_its_error_leaves(given, told):
    assert with_uncertainty(*given) == told


@pytest.mark.long
@pytest.mark.browser
def test_a_workspace_with_nothing_to_play_shows_a_whole_actuator(shared_page, app):
    page, settings = shared_page, app.session.settings
    settings.set_fault(1, 0.7)
    app.session.refresh()
    wait_until(lambda: app.playback.motion is not None and app.playback.motion.callouts)
    page.get_by_role("tab", name="Compare", exact=True).click()
    wait_until(lambda: app.playback.on == "compare")
    assert app.playback.motion.callouts == () and app.playback.motion.room == 0.0
    page.get_by_role("tab", name="Identify", exact=True).click()
    wait_until(lambda: app.playback.on == "identify")
    assert [one.fault for one in app.playback.motion.callouts] == ["k2"], "the sliders' plant is what is identified"
    assert np.any(app.playback.motion.play != 0.0)
    settings.set_fault(1, 0.0)
    app.session.refresh()
