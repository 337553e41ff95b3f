"""The empty screen of each tab runs something shipped at one click, and says that it does."""

from __future__ import annotations

import pytest
from support.on_page import wait_until

from emaviz.page.fleet import UnitsTab
from emaviz.page.frequency import FrequencyTab
from emaviz.page.track import TrackTab

pytestmark = pytest.mark.browser


@pytest.fixture
def page(shared_page):
    return shared_page


def example(page, tab):
    """The button on a tab's empty screen."""
    page.locator("[data-dock-region=left]").get_by_role("tab", name=tab, exact=True).click()
    button = page.locator("button:visible", has_text="Run an example")
    button.wait_for()
    return button


def stopped(page, app, job):
    """Stops what was begun; the empty screen is back."""
    job.stop()
    wait_until(lambda: not job.running and not app.session.worker.busy)
    page.locator("button:visible", has_text="Run an example").wait_for()


def test_the_example_of_discover_is_a_challenge(page, app):
    example(page, "Discover").click()
    wait_until(lambda: app.discovering.running)
    page.get_by_text("Calibrating the model …", exact=True).first.wait_for()
    assert page.locator(".emaviz-waits:visible").count() == 3, "a picture that moves"
    assert app.discovering.source.chosen == next(iter(app.discovering.source.challenges))
    stopped(page, app, app.discovering.job)


def test_the_examples_of_units_and_track_are_made_in_the_data_folder(page, app):
    for tab, session in ((UnitsTab, app.tab(UnitsTab).comparing), (TrackTab, app.tab(TrackTab).following)):
        example(page, tab.workspace.title).click()
        wait_until(lambda session=session: session.job.running)
        page.locator(".emaviz-waits:visible").first.wait_for()
        stopped(page, app, session.job)


def test_the_example_of_runs_is_an_identification_that_is_recorded(page, app):
    assert example(page, "Identify").count() == 1
    example(page, "Runs").click()
    identifying = app.session.identifying
    wait_until(lambda: identifying.job.running)
    assert list(app.session.settings.k[:2]) == [0.25, 0.7] and app.session.settings.k[5] == 0.5
    wait_until(lambda: identifying.answer is not None and not identifying.job.running)
    assert [round(float(one), 2) for one in identifying.answer.k[:2]] == [0.25, 0.7]
    page.get_by_role("button", name="Open in Rerun, here").wait_for()
    page.get_by_text("not healthy: k1, k2, k6").first.wait_for()


def test_the_example_of_compare_holds_one_out(page, app):
    comparing = app.comparing
    example(page, "Compare").click()
    wait_until(lambda: len(comparing.opened) == 4 and comparing.running)
    assert comparing.held_out == {"uploads/unseen.parquet"}
    flow = page.get_by_role("navigation", name="Model correction").locator("visible=true")
    flow.get_by_text("4 measurements, 1 held out").wait_for()
    wait_until(lambda: comparing.finished is not None and not comparing.running)
    assert [one.name for one in comparing.finished.holdout] == ["unseen"]
    flow.get_by_text("click to look").wait_for()
    page.get_by_text("On what was not fitted, the error is").first.wait_for()
    page.get_by_label("unseen.parquet", exact=True).click()
    page.get_by_text("Out of date: what is held out").first.wait_for()
    flow.get_by_role("link", name="1 Columns").click()
    page.locator(".emaviz-map:visible").wait_for()
    flow.get_by_role("link", name="2 Fit and regions").click()
    page.locator(".emaviz-map").wait_for(state="hidden")


def test_the_example_of_bode_is_a_sweep_over_a_resonance(page, app):
    comparing, analysing = app.comparing, app.tab(FrequencyTab).analysing
    for name in list(comparing.opened):
        comparing.remove(name)
    example(page, "Bode").click()
    wait_until(lambda: analysing.job.running)
    page.locator(".emaviz-waits:visible").first.wait_for()
    wait_until(lambda: analysing.result is not None)
    page.get_by_text("The measured resonance lies at 65").locator("visible=true").first.wait_for()
    assert list(analysing.result.recordings) == ["frequency-example"] and list(comparing.opened) == [
        "uploads/frequency-example.parquet"
    ]
    assert not analysing.provenance.line("Frequency response"), "it is of what Compare has"
