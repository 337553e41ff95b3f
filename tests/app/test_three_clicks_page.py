"""What an engineer does with signals all day takes three clicks at most; they are counted, and printed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.clicks import Clicks
from support.comparison_by_hand import comparison as by_hand
from support.on_page import wait_until, wait_until_at_rest

from ema_model.recordings.signals import reading
from emaviz.page.compare import CompareTab
from emaviz.page.discover import DiscoverTab

pytestmark = pytest.mark.browser

MOST_CLICKS = 3
LIVE = """() => { const { chart } = Object.values(window.__viserTestpoints.uplots).find(({ chart }) =>
  chart.root.querySelector('.u-title')?.textContent === 'Equivalent current'), box = chart.over.getBoundingClientRect();
  return [box.left, box.top, box.width, box.height, chart.scales.x.min, chart.scales.x.max]; }"""
FIGURE = """() => { const plot = [...document.querySelectorAll('.js-plotly-plot')].find(one =>
    one.layout?.meta?.chart && one.checkVisibility());
  return plot?.data.filter(one => one.visible !== 'legendonly').map(one => one.name); }"""
SHEET = "document.querySelector('.emaviz-measure-figure').layout?.title?.text ?? ''"
TITLES = """() => [...document.querySelectorAll('.js-plotly-plot')].filter(one => one.checkVisibility())
  .flatMap(one => [one.layout?.title?.text ?? '', ...(one.layout?.annotations ?? []).map(said => said.text)])"""


@pytest.fixture
def page(shared_page):
    return shared_page


@pytest.fixture
def clicks(page, request):
    """Those of one task."""
    found = Clicks(page)
    yield found
    print(f"\n{request.node.name.removeprefix('test_').replace('_', ' ')}: {found.count} clicks")
    assert 0 < found.count <= MOST_CLICKS


def at(page, share):
    """A place on the chart of the current on Explore."""
    left, top, width, height, *_ = page.evaluate(LIVE)
    return left + share * width, top + 0.5 * height


def two_cursors(page, clicks):
    """Both times in the chart of the current, each once the one before is read."""
    for i, share in enumerate((0.2, 0.6)):
        clicks.at(*at(page, share))
        wait_until(lambda i=i: page.evaluate("window.emavizMeasure.cursors()")[i] is not None, 20.0)
        page.wait_for_timeout(450)  # no double click
    page.get_by_role("button", name="Zoom to A – B").wait_for()
    return page.evaluate("window.emavizMeasure.cursors()")


@pytest.fixture
def explored(page, app):
    """Explore's charts of a step, at rest and without cursors."""
    app.session.settings.set("command", "step")
    app.session.refresh()
    wait_until(lambda: app.session.simulation.command == "step")
    run = app.session.simulation.reference
    wait_until(lambda: abs(page.evaluate(LIVE)[5] - run.time_s[-1]) < 0.02)
    wait_until_at_rest(page, LIVE)
    yield run
    page.keyboard.press("Escape")
    page.locator(".emaviz-measure-line").first.wait_for(state="detached")


@pytest.fixture
def compared(page, app):
    """Two recordings on Compare."""
    page.get_by_role("tab", name="Compare", exact=True).click()
    comparison = by_hand(("one", "two"))
    result = app.tab(CompareTab).result
    app.screen.post("comparison", lambda: result.show(comparison))
    wait_until(lambda: page.evaluate(FIGURE))
    yield comparison
    app.screen.post("comparison", result.clear)


@pytest.fixture
def imported(page, app):
    """A foreign log whose columns are still to be checked."""
    time_s = np.arange(0.0, 0.5, 1e-3)
    columns = {"t [ms]": 1e3 * time_s, "Soll [°]": np.sin(9 * time_s), "Motorwinkel [°]": np.sin(9 * time_s)}
    columns |= {"iq [mA]": 900.0 * np.cos(9 * time_s), "channel_7": time_s % 0.01}
    path = app.comparing.folder.folder / "rig.csv"
    np.savetxt(path, np.column_stack([*columns.values()]), delimiter=";", header=";".join(columns), comments="")
    page.get_by_role("tab", name="Compare", exact=True).click()
    app.comparing.add("rig.csv")
    page.locator(".emaviz-map tbody tr").nth(4).wait_for()
    yield "rig.csv"
    app.comparing.job.stop()
    app.comparing.remove("rig.csv")


def row_of(page, name):
    """Of the box of the cursors."""
    row = page.locator(".emaviz-measure-table tr").filter(has_text=name)
    return [float(one.text_content().replace("−", "-")) for one in row.locator("td").all()[1:]]


def test_difference_between_two_cursors(page, explored, clicks):
    a, b = two_cursors(page, clicks)
    true = reading(explored.time_s, explored["current_A"], a, b)
    assert row_of(page, "plant")[2] == pytest.approx(true.difference, rel=1e-3, abs=1e-6)
    page.get_by_text(f"Δt {b - a:.4g} s").first.wait_for()


def test_mean_and_rms_of_a_window(page, explored, clicks):
    a, b = two_cursors(page, clicks)
    true = reading(explored.time_s, explored["current_A"], a, b)
    assert row_of(page, "plant")[3:5] == pytest.approx([true.mean, true.rms], rel=1e-3, abs=1e-6)


def test_spectrum_of_a_window(page, explored, clicks):
    a, b = two_cursors(page, clicks)
    clicks.click(page.get_by_role("button", name="Spectrum of A – B"))
    wait_until(lambda: "Spectrum: Equivalent current" in page.evaluate(SHEET), 20.0)
    assert f"{a:.3g}"[:4] in page.evaluate(SHEET) and b > a
    page.get_by_role("button", name="×", exact=True).click()


def test_zoom_to_an_event(page, explored, clicks):
    page.mouse.move(*at(page, 0.5))
    clicks.click(page.get_by_role("button", name="Event", exact=True))
    wait_until(lambda: page.evaluate(LIVE)[5] < 0.9 * explored.time_s[-1], 20.0)
    page.mouse.dblclick(*at(page, 0.4))
    wait_until(lambda: page.evaluate(LIVE)[5] > 0.99 * explored.time_s[-1], 20.0)


def test_chart_as_picture(page, explored, clicks, tmp_path):
    page.mouse.move(*at(page, 0.5))
    with page.expect_download() as download:
        clicks.click(page.locator("#emaviz-save-chart"))
    download.value.save_as(tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")


def test_overlay_of_two_recordings(page, compared, clicks):
    clicks.choose("Measurement", "all, over each other")
    wait_until(lambda: {"one, measured", "two, measured"} <= set(page.evaluate(FIGURE)), 20.0)


def test_overlay_of_a_model_on_both(page, compared, clicks):
    clicks.choose("Measurement", "all, over each other")
    wait_until(lambda: {"one, calibrated", "two, calibrated"} <= set(page.evaluate(FIGURE)), 20.0)


def test_one_raw_column_plotted(page, imported, clicks):
    clicks.click(page.get_by_title("Draws channel_7 below"))
    wait_until(lambda: any("channel_7, as it stands in the file" in one for one in page.evaluate(TITLES)), 20.0)


def test_unit_of_a_column_changed(page, app, imported, clicks):
    clicks.select(page.get_by_label("Unit of iq [mA] in the file"), "A")
    wait_until(lambda: app.tab(CompareTab).result.step.mapping.get("current_A").converter.is_si)
    clicks.click(page.get_by_role("button", name="Use these columns"))
    wait_until(lambda: app.comparing.opened[imported].recorded is not None)
    assert np.max(app.comparing.opened[imported].recorded["current_A"]) == pytest.approx(900.0), "they are amperes now"


def test_two_discoveries_side_by_side(page, app, clicks):
    discovering = app.discovering
    page.get_by_role("tab", name="Discover", exact=True).click()
    discovering.choose("first_bench_run")
    assert discovering.start()
    wait_until(lambda: discovering.look and discovering.look.assessment and not discovering.running)
    first = discovering.entries.current
    discovering.entries.all.append(replace(first, number=first.number + 1))
    app.screen.post("entries", app.tab(DiscoverTab).panel.show_entries)
    clicks.choose("Beside", discovering.entries.all[-1].words)
    page.get_by_text("Side by side", exact=True).first.wait_for()
    wait_until(lambda: sum("Error after each step" in one for one in page.evaluate(TITLES)) == 3)  # and the shown one's
    for one in discovering.entries.all:
        page.get_by_text(f"{one.number}. {one.subject}", exact=True).first.wait_for()
