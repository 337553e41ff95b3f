"""The README's pictures, each of the page in its state: python tests/benchmarks/screenshots.py [NAME …]

NAME is explore, identify, compare, discover or export; without one all five in assets/screenshots are replaced.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the app has it, before numpy is there: else other digits
from support.browser import SOFTWARE_GL

from ema_model.faults import vector
from emaviz.cli import main as emaviz
from emaviz.page.app import App

PICTURES = Path(__file__).parents[2] / "assets" / "screenshots"
FAULTS = {"k1": 0.25, "k2": 0.7, "k3": 0.3, "k6": 0.5}
HINGE = (
    "simulate --effect hinge_moment:stiffness_Nm_rad=1000 --command sine --set amplitude_rad=0.025 "
    "--set frequency_Hz=3 --duration 1 --noise-current 0.2 --sample-rate 10000 --out"
).split()
MOMENT_S = 0.25
SETTLED_MS = 4000  # until charts have their width, and the actuator is drawn with its labels
LONG_MS = 600_000
CLOSE = ".mantine-Notification-closeButton"


def explore(page: Any, app: App, _: Path) -> None:
    """Faults of the sliders, in the charts and at their places, at a moment."""
    page.get_by_role("button", name="Got it").click()
    broken(app)
    app.strip.rest_at(MOMENT_S, "explore")


def identify(page: Any, app: App, _: Path) -> None:
    """The same faults, found."""
    broken(app)
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_role("link", name="in Rerun").wait_for(timeout=LONG_MS)


def compare(page: Any, app: App, folder: Path) -> None:
    """A hidden hinge moment, and the first region where the model fails."""
    recording = folder / "hinge.csv"
    emaviz([*HINGE, str(recording)])
    page.locator("input[type=file]").first.set_input_files(recording)
    region = page.get_by_role("button", name="The motor needs").first
    region.wait_for(timeout=LONG_MS)
    region.click()


def discover(page: Any, app: App, _: Path) -> None:
    """A challenge, solved."""
    page.get_by_label("Measurements", exact=True).click()
    page.get_by_role("option", name="After the overhaul").click()
    page.get_by_role("button", name="Start", exact=True).click()
    page.get_by_role("button", name="Find all").click(timeout=LONG_MS)
    page.get_by_text("Finding all that is missing: done").wait_for(timeout=LONG_MS)


def broken(app: App) -> None:
    """The plant of Explore's sliders, with its faults."""
    app.session.settings.set("k", list(vector(FAULTS)))
    for tab in app.shared.tabs.values():
        tab.show_settings()
    app.session.refresh()


STATES = {state.__name__: state for state in (explore, identify, compare, discover)}


def picture(chromium: Any, name: str) -> None:
    """Of an app of its own."""
    with tempfile.TemporaryDirectory() as folder:
        app = App("127.0.0.1", 0, Path(folder) / "data")
        app.wait_for_first_picture(120.0)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.goto(f"{app.address}/?view={name}")
        page.locator("[role=tab][aria-selected=true]", has_text=name.capitalize()).wait_for(timeout=60_000)
        page.wait_for_timeout(SETTLED_MS)
        app.strip.play(False)
        STATES[name](page, app, Path(folder))
        page.wait_for_timeout(SETTLED_MS)
        page.evaluate(f"document.querySelectorAll('{CLOSE}').forEach(one => one.click())")
        page.mouse.move(700, 5)  # over nothing that lights up
        page.wait_for_timeout(SETTLED_MS)
        page.screenshot(path=PICTURES / f"{name}.png")
        page.close()
        app.close()


def export(chromium: Any, to: Path) -> None:
    """The report of an export: of the model that was found in a challenge, on its recordings."""
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        emaviz(["challenge", "after_the_overhaul", "--out", str(at / "overhaul")])
        files = [str(at / "overhaul" / f"{name}.parquet") for name in ("chirp", "step", "sine", "unseen")]
        emaviz(["discover", *files[:3], "--holdout", files[3], "--save-actuator", str(at / "better.toml")])
        targets = [word for name in ("c", "fmu", "mjcf") for word in ("--to", name)]
        report = str(at / "home.html")
        emaviz(["export", str(at / "better.toml"), *files, *targets, "--out", str(at / "home"), "--report", report])
        show(chromium, report, to)


def show(chromium: Any, report: str, to: Path) -> None:
    """A report from its answer to its first chart."""
    page = chromium.new_page(viewport={"width": 1100, "height": 1390})
    page.goto(f"file://{report}")
    page.wait_for_timeout(SETTLED_MS)
    page.screenshot(path=to)
    page.close()


def main(names: list[str]) -> None:
    """Those that are named, or all."""
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        for name in names or (*STATES, export.__name__):
            if name == export.__name__:
                export(chromium, PICTURES / f"{name}.png")
            else:
                picture(chromium, name)
            print(PICTURES / f"{name}.png")
        chromium.close()


if __name__ == "__main__":
    main(sys.argv[1:])
