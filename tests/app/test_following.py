"""Track without a screen: a folder is identified and followed, goes on after a stop, and takes up what arrives."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from support.flights import flights
from support.known_flights import FOLLOWING, known, recording, write_flights
from support.on_page import wait_until

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from emaviz.recording import read
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part
from emaviz.session.track import Following

COUNT = 20
KNOWN = flights(0.02 * np.arange(COUNT + 5))


@pytest.fixture
def asked(monkeypatch):
    """The names of the flights that were identified; that takes seconds each, so it is replaced."""
    names = []

    monkeypatch.setattr(f"{FOLLOWING}.identified", known(KNOWN, names))
    monkeypatch.setattr(f"{FOLLOWING}.LOOK_S", 0.1)
    return names


@pytest.fixture
def following(tmp_path, asked):
    folder = DataFolder(tmp_path / "data")
    write_flights(folder.folder / "unit", COUNT).rename(tmp_path / "one.parquet")
    session = Session(load_actuator(), folder.recordings)
    files = Worker("test-files", lambda error: pytest.fail(str(error)))
    following = Following(session, folder, files)
    yield following
    following.close()
    files.close()
    session.close()


def followed(following):
    """Tracks; what its line says at the end."""
    said = []
    following.job.ended.connect(said.append)
    assert following.begin()
    wait_until(lambda: said)
    return said[-1]


def test_a_folder_is_followed_and_a_threshold_identifies_nothing_anew(following, asked):
    following.watching = False
    with pytest.raises(InputError, match="no folder of flights is chosen"):
        following.begin()
    assert following.folder.folders() == {"unit": COUNT}
    following.choose("unit")
    shown = []
    following.events.followed.connect(shown.append)
    assert "done in" in followed(following) and len(asked) == COUNT
    assert shown[0].last.faults["k1"].trend and shown[0].last.faults["k1"].remaining_flights is None
    following.set_threshold("k1", 0.6)
    followed(following)
    assert len(asked) == COUNT and following.last.faults["k1"].remaining_flights is not None
    assert following.file_of(following.last.flights[3]) == "unit/flight_03.parquet"
    with pytest.raises(InputError, match="away from the healthy value"):
        following.set_threshold("k1", 0.0)
    assert following.thresholds == {"k1": 0.6}
    following.set_threshold("k1", None)
    assert not following.thresholds


def test_after_a_stop_it_goes_on_from_there(following, asked):
    following.watching = False
    following.choose("unit")
    following.job.progressed.connect(lambda text, *_: "flight 11 of" in text and following.job.stop())
    said = followed(following)
    assert said.startswith("Stopped after 10 of 20") or said.startswith("Stopped after 11 of 20")
    taken = len(asked)
    assert following.last is not None and len(following.last.flights) == taken < COUNT
    following.job.progressed = type(following.job.progressed)()
    followed(following)
    assert len(asked) == COUNT and len(following.last.flights) == COUNT


def test_what_arrives_adds_a_point_and_what_does_not_fit_is_said(following, asked, tmp_path):
    one_recording = tmp_path / "one.parquet"
    unit = following.folder.folder / "unit"
    following.choose("unit")
    followed(following)
    lines = following.left_out
    shutil.copy(one_recording, unit / "flight_20.parquet")
    wait_until(lambda: len(following.last.flights) == COUNT + 1, 20.0)
    assert asked[-1] == "flight_20"
    shutil.copy(one_recording, unit / "copy-of_flight_20.parquet")
    (unit / "flight_21.csv").write_text("time_s,command_rad\n0,1\n")
    wait_until(lambda: len(following.left_out) == 2, 20.0)
    assert "same number or date" in lines["copy-of_flight_20.parquet"] and "flight_21.csv" in lines["flight_21.csv"]
    assert all("\n" not in line and str(unit.parent) not in line for line in lines.values())
    recording(unit / "flight_05.parquet")  # replaced
    wait_until(lambda: asked[-1] == "flight_05", 20.0)
    assert len(following.last.flights) == COUNT + 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda unit: [one.unlink() for one in unit.glob("*_[01]?.*") if one.stem != "flight_01"], "1 flight tells no"),
        (lambda unit: shutil.copy(unit / "flight_01.parquet", unit / "x_01.parquet"), "same number or date"),
        (lambda unit: shutil.copy(unit / "flight_01.parquet", unit / "x.parquet"), "no number or date"),
        (lambda unit: [one.unlink() for one in unit.iterdir()], "^unit: holds no recording"),
        (
            lambda unit: [(unit / f"flight_0{i}.toml").write_text(f'actuator = "{i}.toml"\n') for i in (1, 2)],
            "the flights are of one unit",
        ),
    ],
)
def test_bad_input_is_one_clear_line(following, change, words):
    following.watching = False
    following.choose("unit")
    change(following.folder.folder / "unit")
    with pytest.raises(InputError, match=words) as refused:
        following.begin()
    assert "\n" not in str(refused.value)


def test_the_data_folder_itself_may_hold_the_flights(following, asked, tmp_path):
    """What the app keeps in its own folders there is no flight."""
    data = following.folder.folder
    for path in (data / "unit").iterdir():
        path.rename(data / path.name)
    shutil.copy(tmp_path / "one.parquet", data / "recordings" / "kept_1.parquet")
    assert following.folder.folders() == {".": COUNT}
    following.choose(".")
    followed(following)
    assert len(asked) == COUNT
    (data / "unit").rmdir()


def test_too_few_are_waited_for(following):
    for path in (following.folder.folder / "unit").glob("*_1?.*"):
        path.unlink()
    (following.folder.folder / "unit" / "flight_00.parquet").unlink()
    (following.folder.folder / "unit" / "flight_01.parquet").unlink()
    (following.folder.folder / "unit" / "flight_02.parquet").unlink()
    following.choose("unit")
    assert followed(following) == "7 of the 8 flights that a trend needs."


def test_only_folders_of_the_data_folder(following):
    for name in ("../..", "/etc", "nowhere", "unit/flight_00.parquet"):
        with pytest.raises(InputError, match="no such folder"):
            following.choose(name)


def test_what_stays(following):
    with pytest.raises(InputError, match="press Track first"):
        following.save(".html")
    following.watching = False
    following.choose("unit")
    followed(following)
    kept = []
    following.events.kept.connect(kept.append)
    for suffix in (".html", ".rrd"):
        following.save(suffix)
        wait_until(lambda suffix=suffix: kept and kept[-1].suffix == suffix)
    assert "k over the flights" in kept[0].read_text(encoding="utf-8")
    assert read(kept[1]).properties["track"]["flights"] == [f"flight_{i:02d}" for i in range(COUNT)]


def another(following):
    """A page that starts anew on the same data folder."""
    new = Following(following.session, following.folder, following._files)
    new.watching = False
    return new


def through_a_file(following, saved):
    """What is saved as a session's file gives it back."""
    back, folder = [], following.folder
    path = session_file.free_path(folder, "kept")
    session_file.write_session(path, {"track": Part(lambda: saved, lambda *_: None)}, folder, [])
    session_file.read_session(path, {"track": Part(dict, lambda given, _: back.append(given))}, folder)
    return back[0]


def restored(new, saved):
    shown, begun = [], []
    new.events.followed.connect(shown.append)
    new.job.began.connect(begun.append)
    new.restore(through_a_file(new, saved))
    assert len(shown) == 1 and not begun and not new.job.waiting, "nothing is computed"
    return shown[-1]


def drawn(history):
    """All that the page draws: each look, and what came then."""
    figures = [figure.to_json() for figure in history.last.figures()]
    looks = {count: [one.to_dict(), one.document.text] for count, one in history.looks.items()}
    came = {(number, name): history.came(number, name) for number in history.looks for name in history.last.faults}
    return [looks, came, figures, [one.name for one in history.flights], history.thresholds]


def test_a_session_keeps_the_flights_so_that_none_is_identified_again(following, asked):
    following.watching = False
    following.choose("unit")
    following.set_threshold("k1", 0.6)
    followed(following)
    saved, before = following.saved(), following.last
    pictures = drawn(following.history)
    del asked[:]
    new = another(following)
    history = restored(new, saved)
    last = history.last
    assert drawn(history) == pictures
    assert not asked and new.chosen == "unit" and new.thresholds == {"k1": 0.6}
    assert (
        str(last) == str(before)
        and last.faults["k1"].remaining_flights.p50 == before.faults["k1"].remaining_flights.p50
    )
    assert new.file_of(last.flights[3]) == "unit/flight_03.parquet"
    again = new.saved()
    assert {**again, "whole": 0} == {**saved, "whole": 0} and drawn(restored(new, again)) == pictures
    new.watching = True
    new._watch()
    shutil.copy(
        following.folder.folder / "unit" / "flight_00.parquet", following.folder.folder / "unit" / "flight_20.parquet"
    )
    wait_until(lambda: asked)
    assert asked == ["flight_20"], "what the session holds has arrived before"
    new.close()
    (following.folder.folder / "unit" / "flight_20.parquet").unlink()
    del asked[:]

    recording(following.folder.folder / "unit" / "flight_05.parquet", 2.0)  # another one by now
    (following.folder.folder / "unit" / "flight_06.parquet").unlink()
    new = another(following)
    flight = restored(new, saved).last.flights[5]
    with pytest.raises(InputError, match="flight_05: its recording is not in the data folder, or is another"):
        new.file_of(flight)
    followed(new)
    assert asked == ["flight_05"] and len(new.last.flights) == COUNT - 1

    shutil.rmtree(following.folder.folder / "unit")
    new = another(following)
    assert len(restored(new, saved).last.flights) == COUNT and new.is_elsewhere
    with pytest.raises(InputError, match="no such folder in the data folder"):
        new.begin()


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        ({"thresholds": {"k9": 0.5}}, "no such fault"),
        ({"actuator": "another"}, "are of another actuator"),
        ({"whole": {"class": "StoredFlights", "fields": {"flights": 7, "history": None}}}, "flights make no sense"),
        ({"whole": {"class": "Path", "fields": {}}}, "flights make no sense"),
        ({"whole": 7}, "flights make no sense"),
        ({"flights": 7}, "is damaged"),
    ],
)
def test_a_damaged_session_is_refused_in_one_line_and_changes_nothing(following, damage, line):
    following.watching = False
    following.choose("unit")
    followed(following)
    saved = following.saved()
    with pytest.raises(InputError, match=line) as told:
        following.restore(saved | damage)
    assert "\n" not in str(told.value) and {**following.saved(), "whole": 0} == {**saved, "whole": 0}


def test_numbers_that_are_no_flights_are_refused(following):
    following.watching = False
    following.choose("unit")
    followed(following)
    for part, bad in (("k", np.full(8, np.nan)), ("own", -np.eye(8)), ("common", np.zeros(3)), ("k", np.zeros(3))):
        saved = following.saved()
        saved["whole"]["fields"]["flights"][3]["fields"][part] = bad
        with pytest.raises(InputError, match="flights make no sense"):
            following.restore(saved)
    saved = following.saved()
    saved["whole"]["fields"]["history"]["fields"]["looks"][0][0] = 999
    with pytest.raises(InputError, match="flights make no sense"):
        following.restore(saved)


def test_a_session_of_before_looks_were_stored_has_no_flights(following):
    old = {"folder": "unit", "thresholds": {"k1": 0.6}, "flights": [{"name": "a", "numbers": "AAAA", "file": "a.csv"}]}
    following.restore(old)
    assert following.chosen == "unit" and following.history is None and following.thresholds == {"k1": 0.6}
    assert not following.job.running and not following.job.waiting


def test_flights_of_a_session_without_room_for_what_was_known_after_each_are_followed_again(following, asked):
    following.watching = False
    following.choose("unit")
    followed(following)
    saved = following.saved()
    saved["whole"]["fields"]["history"] = None
    del asked[:]
    new, shown = another(following), []
    new.events.followed.connect(shown.append)
    new.restore(saved)
    wait_until(lambda: shown and not new.job.running)
    assert not asked and str(new.last) == str(following.last)
