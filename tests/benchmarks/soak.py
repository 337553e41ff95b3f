"""What grows while somebody works: python tests/benchmarks/soak.py [ROUNDS]

Each round moves sliders and goes to another tab; every fifth one identifies and records, every tenth one compares a
recording, discovers, saves the session and loads it.  Memory of the app and of the browser's page, threads and open
files are told each ten rounds, with the kinds of objects that have become more.
"""

from __future__ import annotations

import gc
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1]))  # a script finds what tests share
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the app has it, before numpy is there
from support.browser import _NO_GL
from support.on_page import wait_until

from emaviz.cli import main as emaviz
from emaviz.page.app import App

BENCH = "bench.csv"  # of which a ripple is missing in the model
TABS = ("Explore", "Identify", "Compare", "Discover", "Units", "Track", "Bode", "Library", "Runs")
CHALLENGE = "first_bench_run"
TOLD_EACH, SHOWN = 10, 6


def round_of(app: App, page: Any, number: int) -> None:
    """One round."""
    session, rng = app.session, np.random.default_rng(number)
    page.get_by_role("tab", name=TABS[number % len(TABS)], exact=True).click()
    for _ in range(5):
        session.settings.set_fault(int(rng.integers(8)), rng.random())
        session.refresh()
        time.sleep(0.05)
    if number % 5 == 4:
        session.identify()
        rest(app)
    if number % 10 == 8:
        app.comparing.add(BENCH)
        wait_until(lambda: BENCH in app.comparing.opened)
        rest(app)
        app.comparing.compare()
        rest(app)
        app.comparing.remove(BENCH)
    if number % 10 == 7:
        app.discovering.source.choose(CHALLENGE)
        app.discovering.start()
        rest(app)
        app.discovering.add(app.discovering.look.promising[0].name)
        rest(app)
    if number % 10 == 9:
        page.get_by_role("tab", name="Runs", exact=True).click()
        for name in ("Save session", "Load session"):
            page.get_by_role("button", name=name).click()
            page.wait_for_timeout(1500)
            rest(app)


def rest(app: App) -> None:
    """Until nothing is computed."""
    time.sleep(0.2)
    wait_until(lambda: not (app.session.worker.busy or app.comparing.running or app.discovering.running))


def main(rounds: int) -> None:
    path = os.environ.get("EMAVIZ_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        data = Path(folder, "data")
        app = App("127.0.0.1", 0, data)
        emaviz(["simulate", "--effect", "cogging_torque", "--noise-current", "0.1", "--out", str(data / BENCH)])
        app.wait_for_first_picture(120.0)
        app.session.ready.wait(120.0)
        chromium = playwright.chromium.launch(executable_path=path, args=_NO_GL)
        page = chromium.new_page(viewport={"width": 1400, "height": 900})
        page.on("pageerror", lambda error: print(f"page: {error}"))
        page.goto(app.address)
        page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
        me, started = psutil.Process(), time.monotonic()
        before: Counter[str] = Counter()
        for number in range(rounds):
            round_of(app, page, number)
            if number % TOLD_EACH != TOLD_EACH - 1:
                continue
            gc.collect()
            renderer = max(one.memory_info().rss for one in me.children(recursive=True))
            print(
                f"{number + 1} rounds, {time.monotonic() - started:.0f} s: app {me.memory_info().rss / 1e6:.0f} MB, "
                f"page {renderer / 1e6:.0f} MB, {me.num_threads()} threads, {me.num_fds()} files",
                flush=True,
            )
            now = Counter(type(one).__name__ for one in gc.get_objects())
            more = [f"{name} +{count}" for name, count in (now - before).most_common(SHOWN)] if before else []
            print("   " + ", ".join(more), flush=True)
            before = now
        chromium.close()
        app.close()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
