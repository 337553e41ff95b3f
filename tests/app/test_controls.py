"""Every control of Explore, the playback, Identify and Recordings that no other test of a page moves."""

from __future__ import annotations

import re
import threading
import time
from dataclasses import replace

import numpy as np
import pytest
from support.on_page import choose, field, fill, wait_until

from ema_model.faults import HEALTHY
from ema_model.identification.fit import CorrectedError
from ema_model.identification.uncertainty import Suggestion
from emaviz.page.explore import ExploreTab
from emaviz.page.identify import IdentifyTab
from emaviz.recording import read
from emaviz.session.settings import Settings

pytestmark = [pytest.mark.browser, pytest.mark.long]

CHART = """(title) => {
  const charts = Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  const chart = charts.find(c => c.root.querySelector('.u-title')?.textContent === title);
  return chart ? Array.from(chart.data, a => Array.from(a)) : null;
}"""
DROP = """([name, bytes]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([new Uint8Array(bytes)], name));
  const init = { dataTransfer: transfer, bubbles: true, cancelable: true };
  document.querySelector('canvas').dispatchEvent(new DragEvent('drop', init));
}"""
MAPS = """() => Array.from(document.querySelectorAll('.js-plotly-plot'))
  .filter(p => (p.layout?.title?.text ?? '').includes('Cost around the answer'))
  .map(p => ({ z: String(p.data[0].z.shape ?? p.data[0].z.length), names: p.data.slice(1).map(d => d.name),
              x: p.layout.xaxis.title.text }))[0]"""


@pytest.fixture(scope="module")
def tab(browser, app):
    """One browser tab for all tests here."""
    assert app.session.ready.wait(120.0)
    app.strip.play(False)
    with browser.tab() as page:
        page.goto(app.address)
        page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
        page.set_default_timeout(60_000)
        yield page


@pytest.fixture
def page(tab, app):
    """The tab, the session as it was at the start."""
    app.session.settings.restore(Settings().saved())
    before = app.session.simulation
    app.tab(ExploreTab).panel.show_settings()
    app.tab(IdentifyTab).panel.show_settings()
    wait_until(lambda: app.session.simulation is not before and app.tab(ExploreTab).right.visible)
    yield tab
    app.session.identifying.job.stop()
    wait_until(lambda: not app.session.worker.busy)


def show(page, tab):
    page.get_by_role("tab", name=tab, exact=True).click()


def unfold(page, folder, label):
    """Opens a folder that is closed at first."""
    if not field(page, label).is_visible():
        page.get_by_text(folder, exact=True).click()


def chart(page, title):
    return np.array(page.evaluate(CHART, title))


def raced(app, page, seconds=60.0):
    """Presses Identify and waits for the answer."""
    done, races = threading.Event(), []

    def keep(race):
        races.append(race)
        done.set()

    app.session.identifying.identified.connect(keep)
    page.get_by_role("button", name="Identify", exact=True).click()
    assert done.wait(seconds)
    app.session.identifying.identified.disconnect(keep)
    wait_until(lambda: not app.session.worker.busy)
    return races[0]


# --- Explore ----------------------------------------------------------------------------------------------------------


def test_what_the_plant_hides_is_set(page, app):
    show(page, "Explore")
    for folder, label, value, read_back in (
        (None, "Duration [s]", 0.4, lambda s: s.duration_s),
        (None, "Load torque [N·m]", 3, lambda s: s.load_torque_Nm),
        ("Sensor noise", "Current noise [A]", 0.2, lambda s: s.current_noise_A),
        ("Sensor noise", "Encoder [bit per turn]", 14, lambda s: s.encoder_bits),
        ("State at the start", "Angle off the command [mrad]", 2, lambda s: 1e3 * s.start_offset_rad),
        ("State at the start", "Motor speed [rad/s]", 20, lambda s: s.start_speed_rad_s),
        ("State at the start", "Position in the backlash", 0.5, lambda s: s.start_side),
    ):
        if folder:
            unfold(page, folder, label)
        fill(page, label, value)
        wait_until(lambda: read_back(app.session.settings) == pytest.approx(value))  # noqa: B023
    choose(page, "Its faults", "same faults")
    wait_until(lambda: app.session.settings.monitor == "same faults")


@pytest.mark.parametrize(
    "title, name, label, value, setting",
    [
        ("Step", "step", "Final [rad]", 0.01, "final_rad"),
        ("Ramp", "ramp", "Slope [rad/s]", 0.1, "slope_rad_s"),
        ("Multisine", "multisine", "Frequencies [Hz]", "2+5", "frequencies_Hz"),
        ("Staircase", "staircase", "Dwell [s]", 0.04, "dwell_s"),
    ],
)
def test_each_command_has_its_settings(page, app, title, name, label, value, setting):
    show(page, "Explore")
    choose(page, "Command", title)
    wait_until(lambda: app.session.settings.command == name)
    fill(page, label, value)
    wait_until(lambda: str(app.session.settings.command_settings[name].get(setting)) == str(value))
    drawn = app.session.simulation
    wait_until(lambda: app.session.simulation.command == name or app.session.simulation is not drawn)


def test_the_phases_are_charted_and_signals_are_saved(page, app):  # zoom is in test_signals_page.py
    app.tab(ExploreTab).panel.set_faults(HEALTHY)
    wait_until(lambda: app.tab(ExploreTab).right.visible)
    show(page, "Signals")
    wait_until(lambda: chart(page, "Motor speed").ndim == 2)
    show(page, "Phases")
    wait_until(lambda: chart(page, "Phase currents").shape[0] == 4)
    phases = chart(page, "Phase currents")
    assert np.abs(phases[1:].sum(axis=0)).max() < 0.3 * np.abs(phases[1:]).max(), "they add up to about nothing"
    show(page, "Export")
    choose(page, "Signals of", "monitor")
    with page.expect_download() as download:
        page.get_by_role("button", name="Data as CSV").click()
    assert download.value.suggested_filename == "emaviz-run-monitor.csv"
    choose(page, "Signals of", "plant")
    show(page, "Signals")


# --- playback ---------------------------------------------------------------------------------------------------------


def test_the_strip_plays_scrubs_and_changes_the_look(page, app):
    page.get_by_role("button", name="Play", exact=True).click()
    wait_until(lambda: app.playback.playing)
    page.get_by_role("button", name="Pause", exact=True).click()
    wait_until(lambda: not app.playback.playing)
    choose(page, "Speed", "1 : 50")
    wait_until(lambda: app.playback.speed == 0.02)
    fill(page, "Moment [s]", 0.1)
    wait_until(lambda: abs(app.playback.time_s - 0.1) < 1e-3)
    fill(page, "Housing", 0.8)
    wait_until(lambda: app.scene._motor._housing.opacity == pytest.approx(0.8))
    for shown in (False, True):
        page.get_by_label("Labels", exact=True).click()
        wait_until(lambda: any(one.visible for one in app.scene._labels._handles.values()) == shown)  # noqa: B023
    page.get_by_label("Dark", exact=True).click()
    wait_until(lambda: page.evaluate("document.documentElement.dataset.mantineColorScheme") == "dark")
    page.get_by_label("Dark", exact=True).click()
    wait_until(lambda: page.evaluate("document.documentElement.dataset.mantineColorScheme") == "light")
    client = next(iter(app.server.get_clients().values()))
    client.camera.position = (5.0, 5.0, 5.0)
    page.get_by_role("button", name="Reset view").click()
    wait_until(lambda: np.linalg.norm(np.array(client.camera.position) - 5.0) > 2.0)


# --- Identify ---------------------------------------------------------------------------------------------------------


def test_stop_ends_several_searches_at_once_even_while_they_rest(page, app):
    app.session.settings.set("algorithms", ["do", "hba", "ssa"])
    app.session.settings.set("iterations", 5000)
    app.session.settings.set_fault(0, 0.3)
    app.tab(IdentifyTab).panel.show_settings()
    show(page, "Identify")
    choose(page, "Fitness", "raw")
    wait_until(lambda: app.session.settings.fitness == "raw")
    choose(page, "Fitness", "filtered")
    wait_until(lambda: app.session.settings.fitness == "filtered")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("of 5000").first.wait_for()
    page.get_by_role("button", name="Pause the search").click()
    wait_until(lambda: app.session.identifying.job.paused)
    page.get_by_role("button", name="Stop", exact=True).first.click()
    wait_until(lambda: not app.session.worker.busy)
    page.get_by_role("link", name="in Rerun").wait_for()
    assert page.get_by_text("stopped ·").count() == 3
    recording = max(app.session.folder.glob("*.rrd"), key=lambda path: path.stat().st_mtime_ns)
    assert set(read(recording).identification) == {"do", "hba", "ssa"}
    page.get_by_role("button", name="Identify", exact=True).click(trial=True)  # enabled again


def test_the_search_is_looked_at_from_all_sides_and_its_landscape_drawn(page, app):
    app.session.settings.set("algorithms", ["robust", "do"])
    app.session.settings.set("population", 20)
    app.session.settings.set("iterations", 12)
    app.session.settings.set_fault(0, 0.3)
    app.session.settings.set_fault(5, 0.4)
    app.tab(IdentifyTab).panel.show_settings()
    show(page, "Identify")
    show(page, "Search")  # an earlier answer may be in front, and then nothing tells when this one comes
    race = raced(app, page)
    page.locator("[role=tab][aria-selected=true]", has_text="Answer").wait_for(timeout=20_000)  # it comes forward
    show(page, "Search")
    choose(page, "Population view", "points over two k")
    choose(page, "Horizontal axis", "k2 backlash")
    choose(page, "Vertical axis", "k8 proportional gain")
    page.locator("svg text", has_text="k8 proportional gain").first.wait_for()

    show(page, "Answer")
    choose(page, "Algorithm shown", "Dandelion")
    found = f"{race.tracks['do'].k[0]:.3f}"
    page.locator("td", has_text=found).first.wait_for()
    choose(page, "Algorithm shown", "the best")
    page.get_by_text("Not healthy", exact=True).wait_for()
    page.get_by_text("k1 friction, k6 eccentricity").wait_for()
    page.get_by_text("90 % interval").wait_for()

    show(page, "Landscape")
    choose(page, "Horizontal k", "k1 friction")
    choose(page, "Vertical k", "k6 eccentricity")
    page.get_by_role("button", name="Draw the landscape").click()
    page.get_by_text("Held: k2").wait_for(timeout=30_000)
    wait_until(lambda: page.evaluate(MAPS) is not None and page.evaluate(MAPS)["z"].startswith("41"))
    drawn = page.evaluate(MAPS)
    assert drawn["x"].startswith("k1") and {"truth", "answer, 90 %", "Dandelion ended"} <= set(drawn["names"])
    page.get_by_text(re.compile("Dandelion (ended (in a local minimum|at the answer)|had not converged)")).wait_for()
    choose(page, "Through", "where Dandelion ended")
    choose(page, "Shown", "close to it")
    page.get_by_role("button", name="Draw the landscape").click()
    held = f"k2 {race.tracks['do'].last.k[1]:.3f}"
    page.get_by_text(f"Held: {held}").wait_for(timeout=30_000)
    choose(page, "Vertical k", "k1 friction")
    page.get_by_role("button", name="Draw the landscape").click()
    page.get_by_text("needs two different k").wait_for()


def test_a_landscape_is_stopped(page, app, monkeypatch):
    plain = CorrectedError.__call__

    def slow(self, k):
        time.sleep(0.1)
        return plain(self, k)

    monkeypatch.setattr(CorrectedError, "__call__", slow)
    show(page, "Identify")
    show(page, "Landscape")
    choose(page, "Vertical k", "k2 backlash")
    page.get_by_role("button", name="Draw the landscape").click()
    page.get_by_role("button", name="Stop drawing").click()
    page.get_by_text("Stopped at").wait_for()
    wait_until(lambda: not app.session.worker.busy)


def test_what_does_not_fit_is_taken_to_discover(page, app):
    settings = app.session.settings
    settings.set_effect("cogging_torque", "amplitude_Nm", 0.02)
    settings.set("algorithms", ["robust"])
    settings.set("population", 10)
    settings.set("iterations", 10)
    app.tab(IdentifyTab).panel.show_settings()
    show(page, "Identify")
    race = raced(app, page)
    assert not race.best.answer.uncertainty.adequate
    page.get_by_text("no fault can be told").first.wait_for()
    page.get_by_role("button", name="Look for the missing physics").click()
    page.get_by_text("Discover has the measurement").wait_for()
    wait_until(lambda: "uploads/identified plant.csv" in app.discovering.source.compared)
    assert app.discovering.source.challenge is None and list(app.comparing.opened) == ["uploads/identified plant.csv"]
    opened = app.comparing.opened["uploads/identified plant.csv"].measurement
    assert np.allclose(opened["current_A"], race.measurement["current_A"])
    show(page, "Identify")
    choose(page, "Identify", "uploads/identified plant.csv")
    wait_until(lambda: settings.source == "uploads/identified plant.csv")
    choose(page, "Identify", "The plant of Explore's sliders")
    wait_until(lambda: settings.source == "")


def test_a_separating_command_is_set_in_explore(page, app):
    race = app.tab(IdentifyTab).panel._race
    sine = Suggestion("sine", {"amplitude_rad": 0.05, "frequency_Hz": 2.0}, 0.4, 3.0)
    answer = race.best.answer
    race.best.answer = replace(answer, uncertainty=replace(answer.uncertainty, separated_by=sine))
    show(page, "Identify")
    show(page, "Answer")
    app.tab(IdentifyTab).panel._result.draw()
    page.get_by_text("a sine with amplitude 0.05 rad, frequency 2 Hz, for 0.4 s").wait_for()
    page.get_by_role("button", name="Set that command in Explore").click()
    settings = app.session.settings
    wait_until(lambda: settings.command == "sine" and settings.duration_s == 0.4)
    page.get_by_text("Explore has the command").wait_for()
    show(page, "Explore")
    wait_until(lambda: float(field(page, "Frequency [Hz]").input_value()) == 2.0)
    wait_until(lambda: app.session.simulation.reference.duration_s == pytest.approx(0.4, rel=0.01))


# --- Recordings and sessions ------------------------------------------------------------------------------------------


def test_a_recording_is_chosen_and_watched_while_it_grows(page, watched, app):
    page, session = watched, app.session  # a calm page has no canvas that the Rerun viewer could draw on
    page.set_default_timeout(60_000)
    names = [path.name for path in sorted(session.folder.glob("*.rrd"), key=lambda path: path.stat().st_mtime_ns)]
    assert len(names) >= 2
    (session.folder / names[0]).rename(session.folder / "moved by hand.rrd")
    show(page, "Runs")
    page.get_by_role("button", name="Refresh the list").click()
    page.get_by_text("moved by hand.rrd").first.wait_for()
    choose(page, "Run", "moved by hand.rrd")
    wait_until(lambda: field(page, "New name").input_value() == "moved by hand")
    choose(page, "With", names[1])
    page.get_by_role("button", name="Overlay both runs").click()
    show(page, "Two runs")
    choose(page, "Signal", "Motor speed")
    page.wait_for_function(
        "[...document.querySelectorAll('.js-plotly-plot')].some(p => JSON.stringify(p.layout).includes('rad/s'))"
    )

    session.settings.set("algorithms", ["hba"])
    session.settings.set("iterations", 5000)
    app.tab(IdentifyTab).panel.show_settings()
    show(page, "Identify")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_role("button", name="Watch it in Rerun, here").click()
    frame = page.locator("iframe.emaviz-rerun")
    frame.wait_for()
    growing = session.folder / app.tab(IdentifyTab).panel._race.growing.name
    assert growing.name in frame.get_attribute("src") and not growing.exists(), "it is still being written"
    assert page.get_by_label("Run", exact=True).input_value() == growing.name, "and in the list"
    page.get_by_role("button", name="Close the viewer").click()
    frame.wait_for(state="detached")
    show(page, "Identify")
    page.get_by_role("link", name="Watch it live").wait_for()
    page.get_by_role("button", name="Stop", exact=True).first.click()
    wait_until(growing.exists)
    page.get_by_role("button", name="Watch it in Rerun, here").wait_for(state="hidden")


def test_a_session_is_dropped_on_the_page(page, app, tmp_path):
    show(page, "Runs")
    app.session.settings.set_fault(3, 0.45)
    field(page, "Session name").fill("dropped")
    page.wait_for_timeout(300)
    with page.expect_download() as download:
        page.get_by_role("button", name="Save session").click()
    path = tmp_path / "elsewhere.emaviz"
    download.value.save_as(path)
    app.session.settings.restore(Settings().saved())
    page.evaluate(DROP, ["elsewhere.emaviz", list(path.read_bytes())])
    wait_until(lambda: app.session.settings.k[3] == 0.45)
    page.get_by_text("Session loaded").first.wait_for()
    app.session.settings.restore(Settings().saved())
    choose(page, "Saved", "sessions/dropped.emaviz")
    page.get_by_role("button", name="Load session").click()
    wait_until(lambda: app.session.settings.k[3] == 0.45)
    page.evaluate(DROP, ["bad.emaviz", [1, 2, 3]])
    page.get_by_text("is no session").wait_for()
