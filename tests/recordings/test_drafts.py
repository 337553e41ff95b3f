"""Files appear whole; what a killed process left of them goes at the next start, what a living one writes stays."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from unittest.mock import Mock

import pytest

from ema_model.files.written import new_draft, remove_abandoned, whole_file
from emaviz.session.data_folder import DataFolder

WRITING = """
import sys, time
from ema_model.files.written import whole_file
with whole_file(sys.argv[1]) as draft:
    draft.write_text("half")
    print("ready", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def writing(tmp_path):
    """A process that writes tmp_path/sessions/a.txt and does not come to the end."""
    (tmp_path / "sessions").mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", WRITING, str(tmp_path / "sessions" / "a.txt")], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def names(folder):
    return sorted(os.listdir(folder))


def test_drafts_go_with_their_process_and_not_before(tmp_path, writing):
    folder = tmp_path / "sessions"
    before = names(folder)
    assert len(before) == 2 and before[0].endswith(".part")
    DataFolder(tmp_path)
    assert names(folder) == before
    writing.kill()
    writing.wait()
    assert names(folder) == before
    DataFolder(tmp_path)
    assert names(folder) == []


def test_a_whole_file_leaves_nothing_beside_it(tmp_path):
    with whole_file(tmp_path / "a.txt") as draft:
        draft.write_text("new")
        remove_abandoned(tmp_path)  # its process lives
        assert draft.read_text() == "new"
    assert names(tmp_path) == ["a.txt"]
    with pytest.raises(KeyError), whole_file(tmp_path / "a.txt") as draft:
        draft.write_text("newer")
        raise KeyError
    assert names(tmp_path) == ["a.txt"] and (tmp_path / "a.txt").read_text() == "new"


def test_only_drafts_are_removed(tmp_path):
    kept = ["a.part", ".hidden", "a.lock", "run.rrd.part", ".0123456789abcdef.part.txt", ".env.part"]
    left = [".0123456789abcdef.part", ".fedcba9876543210.part.lock", "run.rrd.part.lock", "b.rrd.part.lock"]
    for name in (*kept, *left):
        (tmp_path / name).write_text("x")
    (tmp_path / ".aaaaaaaaaaaaaaaa.part").mkdir()
    remove_abandoned(tmp_path)
    assert names(tmp_path) == sorted([*kept, ".aaaaaaaaaaaaaaaa.part"])
    remove_abandoned(tmp_path / "none")


def test_files_are_written_where_the_file_system_has_no_locks(tmp_path, monkeypatch):
    monkeypatch.setattr("fcntl.flock", Mock(side_effect=OSError(errno.ENOSYS, "Function not implemented")))
    with whole_file(tmp_path / "a.txt") as draft:
        draft.write_text("new")
    assert names(tmp_path) == ["a.txt"]


def test_an_upload_on_its_way_stays_and_leaves_nothing(tmp_path):
    folder = DataFolder(tmp_path)
    part = folder.part()
    part.write_text("time_s\n")
    DataFolder(tmp_path)
    assert part.exists()
    path = folder.keep(part, "run.csv")
    assert names(folder.uploads) == ["run.csv"] and path.read_text() == "time_s\n"
    dropped = folder.part()
    dropped.touch()
    dropped.unlink()
    folder.part().touch()
    assert len(names(folder.uploads)) == 3  # the file, and the last part with its lock


def test_a_draft_names_its_folder(tmp_path):
    draft, lock = new_draft(tmp_path)
    assert draft.parent == tmp_path and not draft.exists() and lock is not None
    lock.release()
    assert names(tmp_path) == []


def test_a_recording_is_taken_in_whole(tmp_path, monkeypatch):
    given = tmp_path / "run.csv"
    given.write_text("time_s\n")
    given.with_suffix(".toml").write_text("schema = 1\n")
    folder = DataFolder(tmp_path / "data")

    def cut_off(source, target):
        target.write_text("ti")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("shutil.copyfile", cut_off)
    with pytest.raises(ValueError, match="No space left"):
        folder.take_in(given)
    assert names(folder.uploads) == []
    monkeypatch.undo()
    folder.take_in(given)
    assert names(folder.uploads) == ["run.csv", "run.toml"]
