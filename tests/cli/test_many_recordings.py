"""Many recordings at once: a folder, a pattern, the runs of one file; some held out by rule; a table of errors."""

from __future__ import annotations

import gzip
import re
import shutil

import numpy as np
import pytest
from support.compared import compared, one_file

from ema_model.errors import InputError
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.recording_set import files_of, is_pattern, runs_of
from emaviz.cli import main

ACTUATOR = [
    *("--controller=unknown", "--set=motor.torque_constant_Nm_A=0.05 fixed", "--set=motor.inertia_kgm2=1e-4±30%"),
    *("--set=motor.dynamic_friction_Nm=0.01±30%", "--set=motor.viscous_friction_Nms_rad=0±1e-5"),
]
GAINS = (100, 200, 400)


def motion(gain: int, seed: int) -> dict[str, np.ndarray]:
    """A motor of 1.1e-4 kg·m² with 0.012 N·m of friction, moved at a pace of its own; one gain has more friction."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 2.0, 2e-3)
    position = 20.0 * np.sin(2.0 * np.pi * gain / 200.0 * time)
    speed = np.gradient(position, time)
    friction = 0.03 if gain == 400 else 0.012
    torque = 1.1e-4 * np.gradient(speed, time) + friction * np.tanh(speed)
    current = torque / 0.05 + 0.01 * rng.standard_normal(len(time))
    return {"time_s": time, "motor_position_rad": position, "current_A": current}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """A folder with a recording a gain, and what is none; a file with the same as runs; the actuator's file."""
    folder = tmp_path_factory.mktemp("logs")
    (folder / "set").mkdir()
    for i, gain in enumerate(GAINS):
        write_measurement(Measurement(motion(gain, i)), folder / "set" / f"kp{gain}_sine.csv")
    (folder / "set" / "notes.txt").write_text("measured in May")
    (folder / "set" / ".hidden.csv").write_text("")
    runs = [motion(gain, i) for i, gain in enumerate(GAINS)]
    one_file(folder / "all.csv", [{"shot": np.full(len(run["time_s"]), 7.0 + i), **run} for i, run in enumerate(runs)])
    assert main(["actuator", "new", str(folder / "mine.toml"), *ACTUATOR]) == 0
    return folder


def names(found: list[dict]) -> list[str]:
    return [one["name"] for one in found]


def test_a_folder_is_a_set_of_which_a_rule_holds_some_out(logs, capsys):
    result = compared(logs, logs / "set", "--holdout", "kp400*", "--report", logs / "r.html")
    assert names(result["recordings"]) == ["kp100_sine", "kp200_sine"] and names(result["holdout"]) == ["kp400_sine"]
    told = capsys.readouterr().out
    table = told[told.index("recording, ") :].split("\n\n")[0].splitlines()
    assert len(table) == 4 and table[3].endswith("held out") and "kp400_sine" in table[3]
    errors = [float(line.split()[-4 if line.endswith("held out") else -2]) for line in table[1:]]
    assert errors[2] > 5.0 * max(errors[:2]), "the one with other friction stands out"
    report = (logs / "r.html").read_text(encoding="utf-8")
    assert re.search("kp400_sine<.*?, held out<", report) and "by recording" in report


def test_a_pattern_names_files_and_a_folder_may_be_held_out(logs, tmp_path):
    assert names(compared(logs, logs / "set" / "kp[12]*.csv")["recordings"]) == ["kp100_sine", "kp200_sine"]
    result = compared(logs, logs / "set", "--holdout", logs / "set" / "kp100_sine.csv")
    assert names(result["recordings"]) == ["kp200_sine", "kp400_sine"] and names(result["holdout"]) == ["kp100_sine"]


def test_runs_of_one_file_are_recordings_of_their_own(logs):
    by_run = compared(logs, logs / "all.csv", "--runs", "shot", "--holdout", "*#9")
    assert names(by_run["recordings"]) == ["all#7", "all#8"] and names(by_run["holdout"]) == ["all#9"]
    by_file = compared(logs, logs / "set", "--holdout", "kp400*")
    friction = [one["calibration"]["parameters"]["motor.dynamic_friction_Nm"]["value"] for one in (by_run, by_file)]
    assert friction[0] == pytest.approx(friction[1], rel=1e-6) and friction[0] == pytest.approx(0.012, rel=0.1)


def test_groups_of_one_file_are_recordings_of_their_own(logs):
    h5py = pytest.importorskip("h5py")
    with h5py.File(logs / "all.h5", "w") as file:
        for i, gain in enumerate(GAINS):
            for name, values in motion(gain, i).items():
                file[f"run_{gain}/{name}"] = values
    found = compared(logs, logs / "all.h5", "--runs", "run", "--holdout", "*#400")
    assert names(found["recordings"]) == ["all#100", "all#200"] and names(found["holdout"]) == ["all#400"]
    by_file = compared(logs, logs / "set", "--holdout", "kp400*")
    friction = [one["calibration"]["parameters"]["motor.dynamic_friction_Nm"]["value"] for one in (found, by_file)]
    assert friction[0] == pytest.approx(friction[1], rel=1e-4)


def test_a_run_has_the_rules_of_its_file(logs):
    from ema_model.actuator import parse_actuator

    text = (logs / "mine.toml").read_text() + '\n[[recordings.where]]\nmatch = "all"\nkind = "map"\n'
    actuator = parse_actuator(text, "mine.toml")
    assert actuator.rules_for("all#7") == actuator.rules_for("all") == actuator.rules and not actuator.rules_for("al")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["set", "--holdout", "z*"], "--holdout z*: no recording has such a name (there are kp100_sine"),
        (["set", "--holdout", "kp*"], "every recording has such a name"),
        (["set", "--holdout", "set"], "takes out every recording"),
        (["set/kp9*.csv"], "no recording has such a name; check the pattern"),
        (["nothing*/a?"], "no recording has such a name"),
        (["set", "--holdout", "absent.csv"], "absent.csv: no such file"),
        (["."], None),
        (["set/kp100_sine.csv", "--runs", "shot"], "no column 'shot' for segment"),
        (["set/kp100_sine.csv", "--runs", "segment"], "segment"),
    ],
)
def test_a_mistake_is_one_line(arguments, says, logs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path if says is None else logs)
    assert main(["compare", *arguments, "--actuator", str(logs / "mine.toml")]) == 2
    told = capsys.readouterr().err
    assert (says or "a folder without recordings; they end in .csv") in told and told.count("\n") == 1


@pytest.mark.parametrize("verb", ["compare", "discover", "identify"])
@pytest.mark.parametrize("again", ["itself", "link", "copy", "packed copy"])
def test_what_is_fitted_is_not_held_out(verb, again, logs, tmp_path, capsys):
    """Neither a file, nor a link to it, nor another with the same content."""
    source, held = logs / "set" / "kp100_sine.csv", tmp_path / "held.csv"
    if again == "itself":
        held = source
    elif again == "link":
        held.symlink_to(source)
    elif again == "copy":
        shutil.copy(source, held)
    else:
        held = tmp_path / "held.csv.gz"
        held.write_bytes(gzip.compress(source.read_bytes()))
    assert main([verb, str(source), "--holdout", str(held), "--actuator", str(logs / "mine.toml")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "fitted and " in told and "hold out a recording that is not fitted" in told
    assert source.stem in told or "held" in told


def stub(source, path):
    """The first 50 samples of a recording."""
    path.write_text("".join(source.read_text().splitlines(keepends=True)[:51]))
    return path


@pytest.mark.parametrize("verb", ["compare", "compare --by unit"])
def test_one_that_is_too_short_leaves_the_set(verb, logs, tmp_path, capsys):
    shutil.copytree(logs / "set", tmp_path / "units" / "set")
    for unit in ("set", "more") if "--by" in verb else ("set",):
        for number, one in enumerate(sorted((logs / "set").glob("kp*.csv")), 1):
            (tmp_path / "units" / unit).mkdir(exist_ok=True)
            rows = one.read_text().splitlines(keepends=True)
            (tmp_path / "units" / unit / one.name).write_text("".join(rows[: -number if unit == "more" else None]))
    stub(logs / "set" / "kp100_sine.csv", tmp_path / "units" / "set" / "begun.csv")
    given = tmp_path / "units" if "--by" in verb else tmp_path / "units" / "set"
    result = compared(logs, given, *verb.split()[1:])
    told = [line for line in capsys.readouterr().err.splitlines() if "left out" in line]
    assert len(told) == 1 and "begun.csv: has 50 samples; 100 or more are expected" in told[0]
    fitted = result["units"][1]["recordings"] if "--by" in verb else names(result["recordings"])
    assert fitted == ["kp100_sine", "kp200_sine", "kp400_sine"]


@pytest.mark.parametrize("several", [False, True])
def test_where_all_are_too_short_nothing_is_left(several, logs, tmp_path, capsys):
    stubs = [str(stub(logs / "set" / "kp100_sine.csv", tmp_path / f"{name}.csv")) for name in "ab"[: 1 + several]]
    assert main(["compare", *stubs, "--actuator", str(logs / "mine.toml")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "a.csv: has 50 samples; 100 or more are expected" in told
    assert ("none of the 2 recordings is longer" in told) == several


def test_names_and_patterns(tmp_path):
    (tmp_path / "run[1].csv").write_text("x")
    assert not is_pattern(str(tmp_path / "run[1].csv")) and is_pattern(str(tmp_path / "run[2].csv"))
    assert files_of(str(tmp_path / "run[1].csv")) == [str(tmp_path / "run[1].csv")]
    assert files_of("anything.csv") == ["anything.csv"]


def test_runs_need_their_numbers():
    plain = {"time_s": np.arange(5.0), "current_A": np.zeros(5)}
    with pytest.raises(InputError, match="segment"):
        runs_of(Measurement(plain))
    two = runs_of(Measurement({**plain, "segment": np.array([2.0, 2.0, 5.0, 5.0, 5.0])}, "log"))
    assert [one.name for one in two] == ["log#2", "log#5"] and [one.samples for one in two] == [2, 3]
    assert "segment" not in two[0]
