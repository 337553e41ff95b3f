"""Sealed challenges: what goes in comes out, the answer stays in, and hostile files are refused in one line."""

from __future__ import annotations

import base64
import json
import re
import zipfile
import zlib

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.challenges import challenge, opened, sealed_challenge
from ema_model.challenges.truth import RUNS, Truth, seal, unseal
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.recordings import read
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import simulate_reference

HIDDEN = {"cogging_torque": {"amplitude_Nm": 0.02, "order": 12.0, "phase_rad": 0.5}}
TRUTH = Truth("", 7, "Hidden: cogging torque.", HIDDEN, faults={"k1": 0.4})


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    path = tmp_path_factory.mktemp("sealed") / "mine.challenge"
    told = []
    seal(
        TRUTH,
        path,
        "A <b>title</b>",
        "Listen\nto it.",
        load_actuator(),
        sensors=Sensors(0.2, 12),
        load_torque_Nm=30.0,
        on_progress=told.append,
    )
    assert told[-1] == "recorded 4 of 4"
    return path


def test_recordings_story_and_truth_come_back(sealed):
    one = sealed_challenge(sealed)
    assert (one.name, one.title, one.story) == ("mine", "A <b>title</b>", "Listen\nto it.")
    truth = unseal(sealed)
    assert truth.effects == HIDDEN and truth.faults == TRUTH.faults and truth.seed == 7 and truth.k[0] == 0.4
    with opened(one) as files:
        actuator = load_actuator(files.actuator)
        assert actuator.tolerances == load_actuator().tolerances
        recordings = [read(file, actuator) for file in (*files.training, *files.holdout)]
        folder = files.training[0].parent
    assert not folder.exists(), "nothing is left behind"
    for recording, (name, run) in zip(recordings, RUNS.items(), strict=True):
        assert recording.name == name and recording.samples == run.samples + 1
        assert np.all(recording["load_torque_Nm"] == 30.0)
        assert 0.15 < np.std(np.diff(recording["current_A"])) / np.sqrt(2.0) < 0.5
    chirp, run = recordings[0], RUNS["chirp"]
    healthy = simulate_reference(run, load_actuator())
    harder = np.sqrt(np.mean(chirp["current_A"] ** 2)) / np.sqrt(np.mean(healthy["current_A"] ** 2))
    assert harder > 1.1, "friction, cogging and load are in what was recorded"


def test_the_answer_cannot_be_seen_by_a_glance(sealed):
    names = re.compile("|".join((*CATALOGUE, "faults", "seed", "cogging")), re.I)
    with zipfile.ZipFile(sealed) as archive:
        for name in archive.namelist():
            if name != "actuator.toml":  # which tells the names of parameters
                assert not names.search(archive.read(name).decode("latin-1")), name


def test_sealing_the_same_twice_tells_nothing(sealed, tmp_path):
    parts = challenge.read_parts(sealed)
    head = {"title": "x", "grade": 0, "story": "y", "training": ["chirp.parquet"], "holdout": []}
    seals = []
    for name in ("a", "b"):
        challenge.write_sealed(
            tmp_path / f"{name}.challenge", head, {k: v for k, v in parts.items() if "json" not in k}
        )
        with zipfile.ZipFile(tmp_path / f"{name}.challenge") as archive:
            seals.append(json.loads(archive.read("seal.json"))["sha256"])
    assert seals[0] != seals[1]


def rewritten(sealed, path, change):
    """The sealed file with its parts changed, under its old seal."""
    with zipfile.ZipFile(sealed) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    change(parts)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return path


def swap(name, content):
    return lambda parts: parts.update({name: content})


@pytest.mark.parametrize("name", ["chirp.parquet", "hidden", "challenge.json", "actuator.toml"])
def test_a_change_is_noticed(sealed, tmp_path, name):
    def change(parts):
        parts[name] = parts[name][:-1] + bytes([parts[name][-1] ^ 1])

    path = rewritten(sealed, tmp_path / "x.challenge", change)
    for opening in (sealed_challenge, unseal):
        with pytest.raises(InputError, match=r"x\.challenge: was changed after it was sealed"):
            opening(path)


HOSTILE = [
    (swap("../../evil.parquet", b"1"), "holds '../../evil.parquet', which no challenge has"),
    (swap("/etc/passwd", b"1"), "which no challenge has"),
    (swap("evil.exe", b"1"), "which no challenge has"),
    (swap("zeros.parquet", bytes(200_000_000)), "unpacks to over 32 MB, which is the limit; ask for it anew"),
    (lambda parts: parts.update({f"x{i}.parquet": b"" for i in range(20)}), "holds 28 files, over the limit of 12"),
    (lambda parts: parts.pop("seal.json"), "is no challenge, or damaged"),
    (swap("seal.json", b"[]"), "is no challenge, or damaged"),
    (swap("seal.json", b"[" * 100_000), "is no challenge, or damaged"),
    (lambda parts: parts.clear(), "is no challenge, or damaged"),
]


@pytest.mark.parametrize(("change", "says"), HOSTILE, ids=[says[:30] for _, says in HOSTILE])
def test_hostile_files_are_refused_in_one_line(sealed, tmp_path, change, says):
    path = rewritten(sealed, tmp_path / "x.challenge", change)
    with pytest.raises(InputError, match=re.escape(says)) as told:
        sealed_challenge(path)
    assert "\n" not in str(told.value) and str(told.value).startswith("x.challenge: ")
    assert [file.name for file in tmp_path.iterdir()] == ["x.challenge"], "nothing is unpacked"


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"nothing of the kind", bytes(1000)])
def test_no_zip_at_all(tmp_path, content):
    path = tmp_path / "x.challenge"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is no challenge, or damaged"):
        sealed_challenge(path)
    with pytest.raises(InputError, match=r"^gone\.challenge: no such file"):
        sealed_challenge(tmp_path / "gone.challenge")


def resealed(sealed, path, head=None, **parts):
    """With other parts under a good seal: whoever seals may be hostile, too."""
    known = {name: content for name, content in challenge.read_parts(sealed).items() if name != "challenge.json"}
    told = json.loads(challenge.read_parts(sealed)["challenge.json"])
    challenge.write_sealed(path, {**told, **(head or {})}, {**known, **parts})
    return path


def test_a_hostile_sealer_is_told_in_one_line(sealed, tmp_path):
    path = tmp_path / "x.challenge"
    heads = [
        ({"training": ["../../etc/passwd"]}, "its recording ../../etc/passwd is missing"),
        ({"training": ["hidden"]}, "its recording hidden is missing"),
        ({"training": 7}, "is no challenge, or damaged"),
        ({"training": []}, "is no challenge, or damaged"),
        ({"title": None, "grade": "x"}, "is no challenge, or damaged"),
        ({"schema": 9}, "another version"),
    ]
    for head, says in heads:
        with pytest.raises(InputError, match=re.escape(says)):
            sealed_challenge(resealed(sealed, path, head))
    long = sealed_challenge(resealed(sealed, path, {"title": "x\x00\n" * 999}))
    assert len(long.title) <= challenge.MOST_CHARACTERS["title"] and "\x00" not in long.title
    bomb = zlib.compress(b" " * 50_000_000)
    for hidden in (b"", b"!!", b"aGVsbG8=", zlib.compress(b"{}"), base64.b64encode(bomb)):
        with pytest.raises(InputError, match=r"x\.challenge: "):
            unseal(resealed(sealed, path, hidden=hidden))
    for part, content in {"actuator.toml": b"\xff", "chirp.parquet": b"no parquet"}.items():
        with (
            pytest.raises(InputError, match=r"x\.challenge: ") as told,
            opened(sealed_challenge(resealed(sealed, path, **{part: content}))) as files,
        ):
            actuator = load_actuator(files.actuator)
            read(files.training[0], actuator)
        assert "emaviz-challenge-" not in str(told.value), "a folder that is gone is nothing to be told of"


def test_what_cannot_be_sealed_is_told(tmp_path):
    actuator = load_actuator()
    for title, story, says in [
        ("", "y", "needs a title"),
        ("x" * 99, "y", "needs a title"),
        ("x", "  ", "needs a story"),
    ]:
        with pytest.raises(InputError, match=says):
            seal(TRUTH, tmp_path / "x.challenge", title, story, actuator)
    with pytest.raises(InputError, match=r"must end in \.challenge"):
        seal(TRUTH, tmp_path / "x.zip", "x", "y", actuator)
    assert not list(tmp_path.iterdir())
