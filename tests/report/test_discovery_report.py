"""The report of a discovery: it says what was found, draws offline, and takes no text for more than text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.discovered import with_cogging, with_unknown

from ema_model.discovery import Discovery
from ema_model.discovery.result import Experiment
from ema_model.discovery.words import value
from ema_model.errors import InputError
from ema_model.quantities import number
from emaviz.figures import discovery
from emaviz.text.html import mathml
from emaviz.views.report import export

HOSTILE = '</script><script>window.bad = 1</script><img src="x" onerror="window.bad = 2">&amp;'


@pytest.fixture(scope="module")
def found() -> Discovery:
    return with_cogging()


@pytest.fixture(scope="module")
def report(found: Discovery, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    rival = replace(found.effects[0], same_as=("torque_ripple",))
    told = replace(found, effects=[rival], parameters_outside_tolerance=("motor.inertia_kgm2",))
    export(told, path, {"files": ["sine.csv", "chirp.csv"], "max_effects": 1, "json": None})
    return path


@pytest.fixture(scope="module")
def unknown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "unknown.html"
    export(with_unknown(), path)
    return path


def _own_text(path: Path) -> str:
    """The page without the library that draws."""
    return re.sub(r"<script>/\*\*.*?</script>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)


def _section(path: Path, anchor: str) -> str:
    found = re.search(rf'<section id="{anchor}">(.*?)</section>', _own_text(path), flags=re.DOTALL)
    assert found is not None, anchor
    return found[1]


def test_verdict_stands_first_in_plain_words(report, found):
    text = _section(report, "verdict")
    assert (
        "The model lacks cogging torque or torque ripple, which cannot be told apart." in text
        and "effects found" in text
    )
    first, last = found.ladder[0], found.ladder[-1]
    assert f"from {number(first.rmse)} to {number(last.rmse)} times the floor" in text
    assert "cannot tell cogging torque from torque ripple" in text and "motor inertia" in text


def test_each_effect_has_equation_cause_parameters_and_rivals(report, found):
    text = _section(report, "added")
    assert mathml("T = A sin(h θ + φ)", "inline") in text
    assert "magnets pull" in text and "Could as well be: torque ripple" in text
    amplitude = found.calibration.parameters["effects.cogging_torque.amplitude_Nm"]
    assert f">{value(amplitude)}<" in text and "± " in value(amplitude) and ">12 (chosen)<" in text


def test_no_number_of_the_ladder_lies_on_the_floor(found):
    steps = ((3.0, 2.0), (0.7, 0.3), (1.05, 1.02))
    rungs = [replace(found.ladder[0], rmse=rmse, holdout_rmse=held) for rmse, held in steps]
    fitted, held_out, *_ = discovery.error_ladder(replace(found, ladder=rungs)).data
    assert fitted.textposition == ("top center", "middle right", "top center"), "above 0.7 it would reach over 1"
    assert held_out.textposition == ("bottom center",) * 3, "the floor runs through the marker of 1.02"


def test_ladder_tells_every_signal_in_its_unit(report, found):
    text = _section(report, "ladder")
    assert f"{found.ladder[-1].holdout_rmse:.3f}" in text
    assert f"{found.ladder[-1].signals['current_A']:.3f} A" in text and "mrad" in text


def test_candidates_that_cannot_be_shown_are_told(report):
    text = _section(report, "candidates")
    assert ">Dead time</td>" in text and "these recordings cannot show it" in text and "Cogging torque" in text


def test_it_says_how_it_was_made(report):
    text = _section(report, "made")
    assert "sine.csv, chirp.csv" in text and "numba" in text and "json" not in text


def test_next_experiment_is_told_only_where_there_is_one(report):
    assert 'id="next"' not in _own_text(report)


def test_next_experiment_and_warnings_are_in_plain_words(found, tmp_path):
    rivals = ("asymmetric_friction", "current_sensor_bias")
    best = Experiment("step", {"final_rad": 0.01}, 0.5, 12.0, "motor_position_rad", rivals, 140.0)
    export(replace(found, next_experiment=best, warnings=("Look here.",)), tmp_path / "r.html")
    text = _section(tmp_path / "r.html", "next")
    assert "Record a step with final 0.01 rad, for " in text and "12.0 N·m" in text and "motor position as well" in text
    assert "asymmetric friction and current sensor bias apart" in text and "140" in text
    assert "Look here." in _section(tmp_path / "r.html", "verdict")


@pytest.mark.long
def test_unknown_effect_is_shown_as_a_curve(unknown):
    assert "none of the known effects explains" in _section(unknown, "verdict")
    assert 'id="missing-curve"' in _section(unknown, "missing")
    assert 'id="added"' not in _own_text(unknown)


def test_every_link_leads_somewhere(report):
    text = _own_text(report)
    assert set(re.findall(r'href="#([^"]+)"', text)) <= set(re.findall(r'id="([^"]+)"', text))


def test_hostile_names_stay_text(found, tmp_path):
    windows = [replace(window, name=HOSTILE) for window in found.plant.windows]
    plant = found.plant
    kept, plant.windows = plant.windows, windows
    try:
        told = replace(found, actuator=replace(found.actuator, name=HOSTILE), warnings=(HOSTILE,))
        export(told, tmp_path / "r.html", {"files": [HOSTILE]})
    finally:
        plant.windows = kept
    text = _own_text(tmp_path / "r.html")
    assert "window.bad" in text  # it is shown
    assert "<script>window" not in text and "<img" not in text and 'onerror="' not in text


@pytest.mark.parametrize(("place", "why"), [(".", "is a folder"), ("none/r.html", "does not exist")])
def test_a_place_that_cannot_be_written_is_told_in_one_line(found, tmp_path, place, why):
    with pytest.raises(InputError, match=why) as error:
        export(found, tmp_path / place)
    assert "\n" not in str(error.value) and str(tmp_path) in str(error.value)


@pytest.fixture
def tab(browser: Any) -> Iterator[Any]:
    """A page in a browser whose network is blocked; what it asked for and complained of is kept."""
    context = browser.new_context(offline=True, viewport={"width": 1400, "height": 900})
    tab = context.new_page()
    tab.asked, tab.complaints = [], []
    tab.on("request", lambda request: tab.asked.append(request.url))
    tab.on("console", lambda message: tab.complaints.append(message.text))
    tab.on("pageerror", lambda error: tab.complaints.append(str(error)))
    yield tab
    context.close()


@pytest.mark.long
@pytest.mark.browser
@pytest.mark.parametrize("which", ["report", "unknown"])
def test_all_figures_are_drawn_without_network_and_every_axis_has_its_unit(which, tab, request):
    tab.goto(request.getfixturevalue(which).as_uri())
    tab.evaluate("document.querySelectorAll('details').forEach((part) => { part.open = true; })")
    for place in tab.locator("[data-figure]").all():
        place.scroll_into_view_if_needed()
        place.locator("svg.main-svg").first.wait_for(timeout=20_000)
    assert tab.complaints == []
    assert [url for url in tab.asked if not url.startswith(("file:", "data:", "blob:"))] == []
    count = tab.locator("[data-figure]").count()
    drawn = tab.evaluate(
        "[...document.querySelectorAll('[data-figure]')].filter((f) =>"
        " f.querySelector('.scatterlayer path, .barlayer path')).length"
    )
    assert count >= 5 and drawn == count
    titles = tab.locator("[data-figure] .ytitle, [data-figure] .xtitle").all_text_contents()
    assert "Error / floor [-]" in titles and "Time [s]" in titles
    assert all(re.search(r"\[.+\]$", title) for title in titles if title)
    assert tab.evaluate("document.documentElement.scrollWidth <= innerWidth + 1")  # nothing sticks out
