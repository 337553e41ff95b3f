"""What can go wrong while writing: refused at the start, or silent for the work that is recorded."""

from __future__ import annotations

import importlib
import subprocess
import sys
import threading
import time
from collections import namedtuple

import numpy as np
import psutil
import pytest
from rerun import chunk

from emaviz.recording import RecordingError, RecordingWriter, entry
from emaviz.recording.read import read
from emaviz.recording.writer import RrdFile

Usage = namedtuple("Usage", "total used free")
reading = importlib.import_module("emaviz.recording.read")  # the package gives the function that name


def test_a_recording_that_cannot_start_says_why(tmp_path, monkeypatch):
    for path, message in (
        (tmp_path / "none" / "a.rrd", "no such folder"),
        (tmp_path / "a.csv", "must end in .rrd"),
    ):
        with pytest.raises(RecordingError, match=message):
            RecordingWriter(path)
    (tmp_path / "b.rrd").mkdir()
    with pytest.raises(RecordingError, match="folder"):
        RecordingWriter(tmp_path / "b.rrd")
    monkeypatch.setattr(entry.shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 10**7))
    with pytest.raises(RecordingError, match="10 MB free, 200 MB are needed"):
        RecordingWriter(tmp_path / "c.rrd")
    assert [p.name for p in tmp_path.iterdir()] == ["b.rrd"]


def test_two_writers_cannot_share_a_name(tmp_path):
    with RecordingWriter(tmp_path / "a.rrd"):
        with pytest.raises(RecordingError, match="recorded already"):
            RecordingWriter(tmp_path / "a.rrd")
    with RecordingWriter(tmp_path / "a.rrd"):
        pass
    assert [p.name for p in tmp_path.iterdir()] == ["a.rrd"]


def test_an_existing_recording_stays_until_the_new_one_is_whole(tmp_path, signals):
    path = tmp_path / "a.rrd"
    path.write_bytes(b"the old one")
    writer = RecordingWriter(path)
    writer.signals("monitor", *signals)
    assert path.read_bytes() == b"the old one"
    writer.close()
    writer.close()
    assert read(path).groups == ["monitor"]


def test_an_exception_keeps_what_was_recorded(tmp_path, signals):
    with pytest.raises(KeyError), RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.signals("monitor", *signals)
        raise KeyError
    assert read(tmp_path / "a.rrd").groups == ["monitor"]


def test_a_write_failure_turns_the_writer_off(tmp_path, signals, monkeypatch):
    writer = RecordingWriter(tmp_path / "a.rrd")
    writer.signals("reference", *signals)

    def broken(*_, **__):
        raise RuntimeError("No space left\non device")

    monkeypatch.setattr("rerun.RecordingStream.send_columns", broken)
    writer.signals("monitor", *signals)
    assert writer.failed is not None and "No space left on device" in writer.failed and "\n" not in writer.failed
    writer.signals("monitor", *signals)
    writer.iteration("hba", 0, 1.0, np.zeros(8))
    writer.result({"a": 1}, "hba")
    writer.close()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.rrd.part"]


def test_a_disk_that_runs_full_ends_the_recording_in_time(tmp_path, signals, monkeypatch):
    writer = RecordingWriter(tmp_path / "a.rrd")
    monkeypatch.setattr(entry.shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 10**6))
    writer.signals("reference", *signals)
    assert writer.failed is not None and "1 MB free" in writer.failed
    writer.signals("monitor", *signals)
    writer.close()
    assert read(tmp_path / "a.rrd").groups == ["reference"]


REAL_FAILURE = """
import resource, sys, numpy as np
from emaviz.recording import RecordingWriter
writer = RecordingWriter(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
for i in range(20):
    writer.signals("reference", np.arange(20_000) / 1e4 + i, {"current_A": np.random.rand(20_000)})
writer.close()
print(writer.failed)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit on file sizes")
def test_a_file_that_cannot_grow_neither_raises_nor_hangs(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", REAL_FAILURE, str(tmp_path / "a.rrd")], capture_output=True, text=True, timeout=40
    )
    assert done.returncode == 0, done.stderr
    assert "recording stopped" in done.stdout
    assert not (tmp_path / "a.rrd").exists()


def test_a_stuck_disk_does_not_hang_close(tmp_path, monkeypatch):
    writer = RecordingWriter(tmp_path / "a.rrd", close_timeout_s=0.3)
    release, unregistered = threading.Event(), []
    monkeypatch.setattr("rerun.RecordingStream.disconnect", lambda _: release.wait(20))
    monkeypatch.setattr("rerun.unregister_shutdown", lambda: unregistered.append(True))
    start = time.perf_counter()
    writer.close()
    assert time.perf_counter() - start < 2.0
    assert writer.failed is not None and "not finished within" in writer.failed and unregistered
    release.set()


def test_iterations_cost_little_and_come_from_any_thread(tmp_path):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        population = np.random.default_rng(0).random((50, 8))

        def work(algorithm):
            for i in range(150):
                writer.iteration(algorithm, i, 1.0, population[0], population, population[:, 0])

        start = time.perf_counter()
        work("hba")
        each = (time.perf_counter() - start) / 150
        threads = [threading.Thread(target=work, args=(name,)) for name in ("ssa", "do")]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    found = read(tmp_path / "a.rrd").identification
    assert {name: len(trace.iteration) for name, trace in found.items()} == {"hba": 150, "ssa": 150, "do": 150}
    assert each < 0.003  # s; 0.03 ms when nothing else runs


def test_many_recordings_leave_no_threads(tmp_path, signals):
    def one(i):
        with RecordingWriter(tmp_path / f"{i}.rrd") as writer:
            writer.signals("monitor", *signals)
            writer.iteration("hba", 0, 1.0, np.zeros(8))

    one(0)
    time.sleep(0.5)
    before = psutil.Process().num_threads()
    for i in range(1, 51):
        one(i)
    time.sleep(0.5)
    assert psutil.Process().num_threads() <= before + 3
    assert len(list(tmp_path.glob("*.rrd"))) == 51


def test_rerun_turned_off_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("rerun.RecordingStream.save", lambda *_: None)
    with pytest.raises(RecordingError, match="RERUN=off"):
        RrdFile(tmp_path / "a.rrd", "a", 0)
    assert not list(tmp_path.iterdir())


def test_what_the_program_cannot_verify_never_reaches_the_reader(tmp_path, signals, monkeypatch):
    """Its native part ends the whole process on some damage, the page with it."""
    time_s, values = signals
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.signals("reference", time_s, values)
    assert read(tmp_path / "a.rrd").complete
    program = reading.run
    asked = []

    def run(*arguments, **options):
        asked.append(arguments[1])
        if arguments[1] == "verify":
            raise RecordingError("rerun rrd verify failed: exit code 102")
        program(*arguments, **options)

    native = chunk.RrdReader

    def reader(path):
        assert path.name == "repaired.rrd", "it is read"
        return native(path)

    monkeypatch.setattr(reading, "run", run)
    monkeypatch.setattr(chunk, "RrdReader", reader)
    with pytest.raises(RecordingError, match="is damaged and cannot be repaired: its contents cannot be decoded"):
        read(tmp_path / "a.rrd")
    assert asked == ["verify", "optimize", "verify"]
