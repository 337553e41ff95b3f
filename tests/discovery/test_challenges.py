"""The shipped challenges: sound, silent about what is hidden, made anew alike, and what discovery says of two."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import ema_model
from ema_model.actuator import load_actuator
from ema_model.challenges import challenges, folder
from ema_model.challenges.__main__ import main
from ema_model.challenges.truth import COLUMNS, RUNS, make, plant_of, read_truth, truths
from ema_model.discovery import discover
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.estimation import default_free
from ema_model.recordings.read import read_measurement

# A few that a test has time for.
NAMES = ("cogging_torque", "stribeck_friction", "hinge_moment", "dead_time")
ALL = {one.name: one for one in challenges()}


def solved(name: str, among: Sequence[str] | None = NAMES):
    one = ALL[name]
    training, held = ([read_measurement(path) for path in paths] for paths in (one.training, one.holdout))
    return discover(training, holdout=held, candidates=among)


def test_there_is_one_of_each_kind_and_they_are_small():
    told = {one.name: one for one in truths(folder())}
    assert set(told) == set(ALL)
    counts = sorted(len(one.effects) + bool(one.torque) for one in told.values())
    assert counts == [0, 1, 1, 1, 2, 2] and sum(bool(one.torque) for one in told.values()) == 1
    assert sum(path.stat().st_size for path in folder().rglob("*.parquet")) < 3_000_000


@pytest.mark.parametrize("one", ALL.values(), ids=ALL)
def test_recordings_are_read_without_complaint(one):
    assert len(one.training) == 3 and len(one.holdout) == 1 and len(one.story) > 100 and 1 <= one.grade <= 5
    for path, run in zip((*one.training, *one.holdout), RUNS.values(), strict=True):
        recording = read_measurement(path)
        assert recording.samples == run.samples + 1 and set(recording.signals) == set(COLUMNS)
        assert 0.35 < np.std(np.diff(recording["current_A"])) / np.sqrt(2.0) < 0.7  # noise is 0.45 A


@pytest.mark.parametrize("one", ALL.values(), ids=ALL)
def test_nothing_gives_the_truth_away(one):
    names = re.compile(
        "|".join((*CATALOGUE, "user_torque", "truth", "seed", *(e.title for e in CATALOGUE.values()))), re.I
    )
    for path in (*one.training, *one.holdout):
        schema = pq.read_schema(path)
        assert schema.names == list(COLUMNS) and schema.metadata == {b"emaviz_schema": b"1"}
        raw = path.read_bytes()
        assert not re.search(names.pattern.encode(), raw, re.I)
    told = (one.training[0].parent / "challenge.toml").read_text(encoding="utf-8")
    assert not names.search(told) and sorted(p.suffix for p in one.training[0].parent.iterdir()) == [
        *[".parquet"] * 4,
        ".toml",
    ]


def test_nothing_that_looks_for_effects_knows_the_truth():
    package = Path(ema_model.__file__).parent
    reads = re.compile(r"challenges[./](truth|sealing)|challenges import (truth|sealing)")
    readers = [
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        if reads.search(path.read_text(encoding="utf-8"))
    ]
    assert sorted(readers) == ["challenges/__init__.py", "challenges/__main__.py", "practice.py"]
    assert "truth" not in (package / "challenges" / "challenge.py").read_text(encoding="utf-8").partition("import")[2]


def test_plants_are_off_but_within_their_tolerances():
    actuator = load_actuator()
    for truth in truths(folder()):
        plant = plant_of(truth, actuator)
        off = [
            (plant.value(path) - actuator.value(path)) / actuator.tolerances[path].sigma
            for path in default_free(actuator)
        ]
        assert 0.5 < np.max(np.abs(off)) <= 2.0 + 1e-9


@pytest.mark.long
def test_making_twice_gives_the_same_bytes(tmp_path):
    truth = read_truth(folder() / "truth" / "prototype.toml")
    made = []
    for name in ("once", "twice"):
        (tmp_path / name / truth.name).mkdir(parents=True)
        make(truth, tmp_path / name)
        made.append([(tmp_path / name / truth.name / f"{run}.parquet").read_bytes() for run in RUNS])
    assert made[0] == made[1]


@pytest.mark.long
def test_script_makes_what_is_shipped(tmp_path, monkeypatch):
    name = "first_bench_run"
    (tmp_path / "truth").mkdir()
    shutil.copy(folder() / "truth" / f"{name}.toml", tmp_path / "truth")
    (tmp_path / name).mkdir()
    shutil.copy(folder() / name / "challenge.toml", tmp_path / name)
    monkeypatch.setattr(sys, "argv", ["challenges", str(tmp_path)])
    assert main() == 0
    [made] = challenges(tmp_path)
    for path, shipped in zip((*made.training, *made.holdout), (*ALL[name].training, *ALL[name].holdout)):
        new, old = read_measurement(path), read_measurement(shipped)
        for signal in COLUMNS:  # another processor may round otherwise in the last bit, and a switch then acts later
            spread = float(np.std(old[signal]))
            assert np.sqrt(np.mean((new[signal] - old[signal]) ** 2)) < 1e-2 * spread, signal


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("seed = 1", "answer is missing"),
        ("seed = 1\nanswer = 'x'\nsize = 2", "size is not known"),
        ("seed = 1\nanswer = 'x'\n[effects.ghost]\nsize = 2", "no effect 'ghost'"),
        ("seed =", "not a challenge's truth"),
    ],
)
def test_mistakes_in_a_truth_are_one_clear_line(tmp_path, monkeypatch, capsys, text, says):
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "mine.toml").write_text(text)
    monkeypatch.setattr(sys, "argv", ["challenges", str(tmp_path)])
    assert main() == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1


def test_mistakes_in_a_challenge_are_one_clear_line(tmp_path):
    (tmp_path / "mine").mkdir()
    file = tmp_path / "mine" / "challenge.toml"
    file.write_text("title = 'x'\ngrade = 1\nstory = 'y'\ntraining = ['a.csv']\n")
    with pytest.raises(InputError, match="holdout is missing"):
        challenges(tmp_path)
    file.write_text(file.read_text() + "holdout = []\n")
    with pytest.raises(InputError, match=r"no a\.csv beside it"):
        challenges(tmp_path)


@pytest.mark.long
def test_the_easy_one_is_solved():
    found, truth = solved("first_bench_run"), read_truth(folder() / "truth" / "first_bench_run.toml")
    [(name, hidden)] = truth.effects.items()
    assert found.verdict == "effects_found" and [one.name for one in found.effects] == [name]
    settings = found.actuator.effects[name]
    assert settings["order"] == hidden["order"]
    assert settings["amplitude_Nm"] == pytest.approx(hidden["amplitude_Nm"], rel=0.2)
    assert found.ladder[-1].rmse < 1.1 and found.ladder[-1].holdout_rmse < 1.1


@pytest.mark.long
@pytest.mark.parametrize("name", ["quiet_complaint", "after_the_overhaul", "two_suspects", "prototype"])
def test_the_whole_library_solves_it(name):
    """As somebody meets it who presses "Find all"."""
    found, truth = solved(name, None), read_truth(folder() / "truth" / f"{name}.toml")
    if truth.torque:
        # A friction by the root of the speed, with another that grows less than linearly where they leave as much.
        [one] = found.effects
        assert "power_law_drag" in {one.name, *one.same_as} <= {"power_law_drag", "saturating_friction"}
    else:
        assert found.verdict == "effects_found" and {one.name for one in found.effects} == set(truth.effects)
    assert found.ladder[-1].rmse < 1.1 < found.ladder[0].rmse


@pytest.mark.long
def test_where_nothing_is_hidden_the_model_is_adequate():
    found = solved("acceptance_test")
    assert found.verdict == "adequate" and not found.effects and not found.parameters_outside_tolerance
