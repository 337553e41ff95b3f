"""The library as pages: how each effect looks in the current's residual, drawn without a script."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.effects import CATALOGUE
from ema_model.effects.user.torque import KEYS
from ema_model.quantities import variable_title
from ema_model.simulation.run import RUNS, EffectRuns, WithEffect, few_periods, simulate_monitor
from emaviz.figures.discovery import SEVERITIES, picture, pictures
from emaviz.views.effects import write_effects_reference

ACTUATOR = load_actuator()
EXACT = {  # what the residual is proportional to, in motion
    "viscous_friction": 1.0,
    "hinge_moment": 1.0,
    "pendulum_load": 1.0,
    "current_sensor_gain": 1.0,
    "inertia_error": 1.0,
}


@pytest.fixture(scope="module")
def runs() -> EffectRuns:
    """Of the thesis's actuator."""
    return EffectRuns(ACTUATOR)


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The whole reference."""
    folder = tmp_path_factory.mktemp("effects")
    write_effects_reference(folder)
    return folder


def charts(html: str) -> list[ElementTree.Element]:
    return [ElementTree.fromstring(text) for text in re.findall(r"<svg .*?</svg>", html, re.S)]


def heights(chart: ElementTree.Element) -> dict[str, np.ndarray]:
    """The y of each severity's line or dots, (n,), in pixels."""
    found = {}
    for mark in chart.iter():
        numbers = re.findall(r"-?[\d.]+", mark.get("points") or mark.get("d") or "")
        if mark.get("stroke") in dict((colour, name) for name, colour in SEVERITIES):
            places = [float(one) for one in numbers]
            found[mark.get("stroke")] = np.array(places[1::2] if mark.tag == "polyline" else places[1::3])
    return {name: found[colour] for name, colour in SEVERITIES}


@pytest.mark.long
def test_pages_are_whole_and_lead_to_each_other(pages):
    names = [*CATALOGUE, *KEYS]
    assert sorted(page.stem for page in pages.iterdir()) == sorted([*names, "index"])
    index = (pages / "index.html").read_text(encoding="utf-8")
    assert sorted(re.findall(r'href="(\w+)\.html"', index)) == sorted(names)
    for name, effect in CATALOGUE.items():
        text = (pages / f"{name}.html").read_text(encoding="utf-8")
        assert "<math" in text and all(parameter.name in text for parameter in effect.parameters)


@pytest.mark.long
@pytest.mark.parametrize("name", CATALOGUE)
def test_an_effect_has_its_picture_with_titles_and_units(pages, name):
    effect = CATALOGUE[name]
    text = (pages / f"{name}.html").read_text(encoding="utf-8")
    drawn = charts(text)
    assert len(drawn) == (1 if effect.against == "time" else 2)
    for chart, variable in zip(drawn[::-1], ("time", effect.against)):
        told = [one.text or "" for one in chart.iter("text")]
        assert any(re.fullmatch(r"Residual current \[[mµ]?A\]", one) for one in told)
        assert any(re.fullmatch(rf"{variable_title(variable)} \[.+\]", one) for one in told)
        lines = heights(chart)
        assert [*lines] == ["low", "medium", "high"] and all(len(line) >= 20 for line in lines.values())
        assert np.ptp(lines["high"]) > 20.0, "the strong one is hardly seen"
    assert re.search(r'class="legend".*low:.*medium:.*high:', text)


@pytest.mark.long
def test_the_pages_have_no_script_and_ask_no_network(pages):
    for page in pages.iterdir():
        text = page.read_text(encoding="utf-8").replace("http://www.w3.org/1998/Math/MathML", "")
        assert not re.search(r"<script|javascript:|\bon\w+=|//|url\(|@import|<img|<link", text), page.name
        assert set(re.findall(r'href="([^"]*)"', text)) <= {one.name for one in pages.iterdir()}


@pytest.mark.parametrize("name", CATALOGUE)
def test_at_its_neutral_value_an_effect_is_a_flat_line(name):
    effect, run = CATALOGUE[name], "step"
    neutral = replace(ACTUATOR, effects={name: effect.neutral})
    one = WithEffect(
        name, run, effect.neutral, simulate_monitor(RUNS[run], neutral), simulate_monitor(RUNS[run], ACTUATOR)
    )
    for chart in charts(pictures(effect, [one] * 3)):
        assert all(np.ptp(line) <= 0.2 for line in heights(chart).values())  # pixels


@pytest.mark.parametrize("name", EXACT)
def test_what_is_drawn_is_the_residual_against_the_variable_that_it_follows(runs, name):
    effect = CATALOGUE[name]
    felt = runs.severities(effect)
    moving = np.abs(felt[1].with_it["motor_speed_rad_s"]) > 20.0
    change, variable = felt[1].change("current_A")[1][moving], felt[1].against(effect.against)[moving]
    assert abs(np.corrcoef(change, variable)[0, 1]) > 0.97
    sizes = [float(np.ptp(line)) for line in heights(charts(pictures(effect, felt))[0]).values()]
    expected = [float(np.ptp(one.change("current_A")[1])) for one in felt]
    assert np.array(sizes) / sizes[2] == pytest.approx(np.array(expected) / expected[2], abs=0.02)


def test_the_saturated_run_is_the_last_to_show_what_follows_a_variable(runs):
    inertia, sag = (runs.clearest(CATALOGUE[name]) for name in ("inertia_error", "bus_voltage_sag"))
    assert inertia is not None and inertia.run != "step"
    assert sag is not None and sag.run == "step"  # the others leave the drive its voltage


def test_what_the_drive_hardly_feels_is_drawn_where_it_leaves_most(runs):
    effect = CATALOGUE["resistance_drift"]  # the current's loop makes up for it until its voltage ends
    felt = runs.severities(effect)
    assert felt[1].run == "step" and felt[1].visibility == 0.0
    assert np.ptp(heights(charts(pictures(effect, felt))[0])["high"]) > 20.0


@pytest.mark.long
@pytest.mark.browser
def test_the_ink_follows_light_and_dark(pages, browser):
    page = browser.new_page(color_scheme="light")
    page.goto((pages / "cogging_torque.html").as_uri())
    ink = "getComputedStyle(document.querySelector('svg text')).fill"
    assert page.evaluate(ink) == "rgb(0, 0, 0)"
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(ink) == "rgb(255, 255, 255)"
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")
    page.context.close()


@pytest.mark.parametrize("name", [name for name, one in CATALOGUE.items() if one.against == "motor_angle"])
def test_a_periodic_effect_is_drawn_over_a_few_periods(runs, name):
    effect = CATALOGUE[name]
    clear = runs.clearest(effect)
    (chart,) = charts(picture(effect, clear, ACTUATOR.axes))
    count = few_periods(clear.settings)[1]
    assert count >= 2 and f"folded to {count} periods" in chart.get("aria-label")
    drawn = max((path.get("d") for path in chart.iter() if path.tag.endswith("path")), key=len)
    dots = np.array(re.findall(r"M([-\d.]+) ([-\d.]+)h0", drawn), dtype=float)
    per_period = 12
    edges = np.linspace(58.0, 446.0, count * per_period + 1)  # the chart's left and right
    place = np.clip(np.digitize(dots[:, 0], edges) - 1, 0, count * per_period - 1)
    upper = np.array([-np.min(dots[place == one, 1]) for one in range(count * per_period)])
    waves = upper.reshape(count, per_period)
    assert np.ptp(waves.mean(axis=0)) > 0.2 * np.ptp(dots[:, 1]), "one sees it rise and fall"
    assert all(np.corrcoef(waves[0], wave)[0, 1] > 0.8 for wave in waves[1:]), "and do so again"
