"""Every tab as it is seen empty, at work, with its answer and with what it refuses, in three windows, light and dark.

python tests/benchmarks/gallery.py FOLDER [TAB …] writes FOLDER/TAB-STATE-WIDTH-light.png …, to be looked at.  What
changes while pictures are taken is taken in the middle window alone.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the app has it, before numpy is there: else other digits
from support.browser import SOFTWARE_GL
from support.on_page import choose, field, fill, wait_until

from ema_model.faults import vector
from emaviz.page.app import App
from emaviz.page.fleet import UnitsTab
from emaviz.page.frequency import FrequencyTab
from emaviz.page.identify import IdentifyTab
from emaviz.page.runs import RunsTab
from emaviz.page.track import TrackTab

WINDOWS = {1400: 900, 1920: 1080, 1100: 700}
SETTLED_MS, QUICK_MS = 1800, 250
LONG_MS = 900_000
EXAMPLES = Path(__file__).parents[2] / "assets" / "examples"
MOVES = ("running",)  # states that change by themselves
INNER = "inner "  # begins the name of a tab within a result, which is taken in the middle window alone, too
BROKEN = "time_s,current_A\n0,1\n0,2\nabc,3\n"
CLOSE = ".mantine-Notification-closeButton"


def inner(page: Any, *titles: str) -> Iterator[str]:
    """Tabs within a result, one after another."""
    for title in titles:
        page.get_by_role("tab", name=title, exact=True).locator("visible=true").click()
        page.wait_for_timeout(2000)
        yield f"{INNER}{title.lower()}"


def explore(page: Any, app: App, _: Path) -> Iterator[str]:
    """The sliders' faults."""
    yield "first"
    page.get_by_role("button", name="Got it").click()
    app.session.settings.set("k", list(vector({"k1": 0.25, "k2": 0.7, "k3": 0.3, "k6": 0.5})))
    for tab in app.shared.tabs.values():
        tab.show_settings()
    app.session.refresh()
    page.wait_for_timeout(3000)
    app.strip.rest_at(0.25, "explore")
    yield "result"
    yield from inner(page, "Phases", "Fan", "Metrics", "Export")


def identify(page: Any, app: App, folder: Path) -> Iterator[str]:
    """What Explore breaks."""
    yield "empty"
    app.session.settings.set("k", list(vector({"k1": 0.25, "k2": 0.7, "k3": 0.3, "k6": 0.5})))
    app.session.refresh()
    search = {"algorithms": ["do", "hba", "ssa"], "population": 400, "iterations": 2000}
    usual = {name: getattr(app.session.settings, name) for name in search}
    for name, value in search.items():
        app.session.settings.set(name, value)
    app.tab(IdentifyTab).show_settings()
    page.get_by_role("button", name="Identify", exact=True).click()
    wait_until(lambda: app.session.identifying.job.running)
    page.wait_for_timeout(1500)
    yield "running"
    app.session.identifying.job.stop()
    wait_until(lambda: not app.session.identifying.job.running)
    for name, value in usual.items():
        app.session.settings.set(name, value)
    app.tab(IdentifyTab).show_settings()
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_role("link", name="in Rerun").wait_for(timeout=LONG_MS)
    yield "result"
    yield from inner(page, "Search", "Landscape", "History")
    (folder / "data" / "broken.csv").write_text(BROKEN)
    app.tab(IdentifyTab).refresh_files()
    choose(page, "Identify", "broken.csv")
    page.get_by_role("button", name="Identify", exact=True).click()
    page.wait_for_timeout(2000)
    yield "error"


def compare(page: Any, app: App, folder: Path) -> Iterator[str]:
    """A foreign file's columns, what is no recording, and the example."""
    yield "empty"
    shutil.copy(EXAMPLES / "rig.csv", folder / "data" / "rig.csv")
    (folder / "data" / "broken.csv").write_text(BROKEN)
    app.comparing.add("broken.csv")
    page.wait_for_timeout(2000)
    yield "error"
    app.comparing.remove("broken.csv")
    app.comparing.add("rig.csv")
    page.locator(".emaviz-map tbody tr").nth(3).wait_for()
    yield "columns"
    app.comparing.job.stop()
    app.comparing.remove("rig.csv")
    page.locator("button:visible", has_text="Run an example").click()
    wait_until(lambda: app.comparing.running)
    yield "running"
    wait_until(lambda: app.comparing.finished is not None and not app.comparing.running)
    yield "result"
    page.get_by_role("button", name="The motor needs").first.click(timeout=10_000)
    page.wait_for_timeout(2000)
    yield "region"
    yield from inner(page, "Against", "Orders", "Explained by", "Calibration")


def discover(page: Any, app: App, _: Path) -> Iterator[str]:
    """A challenge, from its candidates to its ladder."""
    told = app.discovering
    yield "empty"
    page.get_by_label("Measurements", exact=True).click()
    page.get_by_role("option", name="After the overhaul").click()
    page.get_by_role("button", name="Start", exact=True).click()
    wait_until(lambda: told.running)
    page.wait_for_timeout(1000)
    yield "running"
    wait_until(lambda: told.look is not None and told.look.assessment is not None and not told.running)
    page.wait_for_timeout(1500)
    yield "cards"
    page.locator(".emaviz-card header button").first.click()
    page.wait_for_timeout(1500)
    yield "opened"
    page.get_by_role("button", name="Find all").click(timeout=LONG_MS)
    wait_until(lambda: told.running)
    wait_until(lambda: not told.running)
    page.wait_for_timeout(1500)
    yield "ladder"
    page.get_by_role("button", name="Undo the last step").click()
    wait_until(lambda: told.look.promising and not told.running)
    page.get_by_text("Your own effect").first.click()
    field(page, "T [N·m] =").fill("-c*sign(omega)*(1 + exp(-abs(omega)/v))")
    page.get_by_text("With these values, before any fit").wait_for()
    page.get_by_role("button", name="Fit it in the model").scroll_into_view_if_needed()
    yield "own"
    field(page, "T [N·m] =").fill("-c*sgn(omega")
    page.wait_for_timeout(1000)
    yield "error"


def units(page: Any, app: App, _: Path) -> Iterator[str]:
    """Six of one type."""
    job = app.tab(UnitsTab).comparing.job
    yield "empty"
    page.locator("button:visible", has_text="Run an example").click()
    wait_until(lambda: job.running)
    page.wait_for_timeout(2000)
    yield "running"
    wait_until(lambda: not job.running and app.tab(UnitsTab).comparing.found is not None, 900.0)
    yield "result"
    fill(page, "Hold out", "*nothing*")
    page.get_by_role("button", name="Compare units").click()
    page.wait_for_timeout(2000)
    yield "error"


def track(page: Any, app: App, folder: Path) -> Iterator[str]:
    """A life."""
    job = app.tab(TrackTab).following.job
    yield "empty"
    flights = folder / "data" / "flights"
    flights.mkdir()
    for day in (1, 2, 3):
        (flights / f"flight {day}.csv").write_text(BROKEN)
    app.tab(TrackTab).refresh_files()
    choose(page, "Flights", "flights (3)")
    page.get_by_role("button", name="Track", exact=True).click()
    page.wait_for_timeout(4000)
    yield "error"
    page.locator("button:visible", has_text="Run an example").click()
    wait_until(lambda: job.running)
    page.wait_for_timeout(30_000)
    yield "running"
    wait_until(lambda: not job.running, 900.0)
    yield "result"


def bode(page: Any, app: App, _: Path) -> Iterator[str]:
    """A sweep over a resonance."""
    yield "empty"
    page.get_by_role("button", name="Frequency response").click()
    page.get_by_text("no measurement is chosen").first.wait_for()
    yield "error"
    analysing = app.tab(FrequencyTab).analysing
    page.locator("button:visible", has_text="Run an example").click()
    wait_until(lambda: analysing.job.running)
    yield "running"
    wait_until(lambda: analysing.result is not None)
    page.wait_for_timeout(2000)
    yield "result"


def library(page: Any, app: App, _: Path) -> Iterator[str]:
    """An effect."""
    yield "first"
    page.get_by_role("button", name="Cogging torque").first.click()
    page.wait_for_timeout(3000)
    yield "result"


def runs(page: Any, app: App, folder: Path) -> Iterator[str]:
    """A run that is recorded, the viewer, and a campaign."""
    yield "empty"
    (folder / "data" / "sessions" / "damaged.emaviz").write_text(BROKEN)
    app.tab(RunsTab).refresh_files()
    page.wait_for_timeout(1000)
    page.get_by_role("button", name="Load session").click()
    page.wait_for_timeout(2000)
    yield "error"
    page.locator("button:visible", has_text="Run an example").click()
    identifying = app.session.identifying
    wait_until(lambda: identifying.job.running)
    wait_until(lambda: identifying.answer is not None and not identifying.job.running)
    page.get_by_role("button", name="Open in Rerun, here").wait_for()
    yield "result"
    page.get_by_role("button", name="Open in Rerun, here").click()
    page.wait_for_timeout(20_000)
    yield "viewer"
    page.get_by_text("Compute a campaign", exact=True).first.click()
    choose(page, "Plan", "comparison_quick")
    page.get_by_role("button", name="Compute", exact=True).click()
    wait_until(lambda: app.campaigns.computing.running)
    page.wait_for_timeout(20_000)
    yield "running"
    wait_until(lambda: not app.campaigns.computing.running, 600.0)
    page.wait_for_timeout(2000)
    yield "campaign"


TABS: dict[str, Callable[[Any, App, Path], Iterator[str]]] = {
    one.__name__: one for one in (explore, identify, compare, discover, units, track, bode, library, runs)
}


def photograph(page: Any, app: App, to: Path, named: str, state: str) -> None:
    """One state, in its windows and both looks."""
    for width, height in WINDOWS.items():
        if width != 1400 and (state in MOVES or state.startswith(INNER)):
            continue
        page.set_viewport_size({"width": width, "height": height})
        settled = QUICK_MS if state in MOVES else SETTLED_MS
        page.wait_for_timeout(settled)
        page.evaluate(f"document.querySelectorAll('{CLOSE}').forEach(one => one.click())")
        for dark in (False, True):
            app.strip._dark.value = dark
            page.mouse.move(width // 2, 5)
            page.wait_for_timeout(settled)
            page.screenshot(path=to / f"{named}-{state}-{width}-{'dark' if dark else 'light'}.png")
    app.strip._dark.value = False
    page.set_viewport_size({"width": 1400, "height": 900})
    page.wait_for_timeout(SETTLED_MS)


def visit(chromium: Any, to: Path, named: str) -> None:
    """One tab of an app of its own."""
    with tempfile.TemporaryDirectory() as folder:
        app = App("127.0.0.1", 0, Path(folder) / "data")
        app.wait_for_first_picture(120.0)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.on("console", lambda said: said.type == "error" and print(f"{named}: console: {said.text}"))
        page.on("pageerror", lambda error: print(f"{named}: {error}"))
        name = "frequency" if named == "bode" else named
        page.goto(f"{app.address}/?view={name}")
        page.locator("[role=tab][aria-selected=true]", has_text=named.capitalize()).wait_for(timeout=60_000)
        page.wait_for_timeout(3000)
        app.strip.play(False)
        try:
            for state in TABS[named](page, app, Path(folder)):
                photograph(page, app, to, named, state)
                print(f"{time.strftime('%H:%M:%S')} {named} {state}", flush=True)
        finally:
            page.screenshot(path=to / f"{named}-last.png")
            page.close()
            app.close()


def main(folder: str, *names: str) -> None:
    """Those that are named, or all."""
    to = Path(folder)
    to.mkdir(parents=True, exist_ok=True)
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        for name in names or TABS:
            try:
                visit(chromium, to, name)
            except Exception as error:
                print(f"{name}: {error}", flush=True)
        chromium.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
