"""What may fail around a run: rerun missing, its port taken, the disk full, the browser gone. The work goes on."""

from __future__ import annotations

import builtins
import math
import subprocess
import sys
import threading
import time
from collections import namedtuple

import pytest

from ema_model.actuator import load_actuator
from emaviz.page.app import App
from emaviz.recording import RecordingError, entry, read
from emaviz.session.explore import Session

Usage = namedtuple("Usage", "total used free")
LOST = "rerun was hidden by this test"


@pytest.fixture
def session(tmp_path):
    session = Session(load_actuator(), tmp_path)
    session.settings.set("algorithms", ["do"])
    session.settings.set("iterations", 5)
    session.start()
    assert session.ready.wait(120.0)
    yield session
    session.close()


def identified(session, seconds=60.0):
    done, races, told = threading.Event(), [], []
    session.events.told.connect(lambda title, text: told.append((title, text)))
    session.identifying.identified.connect(lambda race: (races.append(race), done.set()))
    assert session.identify()
    assert done.wait(seconds)
    return races[-1], told


def hide_rerun(monkeypatch):
    plain = builtins.__import__

    def refuse(name, *rest, **options):
        if name == "rerun" or name.startswith("rerun."):
            raise ImportError(LOST)
        return plain(name, *rest, **options)

    for name in [
        name for name in sys.modules if name.startswith(("emaviz.recording.identification", "emaviz.recording.writer"))
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", refuse)


def test_without_rerun_an_identification_runs_and_says_what_is_lost(session, monkeypatch):
    hide_rerun(monkeypatch)
    race, told = identified(session)
    assert race.path is None and math.isfinite(race.best.answer.rmse)
    assert told == [("The recording cannot be written", LOST)]


def test_the_app_is_imported_without_rerun():
    code = "import sys; sys.modules['rerun'] = None; import emaviz.page.app; print('fine')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "fine", done.stderr


@pytest.mark.long
def test_a_disk_that_fills_while_recording_is_told_and_the_answer_stays(session, monkeypatch, tmp_path):
    begun = threading.Event()

    def fill(race):
        if not begun.is_set():
            begun.set()
            monkeypatch.setattr(entry.shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 10**6))

    session.settings.set("iterations", 150)
    session.identifying.progressed.connect(fill)
    race, told = identified(session)
    assert race.path is None and race.best.answer.error_percent < 5.0
    assert len(told) == 1 and "1 MB free; free some space" in told[0][1] and "\n" not in told[0][1]
    (left,) = tmp_path.glob("*.rrd")
    assert read(left).signals["reference"], "what was written by then can be opened"


def test_a_disk_that_is_full_at_the_start_is_told(session, monkeypatch):
    monkeypatch.setattr(entry.shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 10**6))
    race, told = identified(session)
    assert race.path is None and math.isfinite(race.best.answer.rmse)
    assert len(told) == 1 and "200 MB are needed" in told[0][1]


def test_a_source_that_is_gone_is_told_and_frees_the_worker(session):
    told, ended = [], threading.Event()
    session.events.told.connect(lambda title, text: told.append(text))
    session.identifying.job.ended.connect(lambda _: ended.set())
    session.settings.set("source", "uploads/none.csv")
    assert session.identify()
    assert ended.wait(10.0)
    end = time.monotonic() + 5.0
    while not told and time.monotonic() < end:
        time.sleep(0.01)
    assert "none.csv" in told[0] and not session.worker.busy
    session.settings.set("source", "")
    assert identified(session)[0].best is not None


# --- in the app -------------------------------------------------------------------------------------------------------


def no_port(*_, **__):
    raise RecordingError("port 0 cannot be used: address already in use; choose another, or 0 for a free one")


@pytest.mark.long
@pytest.mark.browser
def test_a_viewer_without_a_port_is_told_and_a_browser_that_leaves_ends_nothing(browser, tmp_path, monkeypatch):
    monkeypatch.setattr("emaviz.page.app.ViewerHost", no_port)
    app = App("127.0.0.1", 0, tmp_path)
    try:
        assert app.wait_for_first_picture(120.0) and app.viewer is None
        assert app.session.ready.wait(60.0)
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(app.address)
        page.get_by_text("The Rerun viewer cannot be shown").wait_for(timeout=60_000)
        app.session.settings.set("algorithms", ["hba"])
        app.session.settings.set("iterations", 100)
        done = threading.Event()
        app.session.identifying.identified.connect(lambda race: done.set())
        page.get_by_role("tab", name="Identify").click()
        page.get_by_role("button", name="Identify", exact=True).click()
        end = time.monotonic() + 30.0
        while not app.session.worker.busy:
            assert time.monotonic() < end
            time.sleep(0.02)
        page.close()  # in the middle of the run
        assert done.wait(120.0), "the run goes on without a browser"
        assert list(app.session.folder.glob("*.rrd")), "recordings are written without a viewer"
        again = browser.new_page(viewport={"width": 1400, "height": 900})
        again.goto(app.address)
        again.get_by_role("tab", name="Identify").click()
        again.get_by_text("simulations in").wait_for(timeout=60_000)
        again.close()
    finally:
        app.close()
