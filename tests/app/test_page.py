"""The page in a real browser: break the actuator, watch, identify, find it in the recording."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.on_page import wait_until

from emaviz.page.identify import IdentifyTab
from emaviz.page.window_layout import LEFT_PX
from emaviz.recording import read

pytestmark = pytest.mark.browser

CHART = """(title) => {
  const charts = Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  const chart = charts.find(c => c.root.querySelector('.u-title')?.textContent === title);
  return chart ? Array.from(chart.data, a => Array.from(a)) : null;
}"""


@pytest.fixture
def page(shared_page):
    """The module's one tab."""
    return shared_page


def row(page, label):
    """The row of a control, by how its label begins."""
    found = page.locator("label", has_text=label).first
    return found.locator("xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]")


def set_slider(page, label, value):
    box = row(page, label).locator("input:not([type=hidden])").first
    box.fill(str(value))
    box.press("Enter")


def chart(page, title):
    return np.array(page.evaluate(CHART, title))


def test_charts_show_both_models_with_units(page):
    for title, unit in (("Equivalent current", "A"), ("User position", "mrad"), ("Motor speed", "rad/s")):
        data = chart(page, title)
        assert data.shape[1] > 300 and np.all(np.isfinite(data))
        assert data[0, 0] == 0.0 and data[0, -1] == pytest.approx(0.5, abs=0.01)
        reference, monitor = data[3], data[4]
        assert np.std(reference) > 0 and np.corrcoef(reference, monitor)[0, 1] > 0.99, unit


def test_a_slider_breaks_the_actuator_and_reset_heals_it(page, app):
    before = chart(page, "Equivalent current")
    set_slider(page, "k1", 0.8)
    wait_until(lambda: app.session.settings.k[0] == 0.8)
    wait_until(lambda: not np.array_equal(chart(page, "Equivalent current"), before))
    row(page, "k1 friction × 2.60").wait_for()
    labels = page.locator("label:visible").filter(has_text=re.compile(r"^k[1-8] "))
    assert labels.count() == 8 and all(one.bounding_box()["height"] < 30.0 for one in labels.all()), "a line each"
    page.wait_for_timeout(300)
    broken = chart(page, "Equivalent current")
    assert np.abs(broken[3]).mean() > 1.2 * np.abs(before[3]).mean()
    assert np.abs(broken[1]).max() > 3.0 * np.abs(before[1]).max()  # the healthy monitor does not follow
    page.get_by_role("button", name="Reset to healthy").click()
    wait_until(lambda: app.session.settings.k[0] == 0.0)
    wait_until(lambda: np.allclose(chart(page, "Equivalent current")[3], before[3]))


def test_the_command_and_its_settings_reach_the_plant(page, app):
    page.get_by_label("Command", exact=True).click()
    page.get_by_role("option", name="Sine", exact=True).click()
    wait_until(lambda: app.session.settings.command == "sine")
    page.get_by_label("Frequency [Hz]", exact=True).fill("4")
    page.get_by_label("Frequency [Hz]", exact=True).press("Enter")
    wait_until(lambda: app.session.settings.run().command.settings()["frequency_Hz"] == 4.0)
    wait_until(lambda: abs(np.abs(chart(page, "Motor speed")[3]).max() - 0.005 * 500 * 2 * np.pi * 4) < 15.0)
    page.get_by_label("Command", exact=True).click()
    page.get_by_role("option", name="Chirp", exact=True).click()
    wait_until(lambda: app.session.settings.command == "chirp")


def test_a_bad_value_is_told_and_the_page_goes_on(page, app):
    page.get_by_label("End time [s]", exact=True).fill("0")
    page.get_by_label("End time [s]", exact=True).press("Enter")
    page.locator(".emaviz-beside", has_text="end_time_s must be above 0").wait_for(timeout=10_000)
    assert app.session.settings.run().command.settings()["end_time_s"] == 0.5
    set_slider(page, "k2", 0.5)
    wait_until(lambda: app.session.settings.k[1] == 0.5)
    page.get_by_role("button", name="Reset to healthy").click()
    wait_until(lambda: app.session.settings.k[1] == 0.0)


@pytest.mark.long
def test_identify_runs_ends_and_is_recorded(new_page, app):
    page = new_page
    set_slider(page, "k1", 0.25)
    wait_until(lambda: app.session.settings.k[0] == 0.25)
    page.get_by_role("tab", name="Identify").click()
    page.get_by_label("Dandelion", exact=True).click()
    wait_until(lambda: app.session.settings.algorithms == ("robust", "do"))
    page.get_by_label("Robust", exact=True).click()
    wait_until(lambda: app.session.settings.algorithms == ("do",))
    page.get_by_role("button", name="Identify").dblclick()  # one run, not two
    page.get_by_role("link", name="in Rerun").wait_for(timeout=120_000)
    page.get_by_text("· Err").first.wait_for()
    track = app.session.identifying.race.tracks["do"]
    assert len(track.rmse) == 151 and np.all(np.diff(track.rmse) <= 0.0)
    # what is drawn of an ended race is corrected; the search ranks by the uncorrected error, so that it may rise
    np.testing.assert_allclose(chart(page, "Convergence")[1], track.corrected, rtol=1e-6)  # a page has 32 bits

    recordings = list(app.session.folder.glob("*.rrd"))
    assert len(recordings) == 1
    recording = read(recordings[0])
    found = recording.identification["do"]
    assert np.allclose(found.best[-1], app.session.identifying.answer.k)
    assert abs(found.best[-1][0] - 0.25) < 0.02
    assert recording.truth[0] == pytest.approx(0.25)

    page.get_by_role("tab", name="Runs").click()
    page.get_by_role("link", name=recordings[0].name).wait_for()


def test_stop_is_quick_and_keeps_the_result(page, app):
    app.session.settings.set("algorithms", ["do"])  # as its iterations are many
    app.tab(IdentifyTab).panel.show_settings()
    page.get_by_role("tab", name="Identify").click()
    page.get_by_label("Iterations", exact=True).fill("5000")
    page.get_by_label("Iterations", exact=True).press("Enter")
    wait_until(lambda: app.session.settings.iterations == 5000)
    page.get_by_role("button", name="Identify").click()
    wait_until(lambda: app.session.worker.busy)
    page.get_by_text("of 5000").first.wait_for(timeout=30_000)
    page.get_by_role("button", name="Stop").click()
    page.get_by_text("stopped ·").wait_for(timeout=30_000)
    assert not app.session.worker.busy
    assert app.session.identifying.answer.stopped
    page.get_by_label("Iterations", exact=True).fill("150")
    page.get_by_label("Iterations", exact=True).press("Enter")
    wait_until(lambda: app.session.settings.iterations == 150)


@pytest.mark.long
def test_sliders_answer_while_an_identification_runs(page, app):
    page.get_by_role("tab", name="Identify").click()
    page.get_by_label("Iterations", exact=True).fill("2000")
    page.get_by_label("Iterations", exact=True).press("Enter")
    wait_until(lambda: app.session.settings.iterations == 2000)
    page.get_by_role("button", name="Identify").click()
    wait_until(lambda: app.session.worker.busy)
    page.get_by_role("tab", name="Explore").click()
    before = chart(page, "Equivalent current")
    set_slider(page, "k3", 0.6)
    wait_until(lambda: not np.array_equal(chart(page, "Equivalent current"), before))
    assert app.session.worker.busy
    app.session.identifying.job.stop()
    wait_until(lambda: not app.session.worker.busy)


def test_all_tabs_stand_in_one_line_at_any_width_and_the_strip_holds_its_controls(page):
    tabs = page.locator("[data-dock-region=left] [data-dock-tab]")
    assert [name.strip() for name in tabs.all_inner_texts()] == [
        "Explore", "Identify", "Compare", "Discover", "Units", "Track", "Bode", "Library", "Runs"
    ]  # fmt: skip
    for width in (1100, 1400):
        page.set_viewport_size({"width": width, "height": 900})
        boxes = [tab.bounding_box() for tab in tabs.all()]
        assert len({round(box["y"]) for box in boxes}) == 1 and boxes[-1]["x"] + boxes[-1]["width"] <= LEFT_PX
    strip = page.locator("[data-floating-window]:has(.emaviz-strip)")
    for name in ("Play", "Reset view"):
        assert strip.get_by_role("button", name=name, exact=True).bounding_box()["x"] < 1400
