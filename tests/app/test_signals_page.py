"""Signals on charts over time: cursors, zoom, event, spectrum, difference, recordings over each other, a picture."""

from __future__ import annotations

import contextlib
import json
import urllib.error
import urllib.request

import numpy as np
import pytest
from support.comparison_by_hand import comparison as by_hand
from support.on_page import choose, wait_until, wait_until_at_rest

from ema_model.recordings.signals import reading
from emaviz.figures import lines, runs
from emaviz.figures.lines import Lines, clipped
from emaviz.page.charts import Measuring
from emaviz.page.compare import CompareTab
from emaviz.page.compare_result import View, telling_window
from emaviz.page.explore import ExploreTab
from emaviz.server.viser_private import id_of

TIME = np.linspace(0.0, 1.0, 4001)
SINE = 2.0 * np.sin(2.0 * np.pi * 40.0 * TIME)
TWO = Lines.of("Current", "A", TIME, ("plant", "#111111", SINE), ("monitor", "#222222", SINE + TIME), difference=(1, 0))
# Left, top, width and height of the upmost chart over time, the part of time it shows, and how many points it draws.
LIVE = """() => { const { chart } = Object.values(window.__viserTestpoints.uplots).find(({ chart }) =>
  chart.root.querySelector('.u-title')?.textContent === 'Equivalent current'), box = chart.over.getBoundingClientRect();
  return [box.left, box.top, box.width, box.height, chart.scales.x.min, chart.scales.x.max, chart.data[0].length]; }"""
FIGURE = """() => { const plot = [...document.querySelectorAll('.js-plotly-plot')].find(one =>
    one.layout?.meta?.chart && one.checkVisibility());
  const box = plot?.querySelector('.nsewdrag')?.getBoundingClientRect();
  return box && [box.left, box.top, box.width, box.height, ...plot._fullLayout.xaxis.range,
    plot.data.filter(one => one.visible !== 'legendonly').length]; }"""
SHEET = "document.querySelector('.emaviz-measure-figure').layout?.title?.text"


# --- without a browser ------------------------------------------------------------------------------------------------


def test_figures_of_a_window_have_their_units_and_numbers():
    spectrum = lines.spectrum(TWO, (0.2, 0.8))
    assert spectrum.layout.yaxis.title.text == "Amplitude [A]" and spectrum.layout.xaxis.title.text == "Frequency [Hz]"
    assert "0.2 … 0.8 s" in spectrum.layout.title.text and spectrum.data[0].name == "plant, largest at 39.98 Hz"
    apart = lines.difference(TWO, (0.5, 1.0))
    assert np.allclose(apart.data[0].y, apart.data[0].x, atol=1e-6) and "monitor − plant" in apart.layout.title.text
    assert apart.data[0].name == f"rms {np.sqrt(7 / 12):.4g} A"


@pytest.mark.parametrize(
    ("asked", "window"),
    [
        ((-1.0, 2.0), None),
        ((0.2, 0.4), (0.2, 0.4)),
        ((-1.0, 0.4), (0.0, 0.4)),
        ((0.3, 0.3), (0.3, 0.30075)),
        (None, None),
    ],
)
def test_a_window_is_clipped_to_the_samples(asked, window):
    found = clipped(asked, TIME)
    assert found == (None if window is None else pytest.approx(window))


def test_recordings_are_laid_over_each_other_from_their_events_on():
    comparison = by_hand(("one", "two"))
    over, apart = runs.together(comparison, "current_A")
    assert [one.name for one in over.lines][:4] == [
        "one, measured",
        "one, calibrated",
        "one, uncalibrated",
        "two, measured",
    ]
    assert over.lines[3].colour == over.lines[4].colour != over.lines[0].colour and len(apart.lines) == 2
    assert over.lines[0].time_s[0] == 0.0 and "start" in over.time
    step = TIME > 0.5
    for i, one in enumerate(comparison.recordings):
        one.measured["user_position_rad"][:] = np.interp(one.time_s, TIME + 0.1 * i, step.astype(float))
    over, _ = runs.together(comparison, "user_position_rad")
    risen = [one.time_s[np.argmax(one.values > 0.5 * one.values.max())] for one in (over.lines[0], over.lines[3])]
    assert "event" in over.time and risen[0] == pytest.approx(risen[1], abs=0.01)
    window = telling_window(View(comparison))
    assert window is not None and window[0] < 0.5 < window[1] and window[1] - window[0] < 0.1


# --- in a browser -----------------------------------------------------------------------------------------------------


@pytest.fixture
def page(shared_page):
    return shared_page


def click(page, chart, share):
    left, top, width, height, *_ = page.evaluate(chart)
    page.mouse.click(left + share * width, top + 0.5 * height)


def span(page, chart):
    """Start and end of the time that a chart shows, s: (2,); nan while it is drawn anew."""
    return np.array(page.evaluate(chart)[4:6], dtype=float)


def drag(page, chart, start, end):
    """Zooms by the mouse; again where the chart was drawn anew under it, which ends a drag."""
    before = span(page, chart)
    for _ in range(3):
        left, top, width, height, *_ = page.evaluate(chart)  # it may have moved, too
        page.mouse.move(left + start * width, top + 0.5 * height)
        page.mouse.down()
        page.mouse.move(left + end * width, top + 0.5 * height, steps=3)
        page.mouse.up()
        with contextlib.suppress(AssertionError):
            return wait_until(lambda: np.any(np.abs(span(page, chart) - before) > 1e-6), 10.0)
    raise AssertionError("a drag does not zoom")


def shows(page, chart, window, within):
    """Waits until the chart shows this part of time."""
    wait_until(lambda: np.allclose(span(page, chart), window, atol=within), 20.0)


def table(page):
    """The box of the cursors: for each line its numbers, by its name."""
    rows = page.locator(".emaviz-measure-table tr").all()[1:]
    cells = [[cell.text_content() for cell in row.locator("td").all()] for row in rows]
    return {name: [float(one.replace("−", "-")) for one in numbers] for name, *numbers in cells}


@pytest.mark.browser
def test_a_run_is_measured_zoomed_and_looked_into(page, app, tmp_path):
    app.session.settings.set("command", "step")
    app.session.refresh()
    wait_until(lambda: app.session.simulation.command == "step" and page.evaluate(LIVE)[6] > 0.8 * lines.POINTS)
    run = app.session.simulation.reference
    shows(page, LIVE, (run.time_s[0], run.time_s[-1]), 0.02)  # and not the run before it
    wait_until_at_rest(page, LIVE)
    start, end = span(page, LIVE)
    click(page, LIVE, 0.2)
    page.get_by_text("Click once more for B").wait_for()
    page.wait_for_timeout(450)  # no double click
    click(page, LIVE, 0.6)
    page.get_by_role("button", name="Zoom to A – B").wait_for()
    a, b = page.evaluate("window.emavizMeasure.cursors()")
    assert b - a == pytest.approx(0.4 * (end - start), rel=0.01)
    page.get_by_text(f"Δt {b - a:.4g} s").wait_for()
    found, true = table(page), reading(run.time_s, run["current_A"], a, b)
    assert set(found) == {"plant", "monitor"}
    expected = [true.first, true.last, true.difference, true.mean, true.rms, true.slope]
    assert found["plant"] == pytest.approx(expected, rel=1e-3, abs=1e-6)
    assert page.locator(".emaviz-measure-line").count() == 8, "both, in each of the four charts"

    page.get_by_role("button", name="Zoom to A – B").click()
    shows(page, LIVE, (a, b), 0.002)
    drag(page, LIVE, 0.25, 0.5)
    quarter = a + 0.25 * (b - a), a + 0.5 * (b - a)
    shows(page, LIVE, quarter, 0.003)
    inside = np.count_nonzero((run.time_s >= quarter[0]) & (run.time_s <= quarter[1]))
    assert page.evaluate(LIVE)[6] == pytest.approx(min(inside, lines.POINTS), rel=0.1), "in full resolution"
    page.mouse.wheel(0, 120)
    wait_until(lambda: np.diff(span(page, LIVE))[0] > 1.2 * (quarter[1] - quarter[0]), 20.0)
    left, top, width, height, *_ = page.evaluate(LIVE)
    page.mouse.dblclick(left + 0.4 * width, top + 0.5 * height)
    shows(page, LIVE, (start, end), 0.001)
    assert table(page) == found, "a double click moves no cursor"

    page.get_by_role("button", name="Event", exact=True).click()
    wait_until(lambda: span(page, LIVE)[1] < 0.9 * end, 20.0)
    assert page.evaluate(LIVE)[4] == pytest.approx(start, abs=0.01), "a step begins at once"
    page.get_by_role("button", name="Spectrum", exact=True).click()
    wait_until(lambda: "Spectrum: Equivalent current" in (page.evaluate(SHEET) or ""), 20.0)
    page.get_by_role("button", name="Δ", exact=True).click()
    wait_until(lambda: "monitor − plant" in (page.evaluate(SHEET) or ""), 20.0)
    page.locator(".emaviz-measure-figure").hover()
    with page.expect_download() as download:
        page.get_by_role("button", name="PNG", exact=True).or_(page.locator("#emaviz-save-chart")).first.click()
    download.value.save_as(tmp_path / "difference.png")
    assert (tmp_path / "difference.png").read_bytes().startswith(b"\x89PNG")
    page.get_by_role("button", name="×", exact=True).click()
    page.keyboard.press("Escape")
    page.locator(".emaviz-measure-line").first.wait_for(state="detached")
    click(page, LIVE, 0.5)
    page.keyboard.press("Escape")
    app.tab(ExploreTab).charts._zoom(None)
    app.session.settings.set("command", "chirp")
    app.session.refresh()


@pytest.mark.browser
def test_compared_recordings_are_measured_one_by_one_and_over_each_other(page, app):
    comparison = by_hand(("one", "two"))
    page.get_by_role("tab", name="Compare", exact=True).click()
    app.screen.post("comparison", lambda: app.tab(CompareTab).result.show(comparison))
    wait_until_at_rest(page, FIGURE)
    start, end = page.evaluate(FIGURE)[4:6]
    drag(page, FIGURE, 0.5, 0.75)
    shows(page, FIGURE, (start + 0.5 * (end - start), start + 0.75 * (end - start)), 0.02)
    left, top, width, height, *_ = page.evaluate(FIGURE)
    page.mouse.dblclick(left + 0.4 * width, top + 0.5 * height)
    shows(page, FIGURE, (start, end), 0.001)
    choose(page, "Measurement", "all, over each other")
    wait_until(lambda: page.evaluate(FIGURE)[6] == 4, 20.0)
    wait_until_at_rest(page, FIGURE)
    click(page, FIGURE, 0.3)
    page.wait_for_timeout(450)
    click(page, FIGURE, 0.7)
    page.get_by_role("button", name="Spectrum of A – B").click()
    wait_until(lambda: "Spectrum: Equivalent current" in (page.evaluate(SHEET) or ""), 20.0)
    assert {"one, measured", "two, calibrated"} <= set(table(page))
    page.get_by_role("button", name="×", exact=True).click()
    page.keyboard.press("Escape")
    app.screen.post("comparison", app.tab(CompareTab).result.clear)


@pytest.mark.browser
def test_only_the_pages_own_script_is_answered(page, app):
    """A link or a form elsewhere cannot set the header, and a script must ask first."""
    chart = f"{id_of(app.tab(ExploreTab).charts.signals.handles[0])}:0"

    def ask(query, **headers):
        request = urllib.request.Request(f"{app.address}/signals?{query}", headers=headers)
        try:
            with urllib.request.urlopen(request) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            return error.code

    own = {"X-Emaviz": "1"}
    wait_until(lambda: app.session.simulation is not None)
    assert ask(f"chart={chart}&do=read&a=0.1", **own)["unit"] == "A"
    assert ask(f"chart={chart}&do=read&a=0.1") == 404
    for bad in (f"chart={chart}&do=read&a=nan", f"chart={chart}&do=quit", "chart=none&do=read&a=0", "", "do=read&a=x"):
        assert ask(bad, **own) == 404
    assert "needs 16 samples" in ask(f"chart={chart}&do=spectrum&from=0.1&to=0.1001", **own)["error"]
    assert Measuring(lambda kind, job: None).answer(f"chart={chart}&do=zoom") is None
