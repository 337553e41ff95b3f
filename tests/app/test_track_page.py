"""Track on the page: a life is followed, today is dragged back along it, a flight is compared, a new one arrives."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from support.flights import flights
from support.known_flights import FOLLOWING, known, write_flights
from support.on_page import choose, fill, wait_until

from emaviz.page.track import TrackTab

pytestmark = pytest.mark.browser
COUNT = 16
# Where on the screen a flight's point is, once the chart is drawn.
POINT = """(name) => {
  const plot = Array.from(document.querySelectorAll('.js-plotly-plot')).find(one => one.layout?.meta === 'flights');
  const trace = plot?._fullData?.find(one => one.text?.includes?.(name));
  if (!trace || !plot.calcdata || !plot._fullLayout?.xaxis?.d2p || !plot.getBoundingClientRect().width) return null;
  plot.scrollIntoView();
  const at = Array.from(trace.text).indexOf(name), { xaxis, yaxis } = plot._fullLayout;
  const box = plot.querySelector('.nsewdrag').getBoundingClientRect();
  const point = plot.calcdata[trace.index][at];
  return [box.x + xaxis.d2p(point.x), box.y + yaxis.d2p(point.y)];
}"""
LIFE = flights(0.05 * np.arange(COUNT + 1))  # k1, which reaches 0.5 in flight 11


@pytest.fixture
def page(shared_page):
    return shared_page


def click_on(page, name):
    """As a person does: once the point shows its name under the mouse; the panel takes its width a moment later."""
    for _ in range(50):
        x, y = page.wait_for_function(POINT, arg=name).json_value()
        page.mouse.move(x - 3, y)
        page.mouse.move(x, y)
        page.wait_for_timeout(300)
        if page.locator(".hoverlayer .hovertext").filter(has_text=name).count():
            break
    page.mouse.click(x, y)


def both_columns_are_filled(page):
    """The first chart and the flight's choice on the left, two charts on the right, and hardly a gap below either."""
    plots = [plot.bounding_box() for plot in page.locator(".js-plotly-plot:visible").all()]
    ends = page.get_by_role("button", name="Compare this flight").bounding_box()
    if len(plots) != 3 or None in (*plots, ends):
        return False
    below = ends["y"] + ends["height"] - plots[2]["y"] - plots[2]["height"]
    return plots[1]["x"] == plots[2]["x"] > plots[0]["x"] and abs(below) < 90.0


def test_a_life_is_followed(page, app, monkeypatch):
    monkeypatch.setattr(f"{FOLLOWING}.identified", known(LIFE, []))
    monkeypatch.setattr(f"{FOLLOWING}.LOOK_S", 0.1)
    unit = app.comparing.folder.folder / "unit"
    one = write_flights(unit, COUNT).rename(unit.with_name("one.part"))
    tab = app.tab(TrackTab)
    page.get_by_role("tab", name="Track", exact=True).click()
    page.get_by_text("No flights are tracked yet").wait_for()
    choose(page, "Flights", f"unit ({COUNT})")
    page.get_by_label("With a threshold", exact=True).check()
    fill(page, "Threshold", 0.5)
    page.get_by_text("k1 friction at 0.5").wait_for()
    page.get_by_role("button", name="Track", exact=True).click()
    page.get_by_text("k1 friction drifts by 0.05").first.wait_for()
    page.get_by_text(f"after flight_15: {COUNT} flights, {COUNT} of them usable").wait_for()
    wait_until(lambda: both_columns_are_filled(page), 20.0)  # the panel takes its width a moment later

    fill(page, "Today, after flight", 8)
    page.get_by_text("What came: k1 friction reached 0.5").wait_for()
    page.get_by_text("after flight_07: 8 flights, 8 of them usable").wait_for()
    crossed = tab.following.history.crossed("k1")
    page.get_by_text(f"reached 0.5, {crossed - 8} flights later").wait_for()
    drawn = [plot.figure.layout.title.text for plot in tab.result._plots]
    assert [text.startswith(f"<b>{begins}") for text, begins in zip(drawn, ("k1", "Probability", "Remaining life"))]

    shutil.copy(one, unit / "flight_16.parquet")  # today stays where it was dragged to
    wait_until(lambda: len(tab.following.last.flights) == COUNT + 1, 30.0)
    page.get_by_text(f"unit ({COUNT + 1})").first.wait_for(state="attached")
    page.get_by_text("after flight_07: 8 flights, 8 of them usable").wait_for()

    page.get_by_role("button", name="Compare this flight").click()
    page.wait_for_function("location.search.includes('view=compare')")
    wait_until(lambda: [*app.comparing.opened] == ["unit/flight_07.parquet"])
    app.comparing.job.stop()

    page.get_by_role("tab", name="Track", exact=True).click()
    click_on(page, "flight_03")
    page.wait_for_function("location.search.includes('view=compare')")
    wait_until(lambda: [*app.comparing.opened] == ["unit/flight_03.parquet"])
    app.comparing.job.stop()

    page.get_by_role("tab", name="Runs").click()
    fill(page, "Session name", "life")
    page.get_by_role("button", name="Save session").click()
    wait_until(lambda: app.comparing.folder.session_files() == ["sessions/life.emaviz"])
    before, tab.following.thresholds = tab.following.history, {}
    monkeypatch.setattr(f"{FOLLOWING}.identified", None)  # what is loaded is not identified again
    page.get_by_role("button", name="Load session").click()
    wait_until(lambda: tab.following.history not in (None, before), 60.0)
    assert str(tab.following.last) == str(before.last) and tab.following.thresholds == {"k1": 0.5}
    page.get_by_role("tab", name="Track", exact=True).click()
    page.get_by_text("k1 friction drifts by 0.05").first.wait_for()
    page.get_by_text(f"after flight_16: {COUNT + 1} flights").wait_for()


def test_what_is_missing_is_said_in_one_line(page, app):
    lonely = app.comparing.folder.folder / "lonely"
    write_flights(lonely, 1)
    page.get_by_role("tab", name="Track", exact=True).click()
    choose(page, "Flights", "lonely (1)")
    wait_until(lambda: app.tab(TrackTab).following.chosen == "lonely")  # which moves what stands below
    page.wait_for_timeout(300)
    page.get_by_label("Add new flights", exact=True).uncheck()
    page.get_by_role("button", name="Track", exact=True).click()
    page.get_by_text("1 flight tells no trend").wait_for()
