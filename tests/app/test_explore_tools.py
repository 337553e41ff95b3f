"""Explore's tools: a fan of severities, a load over time, undo, charts' values and pictures, keys, errors in place."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from support.on_page import choose, field, wait_until

from ema_model.actuator import load_actuator
from ema_model.faults import vector
from ema_model.simulation.run import simulate_monitor
from emaviz.page.charts import png
from emaviz.page.explore import ExploreTab
from emaviz.session.explore import SEVERITIES, fan_of
from emaviz.session.settings import Settings, Undo

# --- without a browser ------------------------------------------------------------------------------------------------


def test_a_fan_is_five_runs_of_the_slider_and_leaves_the_others():
    settings, actuator = Settings(), load_actuator()
    settings.set("k", list(vector({"k1": 0.3})))
    fan = fan_of(settings, actuator, 1)
    assert np.array_equal(fan.k[:, 1], SEVERITIES) and np.all(fan.k[:, 0] == 0.3) and not fan.note
    assert fan.labels[0] == "backlash 10.0 µrad" and fan.labels[-1] == "backlash 1.00 mrad"
    alone = simulate_monitor(settings.run(), actuator, vector({"k1": 0.3, "k2": 0.75}))
    assert np.array_equal(fan.runs[3]["current_A"], alone["current_A"])
    assert settings.k[1] == 0.0, "the sliders stay"


def test_the_direction_of_no_eccentricity_is_shown_with_one():
    fan = fan_of(Settings(), load_actuator(), 6)
    assert np.all(fan.k[:, 5] == 0.5) and "k6" in fan.note
    assert np.abs(fan.runs[0]["current_A"] - fan.runs[1]["current_A"]).max() > 0.01


def test_a_movement_of_one_control_is_one_step_back():
    settings = Settings()
    undo = Undo(settings)
    one, other = object(), object()
    assert not undo and not undo.back()
    for value in (0.1, 0.2, 0.3):
        undo.keep(one)
        settings.set_fault(0, value)
    undo.keep(other)
    settings.set("duration_s", 0.2)
    settings.set("population", 20)
    assert undo.back() and settings.duration_s == 0.5 and settings.k[0] == 0.3
    assert undo.back() and settings.k[0] == 0.0 and settings.population == 20, "a search is not Explore's"
    assert not undo.back()


def test_a_picture_is_a_png_of_its_pixels():
    data = png(np.full((3, 5, 3), 7, np.uint8))
    assert (
        data.startswith(b"\x89PNG\r\n\x1a\n") and struct.unpack(">II", data[16:24]) == (5, 3) and data.endswith(b"\x82")
    )


# --- in the browser ---------------------------------------------------------------------------------------------------


@pytest.fixture
def page(shared_page, app):
    yield shared_page
    app.session.settings.restore(Settings().saved())
    app.screen.post("as new", app.shared.tabs[next(iter(app.shared.tabs))].show_settings)


@pytest.mark.browser
def test_a_model_that_plays_the_plant_says_that_it_moves_the_sliders_and_undo_brings_them_back(page, app):
    session, panel = app.session, app.tab(ExploreTab).panel
    field(page, "k1 friction × 1.00").fill("0.3")
    wait_until(lambda: session.settings.k[0] == 0.3)
    improved = replace(session.actuator, faults={"k2": 0.5})
    app.screen.post("lead", lambda: panel.take_plant("improved model", improved))
    page.get_by_text("The sliders of Explore have moved").wait_for(timeout=10_000)
    wait_until(lambda: session.plant == "improved model" and session.settings.k[1] == 0.5)
    assert session.settings.k[0] == 0.0
    page.get_by_role("button", name="Undo", exact=True).click()
    wait_until(lambda: session.plant != "improved model" and session.settings.k[0] == 0.3)
    assert session.settings.k[1] == 0.0
    app.screen.post("suggested", lambda: panel.take(command="sine"))
    wait_until(lambda: session.settings.command == "sine")
    page.get_by_role("button", name="Undo", exact=True).click()
    wait_until(lambda: session.settings.command != "sine")


@pytest.mark.browser
def test_a_fan_comes_at_one_click_and_a_load_shows_at_once(page, app):
    settings = app.session.settings
    field(page, "k8 gain × 1.00").fill("0.8")
    wait_until(lambda: settings.k[7] == 0.8)
    field(page, "k8 gain × 1.30").wait_for()  # drawn anew, so that the press is not lost
    page.get_by_role("button", name="Fan of severities").click()
    page.locator("[role=tab][aria-selected=true]", has_text="Fan").wait_for(timeout=20_000)
    page.get_by_text("gain × 1.50").first.wait_for(timeout=20_000)
    page.get_by_role("tab", name="Signals").click()
    choose(page, "Profile", "step")
    wait_until(lambda: settings.load_shape == "step" and settings.load_torque_Nm == 20.0)
    field(page, "Step at [s]").wait_for()
    wait_until(lambda: "load_torque_Nm" in app.session.simulation.reference)
    load = app.session.simulation.reference["load_torque_Nm"]
    assert load[0] == 0.0 and load[-1] == 20.0
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Undo", exact=True).click()
    wait_until(lambda: settings.load_torque_Nm == 0.0 and settings.k[7] == 0.8)
    page.get_by_role("button", name="Undo", exact=True).click()
    wait_until(lambda: settings.k[7] == 0.5)
    assert field(page, "k8 gain × 1.00").input_value() == "0.5"


@pytest.mark.browser
def test_charts_say_their_values_and_save_themselves(page, app):
    chart = page.locator(".uplot:visible").first
    box = chart.locator(".u-over").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(box["x"] + box["width"] / 2 + 2, box["y"] + box["height"] / 2)
    said = page.locator("#emaviz-values")
    said.wait_for(timeout=10_000)
    wait_until(lambda: "plant" in said.inner_text(), 10.0)
    lines = said.inner_text().splitlines()
    assert lines[0].startswith("t") and lines[0].endswith(" s")
    assert [one.split()[0] for one in lines[1:]] == ["difference", "plant", "monitor"], "what is frozen is none"
    assert all(one.endswith(" A") for one in lines[1:])
    with page.expect_download() as saved:
        page.locator("#emaviz-save-chart").click()
    assert saved.value.suggested_filename == "emaviz Equivalent current.png"
    page.mouse.move(700, 300)


@pytest.mark.browser
def test_a_refused_value_is_said_beside_its_field_until_it_is_changed(page):
    entry = field(page, "Duration [s]")
    entry.fill("99")
    entry.press("Enter")
    beside = page.locator(".emaviz-beside")
    beside.wait_for(timeout=10_000)
    assert "99 is above 5" in beside.inner_text()
    entry.fill("0.4")
    beside.wait_for(state="detached", timeout=10_000)


@pytest.mark.browser
def test_keys_step_and_list_themselves(page, app):
    page.evaluate("document.activeElement?.blur()")  # in a field one types
    app.strip.play(True)
    page.locator("body").press("ArrowLeft")
    wait_until(lambda: not app.playback.playing, 10.0)
    app.playback.seek(before := 0.1)
    page.locator("body").press("ArrowRight")
    wait_until(lambda: app.playback.time_s > before, 10.0)
    moment = app.playback.time_s
    slider = page.get_by_role("slider").first
    slider.press("ArrowRight")
    wait_until(lambda: app.session.settings.k[0] > 0.0, 10.0)
    assert app.playback.time_s == moment, "an arrow on a slider moves that alone"
    slider.blur()
    page.keyboard.press("Control+z")
    wait_until(lambda: app.session.settings.k[0] == 0.0, 10.0)
    page.keyboard.press("?")
    page.get_by_text("List these keys").wait_for(timeout=10_000)
    page.keyboard.press("Escape")


@pytest.mark.browser
def test_a_saved_scene_has_a_link(page, app):
    written = app.comparing.folder.scenes / "there.html"
    written.write_text("<p>here</p>")
    assert page.request.get(f"{app.address.rstrip('/')}/scenes/there.html").text() == "<p>here</p>"
    for gone in ("none.html", "../recordings/x.rrd", "..%2f..%2fetc%2fpasswd", "there.txt"):
        assert page.request.get(f"{app.address.rstrip('/')}/scenes/{gone}").status in (404, 403, 400)
