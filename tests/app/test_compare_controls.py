"""Every control of Compare that no other test of the page moves."""

from __future__ import annotations

import time

import numpy as np
import pytest
from support.on_page import choose, field, fill, wait_until

from ema_model.actuator import load_actuator, save_actuator
from ema_model.commands import command
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.page.compare import CompareTab
from emaviz.recording import read

pytestmark = [pytest.mark.browser, pytest.mark.long]

FIGURES = """() => Array.from(document.querySelectorAll('.js-plotly-plot'), plot => ({
  title: plot.layout?.title?.text ?? '', y: plot.layout?.yaxis?.title?.text ?? '',
  x: plot.layout?.xaxis?.title?.text ?? '', shapes: JSON.stringify(plot.layout?.shapes ?? []) }))"""


@pytest.fixture(scope="module")
def page(browser, app):
    """One browser tab on Compare, with two recordings of the plant in the data folder."""
    assert app.session.ready.wait(120.0)
    app.strip.play(False)
    for name, frequency, effects in (("slow", 2.0, {"cogging_torque": {}}), ("quick", 5.0, {"cogging_torque": {}})):
        run = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": frequency}), 0.6)
        true = simulate_reference(run, load_actuator(), effects=effects)
        write_measurement(Sensors(0.2, 12).record(true, 1), app.comparing.folder.uploads / f"{name}.csv")
    app.tab(CompareTab).panel.refresh_files()
    with browser.tab() as page:
        page.goto(app.address)
        page.get_by_role("tab", name="Compare", exact=True).click(timeout=60_000)
        page.set_default_timeout(60_000)
        yield page


def resting(app):
    wait_until(lambda: not app.comparing.running and not app.session.worker.busy)


def figure(page, words):
    return next((one for one in page.evaluate(FIGURES) if words in one["title"]), None)


def test_files_are_added_shown_and_removed(page, app):
    for name in ("slow", "quick"):
        choose(page, "Data folder", f"uploads/{name}.csv")
        page.get_by_role("button", name="Add this file").click()
        wait_until(lambda: f"uploads/{name}.csv" in app.comparing.opened)  # noqa: B023
    resting(app)
    choose(page, "Shown", "uploads/slow.csv")
    page.get_by_role("button", name="Columns…").click()
    page.get_by_role("button", name="Use these columns").wait_for()
    page.get_by_label("Unit of current_A in the file").select_option("mA")
    page.get_by_text("chosen by you").wait_for()
    page.get_by_role("button", name="Use these columns").click()
    wait_until(lambda: np.abs(app.comparing.opened["uploads/slow.csv"].measurement["current_A"]).max() < 0.1)
    resting(app)
    choose(page, "Shown", "uploads/slow.csv")
    page.get_by_role("button", name="Remove").first.click()
    wait_until(lambda: list(app.comparing.opened) == ["uploads/quick.csv"])


def test_what_is_asked_is_set(page, app):
    comparing = app.comparing
    resting(app)
    fill(page, "User position", 0)
    wait_until(lambda: "user_position_rad" not in comparing.weights)
    fill(page, "User position", 1)
    wait_until(lambda: comparing.weights.get("user_position_rad") == 1.0)
    page.get_by_label("Only a window of time", exact=True).click()
    field(page, "From [s]").wait_for()
    fill(page, "To [s]", 0.4)
    wait_until(lambda: comparing.window_s == (0.0, 0.4))
    fill(page, "From [s]", 0.1)
    wait_until(lambda: comparing.window_s == (0.1, 0.4))
    fill(page, "From [s]", 0.9)
    page.get_by_text("must start before it ends").wait_for()
    assert comparing.window_s == (0.1, 0.4)
    page.get_by_label("Only a window of time", exact=True).click()
    wait_until(lambda: comparing.window_s is None)
    page.get_by_text("What the calibration may move").click()
    before = set(comparing.free)
    boxes = page.get_by_label("Torque constant", exact=False)
    boxes.first.click()
    wait_until(lambda: comparing.free != before)
    boxes.first.click()
    wait_until(lambda: comparing.free == before)
    page.get_by_label("Calibrate it first", exact=True).click()
    wait_until(lambda: not comparing.calibrate)
    choose(page, "Actuator", "XL330 on a pendulum")
    wait_until(lambda: comparing.actuator.name == "XL330 on a pendulum")
    choose(page, "Actuator", app.session.actuator.name)
    wait_until(lambda: comparing.actuator is app.session.actuator)


def test_an_actuators_file_is_uploaded(page, app, tmp_path):
    path = tmp_path / "mine.toml"
    save_actuator(app.session.actuator, path)
    page.locator("input[type=file]").nth(1).set_input_files(str(path))
    mine = "uploaded: actuators/mine.toml"
    wait_until(lambda: app.comparing.actuator_name == mine)
    # what is chosen already is no choice
    wait_until(lambda: page.get_by_label("Actuator", exact=True).input_value() == mine)
    choose(page, "Actuator", app.session.actuator.name)
    wait_until(lambda: app.comparing.actuator is app.session.actuator)


def test_the_comparison_is_looked_at_and_kept(page, app):
    comparing = app.comparing
    comparing.add("uploads/slow.csv")  # its columns' side file says mA
    wait_until(lambda: "uploads/slow.csv" in comparing.opened)
    resting(app)
    comparing.remove("uploads/slow.csv")
    page.get_by_role("button", name="Compare", exact=True).click()
    wait_until(lambda: comparing.running or comparing.comparison is not None)
    resting(app)
    page.get_by_text("Compared in").wait_for()
    wait_until(lambda: figure(page, "Measured and model") is not None or len(page.evaluate(FIGURES)) > 0)
    choose(page, "Signal", "Motor position")
    wait_until(lambda: any("Motor position" in one["title"] + one["y"] for one in page.evaluate(FIGURES)))
    before = [one["shapes"] for one in page.evaluate(FIGURES)]
    fill(page, "Moment [s]", 0.3)
    wait_until(lambda: [one["shapes"] for one in page.evaluate(FIGURES)] != before)
    page.get_by_role("tab", name="Against", exact=True).click()
    choose(page, "Variable", "Time")
    wait_until(lambda: any("time" in one["x"].lower() for one in page.evaluate(FIGURES)))
    with page.expect_download() as download:
        page.get_by_role("button", name="Save report").click()
    assert download.value.suggested_filename.endswith("-compare.html")
    page.get_by_role("button", name="Record", exact=True).click()
    wait_until(lambda: list(app.session.folder.glob("*-compare.rrd")))
    page.get_by_role("link", name="in Rerun").first.wait_for()
    (kept,) = app.session.folder.glob("*-compare.rrd")
    assert read(kept).signals["measurement"]


def test_a_comparison_is_stopped(page, app):
    comparing = app.comparing
    resting(app)
    comparing.calibrate = True
    before = comparing.comparison
    comparing.job.progressed.connect(lambda *_: time.sleep(0.2))  # else it is over too soon
    page.get_by_role("button", name="Compare", exact=True).click()
    wait_until(lambda: comparing.running)
    page.get_by_role("button", name="Stop", exact=True).click()
    page.get_by_text("Stopped.").wait_for()
    resting(app)
    assert comparing.comparison is before
