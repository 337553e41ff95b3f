"""From a slider's key press to the redrawn chart, measured in the browser: python tests/benchmarks/slider_latency.py

Each press is timed by the page's own clock until the chart's data has changed and a frame was drawn.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))
from conftest import SOFTWARE_GL

from emaviz.app import App

PRESSES = 40
TIMED = """async () => {
  const slider = [...document.querySelectorAll('[role=slider]')][0];
  const charts = () => Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  const chart = charts().find(c => c.root.querySelector('.u-title')?.textContent === 'Equivalent current');
  slider.focus();
  const before = chart.data;
  const started = performance.now();
  slider.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', code: 'ArrowRight', bubbles: true}));
  while (chart.data === before && performance.now() - started < 5000) await new Promise(requestAnimationFrame);
  await new Promise(requestAnimationFrame);
  return performance.now() - started;
}"""


def main() -> None:
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        app = App("127.0.0.1", 0, Path(folder))
        app.wait_for_first_picture(120.0)
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.goto(app.address)
        page.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
        page.wait_for_timeout(3000)
        for what, busy in (("idle", False), ("with an identification running", True)):
            if busy:
                app.session.settings.set_iterations(5000)
                app.session.identify()
            times = []
            for _ in range(PRESSES):
                times.append(page.evaluate(TIMED))
                page.wait_for_timeout(60)
            print(
                f"slider to redrawn chart, {what}: median {np.median(times):.0f} ms, "
                f"95th percentile {np.percentile(times, 95):.0f} ms ({PRESSES} presses)"
            )
            app.session.stop()
        chromium.close()
        app.close()


if __name__ == "__main__":
    main()
