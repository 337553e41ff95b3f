"""Frequency response on the page: from Compare's recordings to the Bode plot, a report, and back from a session."""

from __future__ import annotations

import pytest
from support.flexible_drive import flexible_drive
from support.on_page import choose, fill, wait_until
from support.unknown_drive import drive_of

from ema_model.recordings import write_measurement
from emaviz.page.frequency import FrequencyTab

pytestmark = pytest.mark.browser


@pytest.fixture
def page(shared_page):
    return shared_page


def test_a_resonance_is_shown_kept_and_comes_back(page, app, tmp_path):
    tab, folder = app.tab(FrequencyTab), app.comparing.folder
    page.get_by_role("tab", name="Bode", exact=True).click()
    page.get_by_text("There is no frequency response yet").first.wait_for()
    page.get_by_role("button", name="Frequency response").click()
    page.get_by_text("no measurement is chosen").first.wait_for()

    drive_of(folder.actuators, False)
    write_measurement(flexible_drive(3, 22.0), folder.folder / "sweep.csv")
    page.get_by_role("tab", name="Compare", exact=True).click()
    app.comparing.choose_actuator("uploaded: actuators/motor.toml")
    app.comparing.add("sweep.csv")
    wait_until(lambda: "sweep.csv" in app.comparing.opened)
    app.comparing.job.stop()  # which compares by itself what is opened
    page.get_by_role("tab", name="Bode", exact=True).click()
    page.get_by_text("What Compare has: sweep.csv").first.wait_for()
    choose(page, "Output", "User position")
    page.get_by_role("button", name="Frequency response").click()
    wait_until(lambda: tab.analysing.job.error)
    page.get_by_text("user_position_rad is needed").first.wait_for()
    choose(page, "Output", "Motor position")
    page.get_by_role("button", name="Frequency response").click()
    wait_until(lambda: tab.analysing.result is not None)
    page.get_by_text("The measured resonance lies at 38.1").first.wait_for()
    found = tab.analysing.result
    assert found is not None and found.output == "motor_position_rad"
    charts = page.locator(".js-plotly-plot").locator("visible=true")
    wait_until(lambda: charts.count() == len(found.figures()) == 3)
    assert "Magnitude" in charts.first.inner_text()

    for name, suffix in (("Save report", ".html"), ("Save table", ".csv"), ("Record", ".rrd")):
        page.get_by_role("button", name=name, exact=True).locator("visible=true").click()
        wait_until(lambda suffix=suffix: list(folder.recordings.glob(f"*-frequency{suffix}")))

    page.get_by_role("tab", name="Runs").click()
    fill(page, "Session name", "bode")
    page.get_by_role("button", name="Save session").click()
    wait_until(lambda: folder.session_files() == ["sessions/bode.emaviz"])
    tab.analysing.result = None
    tab.analysing.choose("output", "auto")
    page.get_by_role("button", name="Load session").click()
    page.get_by_text("Session loaded").first.wait_for()
    page.get_by_role("tab", name="Bode", exact=True).click()
    page.get_by_text("The measured resonance lies at 38.1").locator("visible=true").first.wait_for()
    assert str(tab.analysing.result) == str(found) and tab.analysing.chosen["output"] == "motor"
    assert not tab.analysing.job.running
