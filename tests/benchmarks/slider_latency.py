"""From a slider to the redrawn chart, measured in the browser: python tests/benchmarks/slider_latency.py

A press is timed by the page's own clock until the chart's data has changed and a frame was drawn.  A drag is a
press every 20 ms; its redraws are counted, with what each costs the app and the browser in processor time, which
says more than redraws per second on a busy machine.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
from support.browser import SOFTWARE_GL

from emaviz.page.app import App

PRESSES, DRAGGED_S = 40, 8.0
PAGE = """() => {
  const charts = () => Object.values(window.__viserTestpoints.uplots).map(u => u.chart);
  window.__chart = () => charts().find(c => c.root.querySelector('.u-title')?.textContent === 'Equivalent current');
  // the arrows shall move the slider and not the camera, which would go on without a key's release
  document.body.addEventListener('keydown', (event) => event.stopPropagation());
  window.__press = (key) => {
    const slider = [...document.querySelectorAll('[role=slider]')][0];
    slider.dispatchEvent(new KeyboardEvent('keydown', {key, code: key, bubbles: true}));
  }; }"""
TIMED = """async () => {
  const chart = window.__chart(), before = chart.data, started = performance.now();
  window.__press('ArrowRight');
  while (chart.data === before && performance.now() - started < 5000) await new Promise(requestAnimationFrame);
  await new Promise(requestAnimationFrame);
  return performance.now() - started;
}"""
DRAGGED = """async (seconds) => {
  const chart = window.__chart(), started = performance.now();
  let redraws = 0, frames = 0, presses = 0, last = chart.data;
  const timer = setInterval(() => window.__press(presses++ % 80 < 40 ? 'ArrowRight' : 'ArrowLeft'), 20);
  while (performance.now() - started < 1000 * seconds) {
    await new Promise(requestAnimationFrame);
    frames++;
    if (chart.data !== last) { redraws++; last = chart.data; }
  }
  clearInterval(timer);
  return [redraws, frames];
}"""


def processor_s(processes: list[psutil.Process]) -> float:
    """Of these processes."""
    total = 0.0
    for process in processes:
        try:
            times = process.cpu_times()
        except psutil.Error:
            continue
        total += times.user + times.system
    return total


def main() -> None:
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        app = App("127.0.0.1", 0, Path(folder))
        app.wait_for_first_picture(120.0)
        app.session.ready.wait(120.0)
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.goto(app.address)
        page.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
        page.wait_for_timeout(3000)
        page.evaluate(PAGE)
        me, browser = [psutil.Process()], psutil.Process().children(recursive=True)
        for what, busy in (("idle", False), ("with an identification running", True)):
            if busy:
                app.session.settings.set("iterations", 5000)
                app.session.settings.set("algorithms", ["hba"])
                app.session.identify()
            times = []
            for _ in range(PRESSES):
                times.append(page.evaluate(TIMED))
                page.wait_for_timeout(60)
            print(
                f"slider to redrawn chart, {what}: median {np.median(times):.0f} ms, "
                f"95th percentile {np.percentile(times, 95):.0f} ms ({PRESSES} presses)"
            )
            ours, its, started = processor_s(me), processor_s(browser), time.perf_counter()
            redraws, frames = page.evaluate(DRAGGED, DRAGGED_S)
            ours, its, elapsed = processor_s(me) - ours, processor_s(browser) - its, time.perf_counter() - started
            print(
                f"dragging, {what}: {redraws / elapsed:.1f} redraws/s, {frames / elapsed:.0f} frames/s; processor time "
                f"each: app {1e3 * ours / max(redraws, 1):.0f} ms, browser {1e3 * its / max(redraws, 1):.0f} ms"
            )
            app.session.identifying.job.stop()
        print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        chromium.close()
        app.close()


if __name__ == "__main__":
    main()
