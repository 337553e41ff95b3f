"""The data folder: nothing outside it is read or written, whatever name is asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.robot_datasets import write_robot_dataset

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.recordings.side_file import SideFile
from emaviz.session.data_folder import DataFolder, sanitised
from emaviz.session.files import read_opened

ROWS = "time_s,current_A\n" + "\n".join(f"{i * 1e-3},{i % 3}" for i in range(200)) + "\n"


@pytest.fixture
def folder(tmp_path):
    return DataFolder(tmp_path / "data")


@pytest.fixture
def outside(tmp_path):
    file = tmp_path / "outside.csv"
    file.write_text(ROWS)
    return file


@pytest.mark.parametrize("way", ["relative", "linked", "up and down", "renamed"])
def test_a_folder_lists_what_was_kept_in_it_however_it_is_named(way, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    real = tmp_path / "real"
    if way == "linked":
        real.mkdir()
        (tmp_path / "data").symlink_to("real")
    named = Path({"up and down": "other/../data"}.get(way, "data"))
    before = DataFolder(named)
    for name in ("uploads/run.csv", "actuators/drive.toml", "sessions/one.emaviz", "challenges/a.challenge"):
        place = before.place(Path(name).name)
        place.write_text(ROWS)
        assert before.name_of(place) == name
    if way == "renamed":
        named = named.rename("new")
    folder = DataFolder(named)
    monkeypatch.chdir("/")
    for one in (folder, *([before] if way != "renamed" else [])):
        assert one.measurements() == ["uploads/run.csv"] and one.actuator_files() == ["actuators/drive.toml"]
        assert one.session_files() == ["sessions/one.emaviz"] and one.challenge_files() == ["challenges/a.challenge"]
        assert one.session("sessions/one.emaviz").is_file() and one.fresh(one.sessions, "b", ".emaviz").is_absolute()


def test_links_in_a_circle_are_no_data_folder(tmp_path):
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(InputError, match="lead in a circle; name a folder"):
        DataFolder(tmp_path / "circle")


@pytest.mark.parametrize(
    ("sent", "kept"),
    [
        ("run 7.csv", "run 7.csv"),
        ("../../etc/passwd.csv", "passwd.csv"),
        ("C:\\rig\\run.csv", "run.csv"),
        ("/abs/run.mat", "run.mat"),
        ("Prüfstand-Ω.csv", "Prüfstand-Ω.csv"),
        ("a<img onerror=x>.csv", "a_img onerror_x_.csv"),
        ("nul.csv", "file-nul.csv"),
        (".hidden.csv", "hidden.csv"),
        ("line\nbreak\0.csv", "line_break_.csv"),
    ],
)
def test_names_are_made_safe(sent, kept):
    assert sanitised(sent) == kept


@pytest.mark.parametrize("sent", ["", ".", "..", "....", "/", "a" * 5000 + ".csv", ".csv", "‮.csv", "a." * 300])
def test_no_name_is_empty_long_or_a_step_upwards(sent):
    name = sanitised(sent)
    assert 0 < len(name) <= 100 and not set(name) & set("/\\\0\n") and name.strip(".")


def test_an_upload_takes_no_other_files_place(folder):
    first = folder.place("run.csv")
    first.write_text(ROWS)
    second = folder.place("run.csv")
    assert (first.name, second.name) == ("run.csv", "run-2.csv")
    second.with_suffix(".toml").write_text("schema = 1\n")
    third = folder.place("run-2.mat")
    assert third.name == "run-2-2.mat", "it would inherit the side file of another recording"


def test_kinds_of_files_are_told_apart(folder):
    assert folder.place("run.CSV").parent == folder.uploads
    assert folder.place("drive.toml").parent == folder.actuators
    with pytest.raises(InputError, match=r"run\.exe: the page takes measurements"):
        folder.place("run.exe")


@pytest.mark.parametrize(
    "name", ["../outside.csv", "uploads/../../outside.csv", "", ".", "no.csv", "a\0b.csv", "x" * 9999]
)
def test_paths_outside_are_refused(folder, outside, name):
    with pytest.raises(InputError, match="no such file in the data folder"):
        folder.measurement(name)


def test_an_absolute_path_is_refused(folder, outside):
    with pytest.raises(InputError, match="no such file in the data folder"):
        folder.measurement(str(outside))


def test_links_that_lead_outside_are_neither_listed_nor_read(folder, outside, tmp_path):
    (folder.uploads / "link.csv").symlink_to(outside)
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "far.csv").write_text(ROWS)
    (folder.folder / "linked").symlink_to(tmp_path / "more")
    (folder.uploads / "circle.csv").symlink_to(folder.uploads / "circle.csv")
    (folder.uploads / "own.csv").write_text(ROWS)
    (folder.recordings / "20261123-robust.rrd").write_bytes(b"a run, which Runs lists")
    assert folder.measurements() == ["uploads/own.csv"]
    for name in ("uploads/link.csv", "linked/far.csv", "uploads/circle.csv"):
        with pytest.raises(InputError):
            folder.measurement(name)


def test_nothing_is_written_through_a_link(folder, tmp_path):
    victim = tmp_path / "victim.toml"
    victim.write_text("precious")
    path = folder.uploads / "run.csv"
    path.write_text(ROWS)
    path.with_suffix(".toml").symlink_to(victim)
    with pytest.raises(InputError, match="leads out of the data folder"):
        folder.beside(path)
    assert victim.read_text() == "precious"


def test_an_uploads_folder_that_is_a_link_outside_is_refused(folder, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    folder.uploads.rmdir()
    folder.uploads.symlink_to(elsewhere)
    for write in (folder.part, lambda: folder.place("run.csv")):
        with pytest.raises(InputError, match="leads out of it"):
            write()
    assert not list(elsewhere.iterdir())


def test_files_of_the_command_line_are_copied_in_once(folder, outside):
    outside.with_suffix(".toml").write_text('schema = 1\nsampling = "mean"\n')
    first = folder.take_in(outside)
    assert first.parent == folder.uploads.resolve() and first.read_text() == ROWS
    assert first.with_suffix(".toml").is_file()
    assert folder.take_in(outside) == first
    assert folder.take_in(first) == first
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        folder.take_in(outside.with_name("none.csv"))


@pytest.mark.parametrize("version", [2, 3])
def test_a_robots_dataset_is_listed_and_opens(folder, outside, version):
    frames = np.arange(300) / 30.0
    episode = {"observation.state": np.sin(frames)[:, None], "action": np.sin(frames + 0.1)[:, None]}
    names = {"observation.state": ["shoulder.pos"], "action": ["shoulder.pos"]}
    write_robot_dataset(folder.uploads / "arm", version, 30.0, names, [episode] * 3)
    (folder.uploads / "arm" / "data" / "chunk-000" / "stolen.parquet").symlink_to(outside)
    listed = folder.measurements()
    stem = "uploads/arm/data/chunk-000/"
    assert sorted(listed) == (
        [f"{stem}episode_{i:06d}.parquet" for i in range(3)] if version == 2 else [f"{stem}file-000.parquet"]
    )
    opened = read_opened(listed[0], folder.measurement(listed[0]), load_actuator(), SideFile())
    assert any("shoulder.pos" in name for name in opened.columns)
    assert len(next(iter(opened.columns.values()))) == (300 if version == 2 else 900)
