"""`emaviz track`: its outputs, and one clear line for each thing that is wrong."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from support.documents import result_of

from ema_model.simulated_lives import drawn, worn_life
from emaviz.cli import main


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Eight small recordings; what they hold is looked at by the test that identifies none."""
    made = tmp_path / "first.csv"
    assert main(["simulate", "--model", "mm", "--duration", "0.05", "--out", str(made)]) == 0
    there = tmp_path / "unit"
    there.mkdir()
    for number in range(1, 10):
        shutil.copy(made, there / f"flight_{number}.csv")
    return there


def test_all_outputs(folder, tmp_path, monkeypatch, capsys):
    """The identification, which takes seconds a flight, is replaced by a drawn life's."""
    life = worn_life("linear", 1)
    flights = drawn(life)[: int(0.6 * life.flights)]
    monkeypatch.setattr("ema_model.tracking.flights.identify_all", lambda *_: iter(flights))
    written = [tmp_path / name for name in ("track.json", "track.html", "track.rrd")]
    options = [text for name, path in zip(("--json", "--report", "--record"), written) for text in (name, str(path))]
    assert main(["track", str(folder), "--threshold", f"{life.fault}={life.threshold}", *options]) == 0
    found = result_of(written[0], "track")["faults"]
    one = found[life.fault]
    assert set(found) == {"k1", "k2", "k3", "k4", "k5", "k6", "k8"} and one["trend"]
    left = one["remaining_flights"]
    assert left["p05"] <= left["p50"] <= left["p95"]
    assert one["crossing_probability"][0]["flights"] == 1 and one["excluded"]
    page = written[1].read_text()
    assert "Remaining life" in page and life.fault in page
    assert f"{life.fault} " in capsys.readouterr().out
    assert written[2].stat().st_size > 1000


@pytest.mark.parametrize(
    ("names", "more", "words"),
    [
        (["flight_1.csv"], [], "1 flight tells no trend"),
        (["flight_2.csv", "flight_1.csv"], [], "give the flights in order"),
        (["flight_1.csv", "copy_1.csv"], [], "nothing tells which flew first"),
        (["flight_1.csv", "nameless.csv"], [], "no number or date"),
        ([], ["--threshold", "k9=0.1"], "no such fault"),
        ([], ["--threshold", "k1"], "--threshold"),
        ([], ["--threshold", "k1=0.3", "--threshold", "k1=0.4"], "given twice"),
    ],
)
def test_bad_input_is_one_clear_line(folder, names, more, words, capsys):
    for name in ("copy_1.csv", "nameless.csv"):
        if name in names:
            shutil.copy(folder / "flight_1.csv", folder / name)
    given = [str(folder / name) for name in names] or [str(folder)]
    assert main(["track", *given, *more]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert re.search(words, told), told


def test_mixed_actuators_and_units_are_refused(folder, capsys):
    (folder / "flight_2.toml").write_text('actuator = "a.toml"\n')
    (folder / "flight_5.toml").write_text('actuator = "b.toml"\n')
    assert main(["track", str(folder)]) == 2
    assert "flight_5.csv" in (told := capsys.readouterr().err) and "one unit" in told and told.count("\n") == 1
    (folder / "other").mkdir()
    shutil.copy(folder / "flight_1.csv", folder / "other" / "flight_1.csv")
    assert main(["track", str(folder)]) == 2
    assert "one unit" in (told := capsys.readouterr().err) and told.count("\n") == 1


def test_an_empty_folder(tmp_path, capsys):
    assert main(["track", str(tmp_path)]) == 2
    assert "holds no recording" in capsys.readouterr().err


def test_flights_that_arrive_are_taken_up(folder, tmp_path, monkeypatch, capsys):
    """Once they are whole; a name that tells no time is told once, and the rest goes on."""
    told = tmp_path / "track.json"
    flights = drawn(worn_life("linear", 1))
    monkeypatch.setattr(
        "ema_model.tracking.flights.identify_all",
        lambda paths, *_: (replace(flights[int(path.stem[7:])], name=path.stem) for path in paths),
    )
    seen = []

    def arrives() -> None:
        shutil.copy(folder / "flight_1.csv", folder / "flight_10.csv")
        shutil.copy(folder / "flight_1.csv", folder / "nameless.csv")

    def grows() -> None:
        (folder / "flight_10.csv").write_text((folder / "flight_10.csv").read_text() + "\n")

    def ends() -> None:
        raise KeyboardInterrupt

    def look() -> None:
        seen.append(len(json.loads(told.read_text())["flights"]) if told.exists() else 0)

    actions = iter([look, look, arrives, grows, look, look, ends])
    monkeypatch.setattr("emaviz.cli.verbs.track.time.sleep", lambda seconds: next(actions)())
    assert main(["track", str(folder), "--watch", "--json", str(told)]) == 0
    assert seen == [0, 9, 9, 10], "it is taken once it has stopped growing"
    err = capsys.readouterr().err
    assert err.count("nameless.csv") == 1 and "left out" in err and "Ctrl-C" in err


def test_only_a_folder_can_be_watched(folder, capsys):
    assert main(["track", str(folder / "flight_1.csv"), "--watch"]) == 2
    assert "name one folder" in (told := capsys.readouterr().err) and told.count("\n") == 1
