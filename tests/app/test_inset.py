"""How a window is laid out: an inset beside results, which fill the window; first visits and errors stay to be seen."""

from __future__ import annotations

import urllib.request

import pytest
from support.on_page import wait_until

from emaviz.page.identify import IdentifyTab
from emaviz.recording.writer import RecordingWriter

pytestmark = pytest.mark.browser

PICTURE = "document.querySelector('[data-dock-root] > div:has(> canvas)')"
RIGHT = "document.querySelector('[data-dock-region=right]')"
# Of each value axis that is seen: how many values stand at it, and how high its chart is.
VALUES = """() => Object.values(window.__viserTestpoints.uplots).map(one => one.chart)
  .filter(one => one.root.checkVisibility())
  .flatMap(one => one.axes.filter(axis => axis.side % 2 && axis._values)
    .map(axis => [axis._values.filter(text => text).length, one.height]))"""
CHARTS = "[...document.querySelectorAll('.uplot-container')].filter(one => one.offsetParent)"


@pytest.fixture
def page(shared_page):
    yield shared_page
    shared_page.set_viewport_size({"width": 1400, "height": 900})
    go(shared_page, "Explore")


def go(page, name):
    page.get_by_role("tab", name=name, exact=True).click()
    # Asked of the page: `page.url` is told by events, which do not come in while one sleeps.
    wait_until(lambda: page.evaluate("location.search").endswith(f"?view={name.lower()}"), 20.0)


def box(page, element):
    """Left, top, right and bottom, px."""
    return page.evaluate(
        f"(({{left, top, right, bottom}}) => [left, top, right, bottom])({element}.getBoundingClientRect())"
    )


def columns(page):
    """In how many columns the results of Compare stand."""
    style = "getComputedStyle([...document.querySelectorAll('.emaviz-columns')].find(one => one.offsetParent)"
    return page.evaluate(f"{style}.parentElement.parentElement).columnCount")


@pytest.mark.long
def test_results_have_the_width_beside_an_inset_that_grows_at_a_click(page):
    go(page, "Compare")
    for width, height in ((1400, 900), (1920, 1080), (1100, 700)):
        page.set_viewport_size({"width": width, "height": height})
        wait_until(lambda width=width: abs(box(page, RIGHT)[2] - width) < 2.0, 10.0)
        wait_until(lambda: box(page, PICTURE)[2] < box(page, RIGHT)[0] < 400.0, 10.0)
        left, top, right, bottom = box(page, PICTURE)
        results = box(page, RIGHT)
        assert results[0] < 400 and results[2] == pytest.approx(width, abs=2), "all that the controls leave"
        assert left >= 0.0 and bottom <= height - 68.0, "above the playback"
        assert top >= page.evaluate("document.querySelector('[data-dock-region=left]').getBoundingClientRect().bottom")
        assert columns(page) == ("2" if width >= 1240 else "auto")
    page.set_viewport_size({"width": 1400, "height": 900})
    page.get_by_role("button", name="Larger actuator").click()
    wait_until(lambda: box(page, PICTURE)[3] - box(page, PICTURE)[1] > 700.0, 10.0)
    wait_until(lambda: box(page, PICTURE)[2] <= box(page, RIGHT)[0] + 1.0, 10.0)  # between controls and results
    page.get_by_role("button", name="Smaller actuator").click()
    wait_until(lambda: box(page, PICTURE)[3] - box(page, PICTURE)[1] < 350.0, 10.0)
    left, top, right, bottom = box(page, PICTURE)
    page.mouse.click(0.5 * (left + right), top + 40.0)  # what is told covers its lower part
    wait_until(lambda: box(page, PICTURE)[3] - box(page, PICTURE)[1] > 700.0, 10.0)


TABS = """() => [...document.querySelectorAll('[data-dock-region=left] [role=tab]')].map(tab => {
  const box = tab.getBoundingClientRect();
  return [tab.textContent.trim(), tab.ariaSelected, Math.round(box.top), Math.round(box.left)]; })"""
SCROLL = """(px) => { const tabs = document.querySelector('[data-dock-region=left] [role=tab]');
  tabs.closest('.mantine-ScrollArea-viewport').scrollTop = px; }"""


def test_tabs_stay_in_sight_and_a_window_that_was_narrow_is_as_before(page):
    go(page, "Compare")
    wait_until(lambda: page.evaluate(TABS)[2][1] == "true", 10.0)
    page.wait_for_timeout(300)
    before, width = page.evaluate(TABS), box(page, RIGHT)[0]
    assert len({top for _, _, top, _ in before}) == 1, "in one line"
    page.evaluate(SCROLL, 200)
    page.wait_for_timeout(200)
    assert all(abs(a[2] - b[2]) <= 4 for a, b in zip(page.evaluate(TABS), before)), "while what is below them scrolls"
    page.evaluate(SCROLL, 0)
    page.set_viewport_size({"width": 390, "height": 844})
    wait_until(lambda: not page.evaluate(TABS), 20.0)
    page.get_by_role("tab", name="Compare", exact=True, selected=True).wait_for()
    page.set_viewport_size({"width": 1400, "height": 900})
    wait_until(lambda: page.evaluate(TABS) == before and abs(box(page, RIGHT)[0] - width) <= 1.0, 20.0)
    page.get_by_role("button", name="Fold the actuator away").click()
    wait_until(lambda: box(page, PICTURE)[3] - box(page, PICTURE)[1] < 45.0, 10.0)
    page.get_by_role("button", name="Show the actuator").click()
    wait_until(lambda: box(page, PICTURE)[3] - box(page, PICTURE)[1] > 140.0, 10.0)


COVERED = """() => {
  const roots = [...document.querySelectorAll('.mantine-Notifications-root')];
  const root = roots.find(one => one.querySelector('.mantine-Notification-root'));
  const clip = root.getBoundingClientRect();
  const told = [...root.querySelectorAll('.mantine-Notification-root')].map(one => one.getBoundingClientRect());
  const at = (box) => document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
  const controls = [...document.querySelectorAll('button, input, [role=tab], [role=slider]')]
    .filter(one => !root.contains(one)).map(one => [one, one.getBoundingClientRect()]);
  root.style.display = 'none';
  const seen = controls.filter(([one, box]) => box.width && one.contains(at(box)));  // the others are scrolled away
  root.style.display = '';
  const over = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const covered = seen.filter(([_, box]) => over(box, clip) && told.some(note => over(box, note))).map(([one]) => one);
  return { notes: told.length, covered: covered.map(one => one.textContent || one.title || one.type) };
}"""


@pytest.mark.parametrize("size", [(1400, 900), (1100, 700)])
def test_what_is_told_covers_no_control(page, app, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    for name in ("Explore", "Compare", "Discover"):
        go(page, name)
        for i in range(4):
            app.page.notify(f"Message {i}", "A long line that says what went wrong, where it was and what to do. " * 2)
        page.get_by_text("Message 3").wait_for()
        page.wait_for_timeout(400)  # until they have come to rest
        found = page.evaluate(COVERED)
        assert found["notes"] >= 4 and not found["covered"], (name, found)
        page.evaluate("document.querySelectorAll('.mantine-Notification-closeButton').forEach(one => one.click())")
        page.locator(".mantine-Notification-root").first.wait_for(state="detached")


def test_a_controls_hint_stands_beside_the_panel(page):
    page.get_by_role("tab", name="Explore", exact=True).click()
    page.get_by_label("Profile", exact=True).hover()
    hint = page.get_by_text("How the load goes over time")
    hint.wait_for()
    panel = page.locator("[data-dock-region=left]").bounding_box()
    assert hint.bounding_box()["x"] >= panel["x"] + panel["width"]


def test_a_message_names_a_file_of_the_data_folder_without_the_folder(page, app):
    folder = app.page.folder.resolve()
    app.page.notify("It cannot be read", f"{folder}/rig/a.csv: is empty; {folder} has {folder}-b/x.csv")
    told = page.get_by_text("It cannot be read").locator("xpath=ancestor::*[contains(@class,'Notification-root')]")
    text = told.inner_text()
    assert "rig/a.csv: is empty; the data folder has" in text and f"{folder}/" not in text
    assert f"{folder}-b/x.csv" in text, "another folder's name is not cut"
    told.locator("button").click()


def test_the_title_names_the_app_and_the_tab(page, app):
    with urllib.request.urlopen(app.address) as answer:
        assert b"<title>emaviz</title>" in answer.read()
    go(page, "Compare")
    wait_until(lambda: page.title() == "Compare – emaviz", 10.0)
    go(page, "Explore")
    wait_until(lambda: page.title() == "Explore – emaviz", 10.0)


def test_explore_keeps_the_actuator_in_the_middle(page):
    go(page, "Compare")
    wait_until(lambda: box(page, PICTURE)[2] < 400.0, 10.0)
    go(page, "Explore")
    wait_until(lambda: box(page, PICTURE)[2] - box(page, PICTURE)[0] > 500.0, 10.0)
    assert not page.get_by_role("button", name="Larger actuator").is_visible()


def test_charts_are_as_high_as_the_window_lets_them_be(page):
    def look(window):
        page.set_viewport_size({"width": 1400, "height": window})
        return page.evaluate(f"{CHARTS}.map(one => one.getBoundingClientRect()).map(one => [one.height, one.bottom])")

    def settled(window):
        """Heights that are the same half a second later, and the last chart's bottom."""
        seen = [look(window)]
        while len(seen) < 2 or seen[-1] != seen[-2]:
            assert len(seen) < 60
            page.wait_for_timeout(500)
            seen.append(look(window))
        return [height for height, _ in seen[-1]], max((bottom for _, bottom in seen[-1]), default=0.0)

    def follow():
        (low, of_low), (tall, of_tall), again = settled(900), settled(1080), settled(900)
        reach = 900 - 200.0 < of_low < 900 and 1080 - 200.0 < of_tall < 1080 and again == (low, of_low)
        return reach and len(low) == len(tall) and all(one > other + 30.0 for one, other in zip(tall, low))

    go(page, "Explore")
    wait_until(follow, 120.0)  # again, where a loaded browser lets half a second pass before it lays out


def test_a_tall_window_has_no_more_values_than_one_reads(page):
    go(page, "Explore")
    for width, height in ((1920, 1080), (1400, 900), (1100, 700)):
        page.set_viewport_size({"width": width, "height": height})

        def few() -> bool:
            seen = page.evaluate(VALUES)
            return len(seen) >= 4 and all(2 <= count <= 6 for count, _ in seen)

        wait_until(few, 20.0)


def test_a_first_visit_finds_an_effect_and_the_newest_run(page, app):
    go(page, "Library")
    page.get_by_text("The rotor's magnets pull toward").wait_for(timeout=20_000)
    with RecordingWriter(app.comparing.folder.recordings / "alone.rrd") as writer:
        writer.config("# alone")
    go(page, "Runs")
    page.locator("[data-dock-region=right]").get_by_text("alone.rrd").wait_for(timeout=20_000)


def test_a_file_that_cannot_be_opened_is_told_beside_the_button_and_stays(page, app):
    go(page, "Compare")
    app.comparing.add("nowhere.csv")
    beside = page.locator(".emaviz-beside").filter(has_text="nowhere.csv")
    beside.wait_for(timeout=20_000)
    page.wait_for_timeout(1_000)
    assert beside.is_visible()


SCROLLED = "[...document.querySelectorAll('[data-dock-region=right] .mantine-ScrollArea-viewport')]"


def test_explore_does_not_scroll_in_a_small_window(page):
    page.set_viewport_size({"width": 1100, "height": 700})
    go(page, "Explore")
    over = f"{SCROLLED}.filter(one => one.offsetParent).map(one => one.scrollHeight - one.clientHeight)"
    wait_until(lambda: all(px <= 0 for px in page.evaluate(over)), 10.0)
    charts = page.evaluate(f"{CHARTS}.map(one => [one.getBoundingClientRect().bottom, one.clientHeight])")
    assert len(charts) == 4
    assert all(bottom <= 700.0 - 68.0 and height > 80.0 for bottom, height in charts)
    within = page.evaluate(f"{CHARTS}.map(one => one.querySelector('.u-over').clientHeight)")
    assert all(height > 45.0 for height in within), "room for a signal and three values at its axis"
    assert max(within) - min(within) <= 4.0, "the last chart has its time axis besides"


def test_the_population_is_framed_beside_the_convergence_and_an_empty_history_says_what_it_will_hold(page, app):
    go(page, "Identify")
    page.get_by_text("Nothing is identified yet").wait_for(timeout=20_000)
    app.tab(IdentifyTab).result._show_search()
    page.get_by_text("severities, 0 … 1").wait_for(timeout=20_000)
    assert "k1 friction [–]" in page.locator(".emaviz-picture:visible").inner_text()
    picture = page.locator(".emaviz-picture:visible").bounding_box()
    convergence = page.evaluate(f"{CHARTS}.at(0).getBoundingClientRect().right")
    assert picture["x"] >= convergence and picture["y"] < 150.0
    page.get_by_role("tab", name="History", exact=True).click()
    page.get_by_text("number of simulations").wait_for(timeout=10_000)
    assert not page.get_by_role("button", name="Clear the table").is_visible()
    page.get_by_role("tab", name="Search", exact=True).click()


@pytest.mark.long
def test_discover_has_a_lower_inset_than_compare(page):
    heights = {}
    for name in ("Compare", "Discover"):
        go(page, name)
        page.wait_for_timeout(500)
        _, top, _, bottom = box(page, PICTURE)
        heights[name] = bottom - top
        controls = page.evaluate("document.querySelector('[data-dock-region=left]').getBoundingClientRect().bottom")
        assert 0.0 < top - controls < 20.0, "the controls have what the actuator leaves"
    assert heights["Discover"] < heights["Compare"] - 60.0


@pytest.mark.long
def test_a_scene_that_cannot_be_written_is_told_beside_its_button_and_stays(page, app, monkeypatch):
    monkeypatch.setattr(app.comparing.folder, "scenes", app.comparing.folder.folder / "absent")
    go(page, "Explore")
    page.get_by_role("tab", name="Export", exact=True).click()
    page.get_by_role("button", name="Scene as HTML").click()
    beside = page.locator(".emaviz-beside").filter(has_text="No link to the scene")
    beside.wait_for(timeout=30_000)
    page.wait_for_timeout(1_000)
    assert beside.is_visible()
    monkeypatch.undo()
    page.get_by_role("button", name="Scene as HTML").click()
    page.get_by_role("link", name="actuator.html").wait_for(timeout=30_000)
    assert not beside.is_visible()
