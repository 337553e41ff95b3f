"""Explore in a real browser and without one: presets, what the plant hides, ghosts, numbers, what can be saved."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.recordings import Measurement
from ema_model.recordings.read import read_measurement
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from emaviz.figures import runs as runs_figures
from emaviz.figures.lines import within
from emaviz.figures.runs import at, beneath, differences, metrics, rise_time_s, run_metrics_table
from emaviz.page.explore import CUSTOM, PRESETS, ExploreTab, name_of
from emaviz.page.identify import IdentifyTab
from emaviz.session.explore import Session
from emaviz.session.settings import Settings

CHART = """(title) => {
  const charts = Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  const chart = charts.find(c => c.root.querySelector('.u-title')?.textContent === title);
  return chart ? Array.from(chart.data, a => Array.from(a)) : null;
}"""


@pytest.fixture
def page(shared_page):
    """The module's one tab."""
    return shared_page


def chart(page, title):
    return [np.array(line) for line in page.evaluate(CHART, title)]


@pytest.fixture(scope="module")
def runs():
    actuator, run = load_actuator(), Run(command("step", {"final_rad": 0.005}), 0.5)
    return simulate_reference(run, actuator), simulate_monitor(run, actuator)


# --- without a browser ------------------------------------------------------------------------------------------------


def test_presets_are_the_thesis_cases():
    assert np.array_equal(PRESETS["healthy"], HEALTHY) and len(PRESETS) == 12
    changed = {name: np.flatnonzero(k != HEALTHY).tolist() for name, k in PRESETS.items()}
    assert changed["friction, low"] == [0] and changed["proportional gain, high"] == [7]
    assert changed["eccentricity, high"] == [5] and len(changed["several faults, as in the thesis"]) == 5
    for name, k in PRESETS.items():
        assert name_of(k) == name and np.all((0.0 <= k) & (k <= 1.0))
    assert name_of(np.full(8, 0.123)) == CUSTOM


def test_rise_time_of_a_known_ramp():
    time_s = np.arange(1001) * 1e-3
    user = np.clip(time_s / 0.5, 0.0, 1.0)
    run = Measurement({"time_s": time_s, "command_rad": np.ones(1001), "user_position_rad": user}, name="ramp")
    assert rise_time_s(run) == pytest.approx(0.4, abs=1e-6)
    short = Measurement({**run.signals, "user_position_rad": 0.5 * user}, name="stuck")
    assert math.isnan(rise_time_s(short))


def test_metrics_are_those_of_the_signals(runs):
    reference, monitor = runs
    found = metrics(reference, "step")
    assert found["peak current"] == np.abs(reference["current_A"]).max()
    assert found["rms following error"] == pytest.approx(
        1e3 * np.sqrt(np.mean((reference["command_rad"] - reference["user_position_rad"]) ** 2))
    )
    assert 1.0 < found["rise time 10–90 %"] < 500.0
    assert "rise time 10–90 %" not in metrics(reference, "chirp"), "only a step has one"
    error, unit = differences(reference, monitor)["User position"]
    assert unit == "µrad" and error == pytest.approx(
        1e6 * np.sqrt(np.mean((monitor["user_position_rad"] - reference["user_position_rad"]) ** 2))
    )
    assert all(value == 0.0 for value, _ in differences(reference, reference).values())


def test_a_number_that_is_missing_has_its_reason(runs):
    """Of a step that is not reached, of a chirp beside it and of a run that diverged; a chirp alone has no such row."""
    reference, _ = runs
    stuck = Measurement({**reference.signals, "user_position_rad": 0.0 * reference.time_s}, name="stuck")
    errors = {"frozen run's": {"Current": (math.nan, "A")}}
    found = run_metrics_table(
        {"plant": metrics(stuck, "step"), "frozen": metrics(reference, "chirp")}, errors, ["red", "blue"]
    )
    assert [found.count(f">{why}<") for why in ("not reached", "no step", "diverged")] == [1, 1, 1]
    assert "rise time" not in run_metrics_table({"plant": metrics(reference, "chirp")}, errors, ["red"])


def test_a_run_that_diverged_has_its_numbers(runs):
    reference, _ = runs
    far = Measurement({**reference.signals, "current_A": np.full(len(reference.time_s), -3e200)}, name="diverged")
    assert metrics(far, "step")["rms current"] == pytest.approx(3e200)


def test_a_frozen_run_is_hidden_where_it_has_no_values(runs):
    reference, _ = runs
    later = reference.time_s + 0.25
    frozen = at(reference, "current_A", later)
    assert np.isnan(frozen[-1]) and frozen[0] == pytest.approx(
        np.interp(0.25, reference.time_s, reference["current_A"])
    )
    drawn = beneath(frozen, np.full(len(later), 7.0))
    assert np.all(np.isfinite(drawn)) and drawn[-1] == 7.0 and drawn[0] == frozen[0]
    assert np.all(np.isnan(at(None, "current_A", later)))


@pytest.mark.parametrize("window", [(0.0, 0.5), (0.1, 0.2), (0.5, 0.5), (9.0, 10.0)])
def test_a_window_keeps_two_samples_or_more(window):
    time_s = np.arange(5001) * 1e-4
    shown = time_s[within(time_s, window)]
    assert len(shown) >= 2 and shown[0] <= max(window[0], shown[0])
    if window == (0.1, 0.2):
        assert shown[0] == pytest.approx(0.1) and shown[-1] == pytest.approx(0.2)


def test_the_large_plot_has_units_and_every_line(runs):
    figure = runs_figures.run_signals(*runs, runs[0], (0.1, 0.2))
    assert len(figure.data) == 4 * 3 + 1
    titles = [figure.layout[f"yaxis{i}"].title.text for i in ("", "2", "3", "4")]
    assert all("[" in title for title in titles) and figure.layout.xaxis4.title.text == "Time [s]"
    assert figure.layout.xaxis.range == (0.1, 0.2)


@pytest.mark.parametrize("value", [math.nan, math.inf, "abc", None, "", [], {}, "<script>", 1e9])
@pytest.mark.parametrize(
    "name", ["current_noise_A", "encoder_bits", "start_offset_rad", "start_speed_rad_s", "start_side"]
)
def test_nonsense_in_the_plant_is_refused_and_changes_nothing(name, value):
    settings = Settings()
    before = settings.saved()
    with pytest.raises(InputError) as told:
        settings.set(name, value)
    assert "\n" not in str(told.value)
    assert settings.saved() == before


def test_effects_are_hidden_changed_and_taken_out():
    settings = Settings()
    settings.set_effect("cogging_torque", "amplitude_Nm", 0.012)
    assert settings.effects["cogging_torque"]["amplitude_Nm"] == 0.012
    before = settings.effects
    for name, parameter, value in (
        ("cogging_torque", "amplitude_Nm", 1e9),
        ("cogging_torque", "amplitude_Nm", "x"),
        ("cogging_torque", "colour", 1.0),
        ("no_such_effect", None, None),
        ("../etc", None, None),
    ):
        with pytest.raises(InputError):
            settings.set_effect(name, parameter, value)
        assert settings.effects == before
    settings.remove_effect("cogging_torque")
    settings.remove_effect("cogging_torque")
    assert settings.effects == {}


def test_the_plant_is_simulated_as_it_is_set(tmp_path):
    session = Session(load_actuator(), tmp_path)
    shown = []
    session.events.simulated.connect(shown.append)
    session.start()
    wait_until(lambda: shown, 120.0)

    def simulated():
        shown.clear()
        session.refresh()
        wait_until(lambda: shown, 60.0)
        return shown[-1]

    try:
        settings = session.settings
        plain = simulated()
        settings.set("start_offset_rad", 0.002)
        settings.set("start_speed_rad_s", 50.0)
        moved = simulated()
        for run in (moved.reference, moved.monitor):
            assert run["user_position_rad"][0] == pytest.approx(0.002)
        assert moved.reference["motor_speed_rad_s"][1] > 20.0 > moved.monitor["motor_speed_rad_s"][1]
        settings.set("start_offset_rad", 0.0)
        settings.set("start_speed_rad_s", 0.0)
        settings.set("current_noise_A", 0.5)
        noisy = simulated()
        added = noisy.reference["current_A"] - plain.reference["current_A"]
        assert np.std(added) == pytest.approx(0.5, rel=0.05)
        assert np.array_equal(noisy.monitor["current_A"], plain.monitor["current_A"])
        settings.set("current_noise_A", 0.0)
        settings.set_effect("viscous_friction", *_strong("viscous_friction"))
        hidden = simulated()
        assert not np.allclose(hidden.reference["current_A"], plain.reference["current_A"], atol=0.01)
        assert np.array_equal(hidden.monitor["current_A"], plain.monitor["current_A"])
    finally:
        session.close()


def _strong(name):
    return CATALOGUE[name].parameters[0].name, CATALOGUE[name].severities[2]


# --- in a browser -----------------------------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.browser
def test_a_preset_moves_the_sliders_and_a_slider_leaves_the_preset(page, app):
    page.get_by_label("Preset", exact=True).click()
    page.get_by_role("option", name="friction, high", exact=True).click()
    wait_until(lambda: app.session.settings.k[0] == 0.75)
    page.get_by_text("k1 friction × 2.50").wait_for()
    box = page.locator("label", has_text="k2").first.locator(
        "xpath=ancestor::div[contains(@class,'mantine-Flex-root')][1]"
    )
    box.locator("input:not([type=hidden])").first.fill("0.3")
    wait_until(lambda: app.tab(ExploreTab).panel._preset.value == CUSTOM)
    page.get_by_role("button", name="Reset to healthy").click()
    wait_until(lambda: app.tab(ExploreTab).panel._preset.value == "healthy" and app.session.settings.k[1] == 0.0)


@pytest.mark.browser
def test_a_frozen_run_stays_while_the_plant_changes(page, app):
    wait_until(lambda: app.session.simulation is not None)
    healthy = chart(page, "Equivalent current")[3]
    page.get_by_role("button", name="Freeze this run").click()
    wait_until(lambda: app.tab(ExploreTab).charts.ghost is not None)
    app.tab(ExploreTab).panel.set_faults([0.8, *HEALTHY[1:]])
    wait_until(lambda: not np.allclose(chart(page, "Equivalent current")[3], healthy))
    page.wait_for_timeout(400)
    data = chart(page, "Equivalent current")
    assert np.allclose(data[2], healthy, atol=0.2) and not np.allclose(data[3], healthy, atol=0.2)
    page.get_by_role("tab", name="Metrics").click()
    page.get_by_text("frozen plant").wait_for()
    page.get_by_role("tab", name="Signals").click()
    page.get_by_role("button", name="Remove the frozen run").click()
    wait_until(lambda: app.tab(ExploreTab).charts.ghost is None)
    app.tab(ExploreTab).panel.set_faults(HEALTHY)


@pytest.mark.browser
def test_phases_are_drawn_where_they_are_in_front(page, app):
    """Nobody sees them behind the signals, and while a slider is dragged they would take most of the time."""
    charts, panel = app.tab(ExploreTab).charts, app.tab(ExploreTab).panel
    wait_until(lambda: not app.page.workspaces.in_front.anywhere("Phases"))
    healthy = charts._phases.handles[0].data[1].copy()
    panel.set_faults([*HEALTHY[:2], 0.5, *HEALTHY[3:]])
    wait_until(lambda: app.session.simulation.k[2] == 0.5)
    page.wait_for_timeout(500)
    assert np.array_equal(charts._phases.handles[0].data[1], healthy)
    page.get_by_role("tab", name="Phases").click()
    wait_until(lambda: np.nanmax(np.abs(chart(page, "Phase currents")[1])) > 1.05 * np.nanmax(np.abs(healthy)))
    page.get_by_role("tab", name="Signals").click()
    wait_until(lambda: not app.page.workspaces.in_front.anywhere("Phases"))
    panel.set_faults(HEALTHY)


@pytest.mark.browser
def test_an_effect_is_hidden_and_taken_out(page, app):
    page.get_by_role("button", name="Hidden effects").or_(page.get_by_text("Hidden effects")).first.click()
    title = CATALOGUE["viscous_friction"].title
    page.get_by_label("Effect", exact=True).click()
    page.get_by_role("option", name=title, exact=True).click()
    page.get_by_role("button", name="Hide it in the plant").click()
    wait_until(lambda: "viscous_friction" in app.session.settings.effects, 60.0)
    page.get_by_role("button", name="Remove the effect").click()
    wait_until(lambda: not app.session.settings.effects, 60.0)
    wait_until(lambda: page.get_by_role("button", name="Remove the effect").count() == 0)


@pytest.mark.browser
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_saved_data_are_the_run(page, app, tmp_path, suffix):
    page.get_by_role("tab", name="Export").click()
    with page.expect_download(timeout=30_000) as download:
        page.get_by_role("button", name={"csv": "Data as CSV", "parquet": "Data as Parquet"}[suffix]).click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    assert path.name == f"emaviz-run-plant.{suffix}"
    read, shown = read_measurement(path), app.session.simulation.reference
    assert set(read.signals) == set(shown.signals)
    assert read["phase_b_current_A"] == pytest.approx(shown["phase_b_current_A"], abs=1e-9)


@pytest.mark.long
@pytest.mark.browser
def test_the_plot_is_saved_as_a_picture(page, app, tmp_path):
    page.get_by_role("tab", name="Export").click()
    page.get_by_role("button", name="Plot (PNG)").click()
    dialog = page.get_by_role("dialog")
    dialog.locator(".js-plotly-plot").wait_for(timeout=60_000)
    dialog.locator(".js-plotly-plot").hover()
    with page.expect_download(timeout=60_000) as download:
        dialog.locator("[data-title*=png i]").click()
    path = tmp_path / "plot.png"
    download.value.save_as(path)
    assert path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 20_000
    dialog.get_by_role("button", name="Close").click()
    dialog.wait_for(state="detached")


@pytest.mark.long
@pytest.mark.browser
def test_the_scene_is_saved_and_opens_alone(page, app, browser, tmp_path):
    page.get_by_role("tab", name="Export").click()
    with page.expect_download(timeout=60_000) as download:
        page.get_by_role("button", name="Scene as HTML").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    alone = browser.new_page(viewport={"width": 600, "height": 400})
    alone.goto(path.as_uri())
    alone.wait_for_function(
        "window.__viserMutable?.nodePoseData?.['/actuator/motor/axis/rotor'] !== undefined", timeout=60_000
    )
    read = "() => String(window.__viserMutable.nodePoseData['/actuator/motor/axis/rotor'].wxyz)"
    first = alone.evaluate(read)
    wait_until(lambda: alone.evaluate(read) != first)
    alone.close()


@pytest.mark.long
@pytest.mark.browser
def test_the_first_visit_is_greeted_once(app, browser):
    context = browser.new_context(viewport={"width": 1400, "height": 900})
    tab = context.new_page()
    tab.goto(app.address)
    tab.get_by_role("button", name="Got it").click(timeout=60_000)
    tab.get_by_role("button", name="Got it").wait_for(state="detached")
    tab.reload()
    tab.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
    tab.wait_for_timeout(2000)
    assert tab.get_by_role("button", name="Got it").count() == 0
    context.close()


@pytest.mark.browser
def test_the_play_head_is_the_same_moment_everywhere(page, app):
    app.strip.play(False)
    app.playback.seek(0.2)
    read = """() => [...document.querySelectorAll('.u-over')].filter(e => e.clientWidth).flatMap(e =>
        [...e.querySelectorAll('.emaviz-play-line')].filter(one => one.checkVisibility())
          .map(one => one.offsetLeft / e.clientWidth))"""
    wait_until(lambda: page.evaluate(read) == [pytest.approx(0.4, abs=0.005)] * 4)
    app.playback.seek(0.1)
    wait_until(lambda: page.evaluate(read) == [pytest.approx(0.2, abs=0.005)] * 4)
    page.get_by_role("tab", name="Identify").click()
    page.get_by_text("Nothing is identified yet").wait_for()
    app.tab(IdentifyTab).result._show_search()
    page.get_by_text("Convergence").wait_for()
    page.wait_for_timeout(300)
    assert not page.evaluate(read), "not over iterations"
    app.strip.play(True)
