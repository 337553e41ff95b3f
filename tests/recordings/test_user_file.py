"""Pipes and devices under the name of a user's file: refused at once, at every door."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from ema_model.actuator import load_actuator
from ema_model.challenges import sealed_challenge
from ema_model.errors import InputError
from ema_model.files.opened import open_user_file
from ema_model.recordings import read, read_columns, read_side_file
from ema_model.recordings.read import read_measurement
from emaviz.cli import main
from emaviz.recording import RecordingError
from emaviz.recording.read import check, recover, recover_part
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="makes a pipe")

DOORS = {
    "actuator": (load_actuator, "a.toml"),
    "side file": (read_side_file, "a.toml"),
    "measurement": (read_measurement, "a.csv"),
    "columns": (read_columns, "a.csv"),
    "recording": (lambda path: read(path, load_actuator()), "a.csv"),
    "challenge": (sealed_challenge, "a.challenge"),
    "session": (lambda path: session_file.read_session(path, {}, DataFolder(path.parent)), "a.emaviz"),
    "taken in": (lambda path: DataFolder(path.parent / "data").take_in(path), "a.csv"),
    "rrd": (check, "a.rrd"),
    "part": (lambda path: recover_part(path, path.with_name("b.rrd")), "a.rrd.part"),
}


@pytest.fixture(autouse=True)
def _no_waiting():
    """A pipe that is waited for fails the test instead of holding it up."""

    def waited(*_):
        raise AssertionError("the pipe was waited for")

    before = signal.signal(signal.SIGALRM, waited)
    signal.setitimer(signal.ITIMER_REAL, 30.0)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("door, name", DOORS.values(), ids=DOORS)
def test_a_pipe_is_refused_at_every_door(door, name, tmp_path):
    os.mkfifo(tmp_path / name)
    with pytest.raises((InputError, RecordingError), match=r"is not a regular file; .* is expected"):
        door(tmp_path / name)


def test_devices_are_refused(tmp_path):
    for door in (load_actuator, read_side_file):
        with pytest.raises(InputError, match="/dev/zero: is not a regular file"):
            door("/dev/zero")


def test_a_pipe_in_the_place_of_a_side_file_is_told(tmp_path):
    (tmp_path / "a.csv").write_text("time_s,current_A\n" + "".join(f"{i},1\n" for i in range(200)))
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(InputError, match=r"a\.toml: is not a regular file"):
        read_measurement(tmp_path / "a.csv")


def test_a_pipe_that_takes_the_file_s_place_is_refused(tmp_path, monkeypatch):
    path, pipe = tmp_path / "a.toml", tmp_path / "pipe"
    path.write_text("x")
    os.mkfifo(pipe)
    plain = os.open
    monkeypatch.setattr(os, "open", lambda name, flags: plain(pipe, flags))
    with pytest.raises(InputError, match="is not a regular file"):
        open_user_file(path, "an actuator file")


def test_a_pipe_among_the_parts_is_left_alone(tmp_path):
    os.mkfifo(tmp_path / "a.rrd.part")
    assert recover(tmp_path) == [] and (tmp_path / "a.rrd.part").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["gui", "PIPE.csv", "--no-open"],
        ["gui", "--actuator", "PIPE.toml", "--no-open"],
        ["simulate", "--command", "PIPE.csv", "--out", "out.csv"],
        ["identify", "PIPE.csv"],
        ["compare", "PIPE.csv"],
        ["compare", "PIPE.csv", "--actuator", "PIPE.toml"],
        ["discover", "in.csv", "--holdout", "PIPE.csv"],
        ["view", "PIPE.rrd"],
        ["recover", "PIPE.part"],
    ],
    ids=" ".join,
)
def test_commands_refuse_a_pipe_in_one_line(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.csv").write_text("time_s,current_A\n")
    for suffix in ("csv", "toml", "rrd", "part"):
        os.mkfifo(f"PIPE.{suffix}")
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "is not a regular file" in told
