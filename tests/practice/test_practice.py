"""Challenges that are made: silent about what is hidden, whole or not at all, and the answer beside what was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.flights import flights

from ema_model import practice
from ema_model.actuator import load_actuator
from ema_model.challenges import challenges, folder
from ema_model.challenges.truth import read_toml
from ema_model.errors import InputError
from ema_model.fleet.compare import compare_units, units_in
from ema_model.practice import KINDS
from ema_model.recordings import read
from ema_model.simulated_lives import drawn, worn_life
from ema_model.tracking.flights import flights_in
from ema_model.tracking.track import track
from emaviz.cli import main

SHIPPED = {one.name: one for one in practice.shipped()}
LIFE = read_toml(folder() / "truth" / "one_life.toml")


@pytest.fixture
def short(monkeypatch):
    """Truths with less to record."""
    told = {"one_life": LIFE | {"flights": 2}, "six_siblings": read_toml(folder() / "truth" / "six_siblings.toml")}
    told["six_siblings"] |= {"units": 2, "differences": told["six_siblings"]["differences"][:1]}
    monkeypatch.setattr(practice, "read_toml", lambda path: told[path.stem])


def test_they_ship_beside_the_others_and_have_no_recordings():
    assert set(SHIPPED) == {"six_siblings", "one_life"} and {one.kind for one in SHIPPED.values()} == set(KINDS)
    assert not {one.name for one in challenges()} & set(SHIPPED), "Discover has those of effects alone"
    for one in SHIPPED.values():
        assert len(one.story) > 100 and 1 <= one.grade <= 5
        assert [path.name for path in (folder() / one.name).iterdir()] == ["challenge.toml"]


def test_recordings_are_made_whole_and_known_again(short, tmp_path):
    said = []
    for name, one in SHIPPED.items():
        practice.make(one, tmp_path / name, lambda text, share: said.append((text, share)))
        assert practice.challenge_in(tmp_path / name) == one
        with pytest.raises(InputError, match="exists already"):
            practice.make(one, tmp_path / name)
    assert [path.stem for path in flights_in(tmp_path / "one_life")] == ["flight_0001", "flight_0002"]
    units = units_in(tmp_path / "six_siblings")
    assert {name: len(files) for name, files in units.items()} == {"unit_01": 4, "unit_02": 4}
    actuator = load_actuator()
    assert all(read(path, actuator).samples > 1000 for files in units.values() for path in files)
    assert all(0.0 <= share < 1.0 for _, share in said) and practice.challenge_in(tmp_path) is None

    def stops(text: str, share: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        practice.make(SHIPPED["one_life"], tmp_path / "stopped", stops)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one_life", "six_siblings"]


def test_the_end_of_the_life_beside_what_was_said():
    life = worn_life(LIFE["law"], LIFE["seed"], fault=LIFE["fault"])
    threshold = SHIPPED["one_life"].thresholds
    assert threshold[life.fault] == pytest.approx(life.threshold, abs=0.001)
    found = track(drawn(life)[: LIFE["flights"]], threshold)
    told = practice.reveal(SHIPPED["one_life"], found)
    assert told.agrees and f"in flight {life.flights}, {life.flights - 60} flights after" in told.lines[0]
    assert practice.reveal(SHIPPED["one_life"], track(flights(np.zeros(60)), threshold)).agrees is False
    assert practice.reveal(SHIPPED["one_life"]).agrees is None


@pytest.mark.long
def test_the_units_that_differ_are_found(tmp_path):
    one, actuator = SHIPPED["six_siblings"], load_actuator()
    practice.make(one, tmp_path / "six")
    units = {name: [read(path, actuator) for path in files] for name, files in units_in(tmp_path / "six").items()}
    found = compare_units({name: given[:3] for name, given in units.items()}, actuator)
    told = practice.reveal(one, found)
    assert told.agrees and len(told.lines) == 2 and "motor torque constant −" in told.lines[0]
    assert practice.reveal(one, replace(found, differences=found.differences[:1])).agrees is False


def test_the_command_line_lists_writes_and_reveals(short, tmp_path, capsys):
    assert main(["challenge"]) == 0
    listed = capsys.readouterr().out
    assert all(one.name in listed and one.title in listed for one in challenges(kind=None))
    where = str(tmp_path / "mine")
    assert main(["challenge", "one_life", "--out", where]) == 0
    assert f"emaviz track {where} --threshold k1=0.58" in capsys.readouterr().out
    assert main(["challenge", "one_life", "--reveal"]) == 0
    assert "k1 friction reached 0.58 in flight" in capsys.readouterr().out
    assert main(["challenge", "prototype", "--out", str(tmp_path / "effects")]) == 0
    assert "emaviz discover" in capsys.readouterr().out and len(list((tmp_path / "effects").iterdir())) == 4
    assert main(["challenge", "prototype", "--reveal"]) == 0
    assert "square root of the speed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], "no challenge nothing"),
        (["--reveal"], "name a challenge"),
        (["one_life", "--out", "FULL"], "exists already"),
        (["prototype", "--out", "FULL"], "is not empty"),
    ],
)
def test_bad_input_is_one_clear_line(tmp_path, arguments, words, capsys):
    (tmp_path / "note.txt").write_text("mine")
    assert main(["challenge", *(str(tmp_path) if text == "FULL" else text for text in arguments)]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and words in told
