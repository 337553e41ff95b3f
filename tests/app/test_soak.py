"""A long session: sliders, identifications, recordings, tab switches; nothing may pile up and nothing may fail."""

from __future__ import annotations

import gc
import threading
import time

import numpy as np
import psutil
import pytest

from emaviz.page.app import App

pytestmark = pytest.mark.browser
TABS = ("Explore", "Identify", "Compare", "Runs")
WARM_UP = 0.4  # of the rounds
MORE_MEMORY = 1.10


def one_round(app, page, number, done):
    """Sliders, an identification with its recording, another tab."""
    session = app.session
    rng = np.random.default_rng(number)
    page.get_by_role("tab", name=TABS[number % len(TABS)]).click()
    for _ in range(5):
        session.settings.set_fault(int(rng.integers(8)), rng.random())
        session.refresh()
        time.sleep(0.02)
    session.settings.set("seed", number)
    done.clear()
    assert session.identify()
    assert done.wait(60.0), "an identification did not end"
    end = time.monotonic() + 20.0
    while session.worker.busy:
        assert time.monotonic() < end
        time.sleep(0.01)


def measure(process):
    gc.collect()
    return process.memory_info().rss / 1e6, process.num_threads(), process.num_fds()


def soak(browser, folder, capfd, rounds, iterations, seconds):
    app = App("127.0.0.1", 0, folder)
    faults, readings = [], []
    try:
        assert app.wait_for_first_picture(120.0) and app.session.ready.wait(60.0)
        app.session.events.told.connect(lambda title, text: faults.append(f"{title}: {text}"))
        page = browser.new_page(viewport={"width": 1000, "height": 650})
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(app.address)
        page.get_by_role("tab", name="Explore").wait_for(timeout=60_000)
        app.session.settings.set("algorithms", ["do", "hba"])
        app.session.settings.set("population", 20)
        app.session.settings.set("iterations", iterations)
        done = threading.Event()
        app.session.identifying.identified.connect(lambda race: done.set())
        process, end = psutil.Process(), time.monotonic() + seconds
        for number in range(rounds):
            one_round(app, page, number, done)
            readings.append(measure(process))
            if time.monotonic() > end:
                break
        time.sleep(1.0)
        readings.append(measure(process))
        page.close()
        written = len(list(app.session.folder.glob("*.rrd")))
    finally:
        app.close()
    memory, threads, handles = np.array(readings).T
    warm = max(1, int(WARM_UP * len(readings)))
    logged = capfd.readouterr().err
    print(
        f"{len(readings) - 1} rounds: memory {memory[warm]:.0f} → {memory[-1]:.0f} MB, threads {threads[warm]:.0f} → "
        f"{threads[-1]:.0f}, handles {handles[warm]:.0f} → {handles[-1]:.0f}, {written} recordings"
    )
    assert written == len(readings) - 1
    assert memory[-1] <= MORE_MEMORY * memory[warm], memory.round().tolist()
    assert threads[-1] <= threads[warm : warm + 5].max() + 1, threads.tolist()
    assert handles[-1] <= handles[warm : warm + 5].max() + 2, handles.tolist()
    assert not faults and "Traceback" not in logged and "ERROR" not in logged, (faults, logged[-2000:])


@pytest.mark.long
def test_work_piles_up_nothing(browser, tmp_path, capfd):
    soak(browser, tmp_path, capfd, rounds=12, iterations=3, seconds=25.0)


@pytest.mark.study
def test_an_hour_of_work_piles_up_nothing(browser, tmp_path, capfd):
    soak(browser, tmp_path, capfd, rounds=200, iterations=150, seconds=3600.0)
