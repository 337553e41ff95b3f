"""Poses of the 3D actuator per second with software GL: python tests/benchmarks/poses.py

On a busy machine frames per second say little; the browser's processor time per frame says what a frame costs.
"""

from __future__ import annotations

import math
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import psutil
from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
from support.browser import SOFTWARE_GL

from emaviz.page.app import App
from emaviz.scene.actuator import ActuatorScene
from emaviz.server.safe_server import open_server

SECONDS, PUSHED_PER_S = 8.0, 32.0
COUNT = """() => { window.__drawn = 0; const poses = new Set();
  const watch = () => { const pose = window.__viserMutable.nodePoseData['/actuator/motor/axis/rotor'];
    if (pose && !poses.has(String(pose.wxyz))) { poses.add(String(pose.wxyz)); window.__drawn++; }
    requestAnimationFrame(watch); }; watch(); }"""


def processor_s() -> float:
    """Of all processes of the browser."""
    total = 0.0
    for process in psutil.Process().children(recursive=True):
        try:
            times = process.cpu_times()
        except psutil.Error:
            continue
        total += times.user + times.system
    return total


def scene_alone(chromium: Browser) -> None:
    """Pushed faster than it can be drawn, on a canvas as large as the window."""
    server = open_server("127.0.0.1", 0)
    scene = ActuatorScene(server)
    page = chromium.new_page(viewport={"width": 1000, "height": 650})
    page.goto(f"http://127.0.0.1:{server.get_port()}")
    page.wait_for_function("window.__viserMutable?.nodePoseData !== undefined", timeout=60_000)
    page.wait_for_timeout(4000)
    page.evaluate(COUNT)
    started, used, step = time.perf_counter(), processor_s(), 0
    before = page.evaluate("window.__drawn")
    while time.perf_counter() - started < SECONDS:
        step += 1
        phases = tuple(math.sin(0.1 * step + 2.0 * math.pi * i / 3.0) for i in range(3))
        scene.pose(0.05 * step, 0.3 * math.sin(0.1 * step), 0.0, phases, 0.0)
        time.sleep(1.0 / PUSHED_PER_S)
    drawn = page.evaluate("window.__drawn") - before
    elapsed, used = time.perf_counter() - started, processor_s() - used
    each = 1e3 * used / max(drawn, 1)
    print(f"the scene alone, 1000 × 650: {drawn / elapsed:.1f} poses/s drawn, {each:.0f} ms of processor time each")
    page.close()
    server.stop()


def whole_page(chromium: Browser, app: App, width: int, height: int) -> None:
    """The app as it plays after its start, charts and panels around the scene."""
    page = chromium.new_page(viewport={"width": width, "height": height})
    page.goto(app.address)
    page.wait_for_function("Object.keys(window.__viserTestpoints?.uplots ?? {}).length >= 4", timeout=60_000)
    page.wait_for_timeout(4000)
    page.evaluate(COUNT)
    before = page.evaluate("window.__drawn")
    page.wait_for_timeout(1e3 * SECONDS)
    drawn = page.evaluate("window.__drawn") - before
    print(f"the app's page, {width} × {height}: {drawn / SECONDS:.1f} poses/s drawn")
    page.close()


def main() -> None:
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        chromium = playwright.chromium.launch(executable_path=path, args=SOFTWARE_GL)
        scene_alone(chromium)
        app = App("127.0.0.1", 0, Path(folder))
        app.session.ready.wait(120.0)
        for width, height in ((1000, 650), (1400, 900)):
            whole_page(chromium, app, width, height)
        print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
        chromium.close()
        app.close()


if __name__ == "__main__":
    main()
