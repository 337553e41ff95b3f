"""Tab, right side, clock and address of a window belong together; results and discoveries come back as they were."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.on_page import press, wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.page.explore import ExploreTab

pytestmark = pytest.mark.browser

RIGHT = {
    "Explore": "Signals",
    "Identify": "Search",
    "Compare": "Comparison",
    "Discover": "Discovery",
    "Library": "Effect",
    "Runs": "Rerun",
}


# When the page has pressed which of the buttons that nobody sees, ms.
PRESSES = """
window.presses = [];
addEventListener('click', event => {
  const name = event.target.textContent;
  if (/^(view|front|inner[A-Z][a-z]+):/.test(name)) window.presses.push([name, performance.now()]);
}, true);
"""


@pytest.fixture(scope="module")
def tab(browser, app):
    """One window for all tests here."""
    app.strip.play(False)
    with browser.tab() as page:
        page.goto(app.address)
        page.get_by_role("tab", name="Explore", exact=True).wait_for(timeout=60_000)
        page.set_default_timeout(20_000)
        yield page


@pytest.fixture(scope="module")
def compared(tab, app, tmp_path_factory):
    """A recording with cogging, compared by hand."""
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 1.0)
    true = simulate_reference(run, load_actuator(), effects={"cogging_torque": {}})
    path = tmp_path_factory.mktemp("rig") / "rig.csv"
    write_measurement(Sensors(current_noise_A=0.2, encoder_bits=12).record(true, seed=1), path)
    go(tab, "Compare")
    tab.locator("input[type=file]").first.set_input_files(str(path))
    tab.get_by_text("Compared in").wait_for(timeout=120_000)
    return app.comparing.comparison


def go(page, name):
    page.get_by_role("tab", name=name, exact=True).click()
    page.get_by_role("tab", name=RIGHT[name], exact=True).wait_for()


def right(page):
    return [one.strip() for one in page.locator("[data-dock-region=right] [role=tab]").all_inner_texts()]


def test_the_right_side_and_the_address_follow_the_tab(tab, app):
    for name, first in RIGHT.items():
        go(tab, name)
        wait_until(lambda first=first: right(tab)[:1] == [first], 10.0)
        assert tab.url.endswith(f"?view={name.lower()}")
        wait_until(lambda name=name: app.playback.on == name.lower(), 10.0)


def test_what_a_window_tells_does_not_overtake_what_it_has_just_told(app, browser):
    """Its tab, its size and what stands in front: of presses within 50 ms viser sends the first and the last alone."""
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    page.add_init_script(PRESSES)
    page.goto(f"{app.address}/?view=explore")
    try:
        page.wait_for_function("presses.length >= 4", timeout=60_000)  # view, width, height, in front
        at = page.evaluate("presses")
        assert {name.partition(":")[0] for name, _ in at} == {"view", "innerWidth", "innerHeight", "front"}
        assert min(np.diff([ms for _, ms in at])) > 50.0, at
    finally:
        page.close()


@pytest.mark.long
def test_a_verdict_comes_back_after_a_visit_to_explore(tab, app, compared):
    tab.get_by_text(compared.sentences[0]).first.wait_for()
    go(tab, "Explore")
    before = app.session.simulation
    app.session.refresh()
    wait_until(lambda: app.session.simulation is not before)
    assert tab.get_by_text(compared.sentences[0]).count() == 0
    go(tab, "Compare")
    tab.get_by_text(compared.sentences[0]).first.wait_for()
    assert app.comparing.comparison is compared, "nothing was computed again"


@pytest.mark.long
def test_each_workspace_has_its_own_clock_and_there_is_one_slider(tab, app, compared):
    go(tab, "Explore")
    wait_until(lambda: app.playback.on == "explore", 10.0)
    app.playback.seek(0.1)
    go(tab, "Compare")
    wait_until(lambda: app.playback.on == "compare", 10.0)
    labels = tab.locator("label").all_inner_texts()
    assert sum(label.startswith("Moment") for label in labels) == 1
    app.playback.seek(0.7)
    one = compared.recordings[0]
    turned = 0.5 * np.interp(0.7 + one.time_s[0], one.time_s, one.measured["motor_position_rad"])
    wait_until(lambda: np.allclose(app.scene._rotor.wxyz, (np.cos(turned), np.sin(turned), 0.0, 0.0), atol=0.02), 10.0)
    tab.get_by_role("button", name="Play", exact=True).click()
    wait_until(lambda: app.playback.reels["compare"].playing and app.playback.time_s != 0.7, 10.0)
    go(tab, "Explore")
    tab.get_by_role("button", name="Play", exact=True).wait_for()  # that one rests
    assert app.playback.time_s == pytest.approx(0.1)
    go(tab, "Compare")
    tab.get_by_role("button", name="Pause", exact=True).click()
    wait_until(lambda: not app.playback.playing, 10.0)


@pytest.mark.long
def test_another_window_keeps_its_own_workspace_and_a_reload_its_place(tab, app, browser):
    go(tab, "Compare")
    other = browser.new_page(viewport={"width": 1400, "height": 900})
    other.goto(f"{app.address}/?view=library")
    other.get_by_role("tab", name="Effect", exact=True).wait_for(timeout=60_000)
    assert right(tab)[0] == "Comparison", "the first window stays where it was"
    other.reload()
    other.get_by_role("tab", name="Effect", exact=True).wait_for(timeout=60_000)
    assert other.url.endswith("?view=library")
    other.close()
    wait_until(lambda: not app.workspaces.anyone("library"), 20.0)


def test_the_actuator_of_a_window_has_no_faults_of_another_one(tab, app, browser):
    go(tab, "Discover")
    wait_until(lambda: app.playback.on == "discover", 10.0)
    app.session.settings.set_fault(1, 0.7)
    app.session.refresh()
    other = browser.new_page(viewport={"width": 1400, "height": 900})
    other.goto(f"{app.address}/?view=explore")
    other.get_by_role("tab", name="Signals", exact=True).wait_for(timeout=60_000)
    try:
        wait_until(lambda: app.playback.on == "explore" and app.scene._own, 30.0)
        here = next(window for window, name in app.workspaces.places().items() if name == "discover")
        wait_until(lambda: app.scene._faults == {"k2"}, 20.0)
        assert not app.scene._own[here]._faults, "it is Explore's plant that has them"
        tab.get_by_role("button", name="Play", exact=True).click()
        wait_until(lambda: app.playback.on == "discover" and app.playback.playing, 10.0)
        wait_until(lambda: not app.scene._faults, 10.0)
        there = next(window for window, name in app.workspaces.places().items() if name == "explore")
        wait_until(lambda: app.scene._own[there]._faults == {"k2"}, 10.0)
    finally:
        app.strip.play(False)
        other.close()
        app.session.settings.set_fault(1, 0.0)
        app.session.refresh()
    wait_until(lambda: there not in app.scene._own, 20.0)


def test_compare_leads_on_to_identify_and_discover(tab, app, compared):
    go(tab, "Compare")
    strip = tab.get_by_role("button", name="Reset view").bounding_box()["y"]
    for lead in ("Find what is missing", "Identify faults"):
        box = tab.get_by_role("button", name=lead).bounding_box()
        assert 0.0 < box["y"] < strip - box["height"], "both are seen without scrolling"
    press(tab, "Identify faults", tab.get_by_role("tab", name="Search", exact=True))
    assert app.session.settings.source == next(iter(app.comparing.opened))
    app.session.settings.set("source", "")
    go(tab, "Compare")
    press(tab, "Find what is missing", tab.get_by_role("tab", name="Discovery", exact=True))
    tab.get_by_text("The measurements and the actuator of Compare.").wait_for()
    assert "?view=discover" in tab.url
    discovering = app.discovering  # which has begun, without a second press
    wait_until(lambda: discovering.look is not None and discovering.look.assessment and not discovering.running)
    assert discovering.is_of_compare


@pytest.mark.long
def test_a_discovery_is_gone_back_to_without_computing_and_is_used_in_explore(tab, app, compared):
    go(tab, "Discover")
    discovering = app.discovering
    assert discovering.source.chosen == ""
    wait_until(lambda: not discovering.running)
    start, again = (tab.get_by_role("button", name=name, exact=True) for name in ("Start", "Start again"))
    start.or_(again).click()  # where the same was discovered before
    tab.get_by_role("button", name="Stop", exact=True).wait_for()
    wait_until(lambda: discovering.look is not None and not discovering.running)
    wait_until(lambda: discovering.look.assessment is not None)
    first, entry = discovering.look, discovering.entries.current
    discovering.choose("first_bench_run")
    tab.get_by_text("Step 1 of 6").wait_for(state="hidden")
    wait_until(lambda: discovering.entries.current is None)
    assert entry in discovering.entries.all

    tab.get_by_label("Discovery", exact=True).click()
    tab.get_by_role("option", name=entry.words).click()
    wait_until(lambda: discovering.entries.current is entry)
    assert discovering.look is first and not discovering.running, "as it was left, and nothing is computed"
    tab.get_by_text("Next: ").first.wait_for()

    tab.get_by_role("button", name="Use in Explore").click()
    tab.get_by_role("tab", name="Signals", exact=True).wait_for()
    wait_until(lambda: app.session.plants[app.session.plant] is first.found.actuator)
    tab.get_by_text(f"improved model of discovery {entry.number}").first.wait_for()
    wait_until(lambda: app.session.simulation.plant == app.session.plant)


@pytest.mark.long
def test_explore_says_its_model_and_keeps_it(tab, app):
    go(tab, "Explore")
    tab.get_by_text("model: healthy").wait_for()
    session = app.session
    session.choose_plant(next(iter(session.plants)))
    session.settings.set("algorithms", ["robust"])
    session.settings.set("iterations", 30)
    went_on = []
    session.identifying.progressed.connect(
        lambda race: went_on.extend(t.fitting for t in race.tracks.values() if t.fitting)
    )
    assert session.identify()
    wait_until(lambda: session.identifying.answer is not None and not session.worker.busy)
    assert session.settings.monitor == "healthy" and session.simulation.model == "healthy"
    tab.get_by_text("model: healthy").wait_for()
    shares = [share for _, share in went_on]
    assert any("model bias" in text for text, _ in went_on) and shares == sorted(shares) and shares[-1] == 1.0
    session.settings.set("monitor", "identified")
    session.refresh()
    tab.get_by_text(f"model: identified {session.identifying.answered_at:%H:%M}").wait_for()


@pytest.mark.long
def test_identify_answers_in_physical_units(tab, app):
    go(tab, "Identify")
    tab.get_by_role("tab", name="Answer", exact=True).click()
    tab.get_by_text("no fault seen (k3 <").wait_for()
    tab.get_by_text("no fault seen (gain ×").wait_for()
    assert tab.locator("[data-dock-region=right]").get_by_text("of turns").count() == 0
    limits = app.session.identifying.answer.uncertainty.detectable
    assert np.all(limits[[0, 2, 7]] > 0.0) and np.isnan(limits[6])


def test_a_note_stays_when_the_status_changes(tab, app):
    go(tab, "Explore")
    app.tab(ExploreTab).panel.note("Recovered a recording of an interrupted run: x.rrd")
    app.session.events.status("Ready.")
    tab.get_by_text("Ready.").wait_for()
    tab.get_by_text("Recovered a recording").wait_for()
    app.tab(ExploreTab).panel.note("")


def test_keys_change_the_workspace_and_play(tab, app):
    go(tab, "Explore")
    tab.evaluate("document.activeElement?.blur()")
    tab.keyboard.press("3")
    tab.get_by_role("tab", name="Comparison", exact=True).wait_for()
    wait_until(lambda: app.playback.on == "compare", 10.0)
    tab.keyboard.press("Space")
    wait_until(lambda: app.playback.playing, 10.0)
    tab.keyboard.press("Space")
    wait_until(lambda: not app.playback.playing, 10.0)


def test_the_guide_belongs_to_its_challenge(tab, app):
    go(tab, "Discover")
    app.discovering.choose("")
    tab.get_by_role("button", name="Guided first challenge").click()
    tab.get_by_text("Step 1 of 6").wait_for()
    app.discovering.choose("")
    tab.get_by_text("Step 1 of 6").wait_for(state="hidden")


@pytest.mark.long
def test_several_discoveries_are_saved_and_brought(app):
    saved = app.discovering.saved()
    assert saved is not None and saved["recipe"]
    entries = app.discovering.entries
    more = dataclasses.replace(entries.all[0], number=99)
    entries.all.append(more)
    both = app.discovering.saved()
    entries.all.remove(more)
    says = {one["number"]: one["says"] for one in (both, *both["others"])}
    assert says == {one.number: one.result for one in [*entries.all, more]}
