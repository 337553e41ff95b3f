"""Runs that were killed."""

from __future__ import annotations

import http.client
import os
import re
import subprocess
import sys
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from rerun.chunk import RrdReader
from support.documents import result_of
from support.on_page import wait_until

from emaviz.cli import main
from emaviz.recording import RecordingError, RecordingWriter, writer
from emaviz.recording.read import read, recover

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


@pytest.mark.long
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
    """Of a machine that has the time; a loaded one writes them, too."""
    assert writer._FLUSH_EVERY_S <= 0.5

    def written():
        traces = read(tmp_path / "a.rrd.part").identification
        return "hba" in traces and len(traces["hba"].iteration) == 1

    with RecordingWriter(tmp_path / "a.rrd") as recording:
        recording.iteration("hba", 0, 1.0, np.zeros(8))
        wait_until(written, 30.0)


def test_the_command_recovers_a_part_and_overwrites_nothing(tmp_path, running, capsys):
    part, target = tmp_path / "a.rrd.part", tmp_path / "a.rrd"
    assert main(["recover", str(part)]) == 2
    assert "is still being written; end what writes it first" in capsys.readouterr().err
    running.kill()
    running.wait()
    target.write_bytes(b"another recording")
    for out in ([], ["--out", str(target)]):
        assert main(["recover", str(part), *out]) == 2
        told = capsys.readouterr().err
        assert "exists already" in told and "--force" in told and told.count("\n") == 1
    assert target.read_bytes() == b"another recording" and part.exists()
    assert main(["recover", str(part), "--force", "--json", str(tmp_path / "r.json")]) == 0
    assert f"{target}: recovered from a.rrd.part" in capsys.readouterr().out
    assert sorted(os.listdir(tmp_path)) == ["a.rrd", "r.json"]
    assert result_of(tmp_path / "r.json", "recover")["file"] == str(target)
    recording = read(target)
    assert recording.complete and recording.config == "# run"
    assert len(recording.identification["hba"].iteration) == 40 and len(RrdReader(target).blueprints()) == 1


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.rrd.part", b"", "is empty"),
        ("a.rrd.part", b"RRF2", "rrd optimize failed|nothing in it can be read|damaged"),
        ("a.rrd.part", b"no recording" * 100, "a.rrd.part"),
        ("a.rrd", b"RRF2 something", "ends in .part"),
        ("none.rrd.part", None, "no such file"),
    ],
)
def test_what_cannot_be_recovered_stays_as_it_is(name, content, says, tmp_path, capsys):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(["recover", str(tmp_path / name)]) == 2
    told = capsys.readouterr().err
    assert re.search(says, told) and told.count("\n") == 1
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.long
@pytest.mark.parametrize("killed", [True, False], ids=["killed", "being written"])
def test_view_shows_a_part(tmp_path, running, killed):
    if killed:
        running.kill()
        running.wait()
    before = sorted(os.listdir(tmp_path))
    command = [sys.executable, "-m", "emaviz", "view", str(tmp_path / "a.rrd.part"), "--no-open"]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert viewer.stdout is not None
        name, _, address = viewer.stdout.readline().strip().partition(": ")
        assert name == "a.rrd.part"
        file = urlsplit(parse_qs(urlsplit(address).query)["url"][0])
        connection = http.client.HTTPConnection(file.netloc, timeout=30)
        connection.request("GET", file.path)
        answer = connection.getresponse()
        assert answer.status == 200
        (tmp_path / "seen.rrd").write_bytes(answer.read())
        connection.close()
    finally:
        viewer.kill()
        viewer.wait()
        viewer.stdout.close()
    assert len(read(tmp_path / "seen.rrd").identification["hba"].iteration) == 40
    assert sorted(os.listdir(tmp_path)) == sorted([*before, "seen.rrd"])
