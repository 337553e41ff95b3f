"""Runs that were killed."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest
from rerun.chunk import RrdReader

from emaviz.recording import RecordingError, RecordingWriter
from emaviz.recording.read import read
from emaviz.recording.recover import recover

RUN = """
import sys, time, numpy as np
from emaviz.recording import RecordingWriter
writer = RecordingWriter(sys.argv[1])
writer.config("# run")
writer.signals("reference", np.arange(1000) / 1e4, {"current_A": np.arange(1000.0)})
for i in range(40):
    writer.iteration("hba", i, 1.0 / (i + 1), np.full(8, i / 40), np.full((5, 8), i / 40))
time.sleep(1.0)
print("ready", flush=True)
time.sleep(60)
"""


@pytest.fixture
def running(tmp_path):
    process = subprocess.Popen([sys.executable, "-c", RUN, str(tmp_path / "a.rrd")], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_killed_run_is_recovered_and_a_living_one_left_alone(tmp_path, running):
    part = tmp_path / "a.rrd.part"
    assert recover(tmp_path) == [] and part.exists()
    with pytest.raises(RecordingError, match="recorded already"):
        RecordingWriter(tmp_path / "a.rrd")
    running.kill()
    running.wait()
    assert len(read(part).identification["hba"].iteration) == 40  # readable even before
    (tmp_path / "a.rrd").write_bytes(b"another recording")
    (found,) = recover(tmp_path)
    assert found.ok and found.path == tmp_path / "a-recovered.rrd" and "recovered" in str(found)
    assert (tmp_path / "a.rrd").read_bytes() == b"another recording"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a-recovered.rrd", "a.rrd"]
    recording = read(found.path)
    assert recording.complete and recording.config == "# run"
    np.testing.assert_array_equal(recording.signals["reference"]["current_A"].values, np.arange(1000.0))
    np.testing.assert_array_equal(recording.identification["hba"].iteration, np.arange(40))
    assert len(RrdReader(found.path).blueprints()) == 1
    assert recover(tmp_path) == []


def test_a_new_run_keeps_what_a_killed_one_left(tmp_path, running):
    running.kill()
    running.wait()
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.config("# new")
    (found,) = recover(tmp_path)
    assert found.path == tmp_path / "a-interrupted.rrd"
    assert read(tmp_path / "a.rrd").config == "# new" and read(found.path).config == "# run"


def test_parts_without_use_are_reported(tmp_path):
    (tmp_path / "empty.rrd.part").touch()
    (tmp_path / "junk.rrd.part").write_bytes(b"no recording" * 100)
    (tmp_path / "start.rrd.part").write_bytes(b"RRF2")
    empty, junk, start = recover(tmp_path)
    assert not empty.ok and empty.path is None and "empty" in empty.message
    for found in (junk, start):
        assert not found.ok and found.path is not None and found.path.suffix == ".damaged"
        assert "\n" not in found.message
    assert sorted(p.name for p in tmp_path.iterdir()) == ["junk.rrd.damaged", "start.rrd.damaged"]
    with pytest.raises(RecordingError, match="no such folder"):
        recover(tmp_path / "none")


def test_iterations_reach_the_file_within_half_a_second(tmp_path):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.iteration("hba", 0, 1.0, np.zeros(8))
        time.sleep(0.6)
        assert len(read(tmp_path / "a.rrd.part").identification["hba"].iteration) == 1
