"""Names that try to become part of the page, opened everywhere in a real browser: they are seen, and do nothing."""

from __future__ import annotations

import pytest
from support import hostile
from support.hostile import FRAME, IMAGE, MARKDOWN
from support.on_page import choose, wait_until
from support.representative import first_of

from emaviz.page.app import App
from emaviz.page.explore import ExploreTab
from emaviz.page.identify import PLANT
from emaviz.text.html import said

pytestmark = pytest.mark.browser

GROWN = """() => [window.hit ?? '', ...Array.from(
  document.querySelectorAll('iframe[srcdoc], img[src="x"], img[src^="http:"], a[href^="javascript"]'),
  element => element.outerHTML)].filter(Boolean)"""


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    app = App("127.0.0.1", 0, hostile.folder(tmp_path_factory.mktemp("data")).folder)
    assert app.wait_for_first_picture(120.0) and app.session.ready.wait(120.0)
    yield app
    app.close()


@pytest.fixture
def page(shared_page):
    """The module's one tab."""
    return shared_page


def seen(page, *texts):
    """Each is there, letter by letter, and nothing has grown out of any."""
    for text in texts:
        page.get_by_text(text).locator("visible=true").first.wait_for(timeout=30_000)
    assert page.evaluate(GROWN) == []


def tab(page, name):
    page.get_by_role("tab", name=name, exact=True).click()


@pytest.mark.long
def test_explore(page, app):
    def told(line):
        """Again where the session says something of its own in between."""
        app.session.events.status(line)
        return app.tab(ExploreTab).panel.status.content == said(line)

    for name in hostile.NAMES:
        wait_until(lambda name=name: told(f"Recovered: {name}.rrd"))
        seen(page, f"Recovered: {name}.rrd")


@pytest.mark.parametrize("name", first_of(hostile.NAMES))
def test_compare(page, app, name):
    tab(page, "Compare")
    choose(page, "Data folder", f"uploads/broken {name}.csv")
    page.get_by_role("button", name="Add this file", exact=True).click()
    seen(page, f"broken {name}.csv: ")  # what is wrong with it
    choose(page, "Data folder", f"uploads/columns {name}.csv")
    page.get_by_role("button", name="Add this file", exact=True).click()
    seen(page, f"columns {name}.csv", f"{name} of a column", "press Use these columns")
    choose(page, "Actuator", f"uploaded: actuators/{MARKDOWN}.toml")
    wait_until(lambda: MARKDOWN in app.comparing.actuator_name)
    page.get_by_role("button", name="Remove", exact=True).click()
    wait_until(lambda: not app.comparing.opened)
    app.comparing.job.ended(f"{name}.csv: has no current")
    seen(page, f"{name}.csv: has no current")


@pytest.mark.long
def test_a_comparison(page, app):
    tab(page, "Compare")
    for name in hostile.NAMES[:2]:
        app.comparing.add(f"uploads/{name}.csv")
    wait_until(lambda: app.comparing.comparison is not None and len(app.comparing.comparison.recordings) == 2)
    wait_until(lambda: not app.comparing.running)
    seen(page, f"{FRAME}.csv", f"{IMAGE}.csv")
    page.get_by_role("button", name="Record", exact=True).click()
    page.get_by_text("in Rerun ↗").first.wait_for(timeout=30_000)
    seen(page)


@pytest.mark.long
def test_identify(page, app):
    tab(page, "Identify")
    choose(page, "Identify", f"uploads/broken {IMAGE}.csv")
    wait_until(lambda: IMAGE in app.session.settings.source)
    page.get_by_role("button", name="Identify", exact=True).click()
    seen(page, f"broken {IMAGE}.csv: ")
    choose(page, "Identify", PLANT)
    wait_until(lambda: not app.session.settings.source)


@pytest.mark.long
def test_discover(page, app):
    tab(page, "Discover")
    choose(page, "Measurements", f"Sealed: {IMAGE}.challenge")
    seen(page, IMAGE, f"{FRAME} {MARKDOWN}")
    page.get_by_role("button", name="Start", exact=True).click()
    wait_until(lambda: not app.discovering.running)
    seen(page, IMAGE)
    app.discovering.job.ended(f"{FRAME}.csv: cannot be used")
    seen(page, f"{FRAME}.csv: cannot be used")


@pytest.mark.long
def test_recordings_and_sessions(page, app):
    tab(page, "Runs")
    page.get_by_role("button", name="Refresh the list", exact=True).click()
    seen(page, *(f"{name}.rrd" for name in hostile.NAMES), f"whole {FRAME}.rrd")
    for name in hostile.NAMES:
        choose(page, "Run", f"{name}.rrd")
        seen(page, f"Open {name}.rrd in Rerun", f"not healthy: {', '.join(hostile.NAMES)}")
    page.get_by_role("button", name="Overlay both runs", exact=True).click()
    tab(page, "Two runs")
    seen(page, "simulations", f"A {MARKDOWN}.rrd")
    choose(page, "Saved", f"sessions/{FRAME}.emaviz")
    page.get_by_role("button", name="Load session", exact=True).click()
    seen(page, f"{FRAME[:39]}…: is no session")
    page.get_by_text("Rename or delete").click()
    page.get_by_role("button", name="Delete…", exact=True).click()
    seen(page, f"{MARKDOWN}.rrd is removed from the disk")
    page.get_by_role("button", name="Keep it", exact=True).click()
