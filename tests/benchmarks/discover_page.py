"""How soon Discover answers, and the guided first challenge at a reader's pace.

python tests/benchmarks/discover_page.py: a reader takes four words a second.  An answer is timed by the page's own
clock, from the click to the step's Stop button or the truth.  With EMAVIZ_CACHE_DIR at an empty folder it is the tour
of a first visit, compilation included.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
from support.browser import SOFTWARE_GL

from emaviz.page.app import App

WORDS_PER_S = 4.0
ANSWERED = """async ([name, sign]) => {
  const shown = [...document.querySelectorAll('button')].filter(b => b.offsetParent !== null && !b.disabled);
  const started = performance.now();
  shown.find(b => b.textContent.trim() === name).click();
  const there = () => sign ? document.body.innerText.includes(sign)
    : [...document.querySelectorAll('button')].some(
        b => b.textContent.trim() === 'Stop' && b.offsetParent !== null && !b.disabled);
  while (!there() && performance.now() - started < 5000) await new Promise(requestAnimationFrame);
  return performance.now() - started;
}"""


def main() -> None:
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        app = App("127.0.0.1", 0, Path(folder))
        app.wait_for_first_picture(120.0)
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(240_000)
        page.goto(app.address)
        page.get_by_role("tab", name="Discover", exact=True).click()
        page.get_by_role("button", name="Guided first challenge").click()
        page.get_by_text("Step 1 of 6").wait_for()
        started = time.perf_counter()
        tour(page, app)
        print(f"the guided first challenge, read to its end: {time.perf_counter() - started:.0f} s")
        chromium.close()
        app.close()


def tour(page: Any, app: App) -> None:
    read(page, "Step 1 of 6")
    read(page, "A new actuator is on the bench")
    step(page, app, "Start")
    read(page, "Step 3 of 6")
    page.get_by_role("button", name="Cogging torque").first.click()
    read(page, "Step 4 of 6")
    page.wait_for_timeout(5000)  # looks at the line and the points
    step(page, app, "Add it to the model")
    read(page, "The ladder on the right has fallen")
    page.wait_for_timeout(3000)  # and at the ladder
    answered = page.evaluate(ANSWERED, ["Reveal the truth", "Your answer agrees"])
    print(f"Reveal the truth: answered after {answered:.0f} ms")
    read(page, "Step 6 of 6")


def read(page: Any, text: str) -> None:
    """Reads the paragraph in which this text stands."""
    line = page.get_by_text(text).first
    line.wait_for()
    time.sleep(len(line.inner_text().split()) / WORDS_PER_S)


def step(page: Any, app: App, name: str) -> None:
    """Presses a button that starts a step, and waits until it is done."""
    started = time.perf_counter()
    answered = page.evaluate(ANSWERED, [name, ""])
    while app.discovering.running or app.discovering.look is None or app.discovering.look.assessment is None:
        time.sleep(0.02)
    print(f"{name}: answered after {answered:.0f} ms, done after {time.perf_counter() - started:.1f} s")


if __name__ == "__main__":
    main()
