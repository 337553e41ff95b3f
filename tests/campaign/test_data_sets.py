"""Recordings of others: listed with their hashes, refused where they are not these, made recordings of, found by plans.

The copies are made up here; the originals are no part of the project.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from support.servo_logs import write_servo_log

from ema_model.actuator import load_actuator
from ema_model.campaign import load_plan, shipped_plans
from ema_model.campaign.data_sets import FOLDER, convert, data_sets, folder_of
from ema_model.errors import InputError
from ema_model.recordings import read, read_columns
from emaviz.cli import main

ACTUATORS = Path(__file__).parents[2] / "assets" / "actuators"
TIME = 5e-3 * np.arange(300)


def servo(path: Path, index: int) -> None:
    gain, trajectory = (100, 200, 400, 800)[index // 4], ("sin_sin", "steps", "up_and_down", "nothing")[index % 4]
    goal = np.sin(3.0 * TIME)
    signals = {"time_s": TIME, "command_rad": goal, "user_position_rad": 0.9 * goal, "motor_speed_rad_s": 2.7 * goal}
    write_servo_log(path, signals, gain, trajectory)


def positioning(path: Path, index: int) -> None:
    column = {name: one[:, None] for name, one in (("t", TIME), ("qg", TIME**2), ("qm", TIME**2), ("vir", 2.0 + TIME))}
    savemat(path, {**column, "gtau": 35.15, "kp": 160.18})


def joints(path: Path, index: int) -> None:
    table = np.zeros((TIME.size, 31))
    table[:, 0] = 1297.5 + TIME
    table[:, 1:7] = np.sin(TIME)[:, None] * np.arange(1, 7)
    table[:, 13:19] = np.cos(TIME)[:, None] * np.arange(1, 7)
    np.savetxt(path, table, delimiter=",", fmt="%.4f")


def bench(path: Path, index: int) -> None:
    names = ["time [s]", "a1 q-axis cmd [A]", "a1 position [rad]", "a1 q-axis [A]", "c1 mode"]
    mode = np.where(TIME < 0.1, 0.0, 9.0)
    table = np.column_stack([TIME, np.where(TIME < 0.2, 0.0, 1.0), TIME**2, np.sin(TIME), mode])
    head = "# Test started at noon\n# g1 = 1.0; g2 = 6.0\n" + ",".join(names)
    np.savetxt(path, table, delimiter=",", header=head, comments="")


def hobby(path: Path, index: int) -> None:
    def rolled(samples: int, powered: bool = True) -> dict:
        sensor, goal = np.linspace(0.0, 0.5, samples).tolist(), np.linspace(0.0, 0.6, samples).tolist()
        return {"type": "ramp", "actions": goal if powered else [None] * samples, "sensor_data": sensor}

    path.write_text(json.dumps({"data": [rolled(150), rolled(12), rolled(100), rolled(100, False), rolled(120)]}))


MADE_UP = {"xl330": servo, "emps": positioning, "ur10e": joints, "dynamometer": bench, "hobby": hobby}


def copied(name: str, folder: Path):
    """A made-up copy of a set's files, and the set with their hashes."""
    digests = {}
    for index, path in enumerate(data_sets()[name].files):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        MADE_UP[name](folder / path, index)
        digests[path] = hashlib.sha256((folder / path).read_bytes()).hexdigest()
    return replace(data_sets()[name], files=digests)


def test_each_set_says_where_it_is_from_and_what_it_is():
    assert set(data_sets()) == set(MADE_UP)
    for one in data_sets().values():
        assert re.fullmatch(r"[\w.-]+/[\w.-]+", one.repository) and re.fullmatch(r"[0-9a-f]{40}", one.commit)
        assert one.licence and one.files
        assert all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in one.files.values())
        assert len(set(one.files.values())) == len(one.files)
        assert not any(Path(path).is_absolute() or ".." in Path(path).parts for path in one.files)


@pytest.mark.parametrize("name", MADE_UP)
def test_a_copy_becomes_recordings(name, tmp_path):
    written = convert(copied(name, tmp_path / "copy"), tmp_path / "copy", tmp_path / "data")
    assert {path.parent for path in written} == {tmp_path / "data" / name}
    columns = {path.stem: read_columns(path) for path in written}
    if name == "xl330":
        assert len(columns) == 16 and "xl330_kp400_up_and_down" in columns
        one = read(tmp_path / "data" / name / "xl330_kp800_sin_sin.csv", load_actuator(ACTUATORS / "xl330.toml"))
        np.testing.assert_allclose(one["user_position_rad"], 0.9 * np.sin(3.0 * TIME))
        assert np.max(np.abs(one["duty"])) <= 1.0
    elif name == "emps":
        assert list(columns) == ["train", "test"]
        np.testing.assert_allclose(columns["test"]["current_A"], 2.0 + TIME)
    elif name == "ur10e":
        assert len(columns) == 10
        fitted, held = columns["joint_3_fit"], columns["joint_3_held"]
        assert fitted["time_s"][-1] < held["time_s"][0] and fitted["time_s"][0] == 0.0
        np.testing.assert_allclose(fitted["motor_position_rad"], np.round(3.0 * np.sin(TIME[:150]), 4))
        np.testing.assert_allclose(fitted["current_A"], np.round(3.0 * np.cos(TIME[:150]), 4))
    elif name == "dynamometer":
        assert list(columns) == ["ri50_fit", "ri50_held", "ex8_fit", "ex8_held", "stairs_fit", "stairs_held"]
        assert columns["ri50_fit"]["time_s"][0] == pytest.approx(0.1)  # from where it is driven
        assert columns["stairs_held"]["time_s"][0] == pytest.approx(0.2)
    else:
        fitted, held = columns["hobby_fit"], columns["hobby_held"]
        assert fitted["time_s"].size == 150 + 120 and held["time_s"].size == 100  # neither short, nor without power
        assert fitted["command_rad"].max() == pytest.approx(0.6 * np.pi)
        assert set(fitted["segment"]) == {0.0, 1.0}


def test_other_files_are_refused_in_one_line_and_nothing_is_written(tmp_path):
    wanted = copied("emps", tmp_path)
    changed = tmp_path / list(wanted.files)[1]
    changed.write_bytes(changed.read_bytes() + b"\0")
    with pytest.raises(InputError, match=r"DATA_EMPS_PULSES.mat: is not the file of the benchmark .* check out commit"):
        convert(wanted, tmp_path, tmp_path / "data")
    changed.unlink()
    with pytest.raises(InputError, match=r"DATA_EMPS_PULSES.mat: .*no such file"):
        convert(wanted, tmp_path, tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_the_command_lists_says_and_refuses(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv(FOLDER, raising=False)
    assert main(["data"]) == 0
    out = capsys.readouterr().out
    assert all(one.address in out and one.licence in out for one in data_sets().values())
    assert main(["data", "emps"]) == 0
    out = capsys.readouterr().out
    assert "checkout 956aa7ecd73061b0321c6f6098d74c9e4a7ce67a -- examples/EMPS/data" in out
    copied("emps", tmp_path)
    assert main(["data", "emps", "--from", str(tmp_path), "--out", str(tmp_path / "data")]) == 2
    assert "is not the file of the benchmark" in capsys.readouterr().err
    assert main(["data", "emps", "--from", str(tmp_path)]) == 2
    assert FOLDER in capsys.readouterr().err
    assert main(["data", "ems"]) == 2
    assert "did you mean 'emps'?" in capsys.readouterr().err


PLANS = [name for name in shipped_plans() if name.startswith("field_")]


@pytest.mark.parametrize("plan", PLANS)
def test_a_plan_without_its_data_says_what_to_do(plan, tmp_path, capsys, monkeypatch):
    monkeypatch.delenv(FOLDER, raising=False)
    assert main(["campaign", plan, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert f"in the environment variable {FOLDER}; `emaviz data " in line
    monkeypatch.setenv(FOLDER, str(tmp_path))
    assert main(["campaign", plan, "--out", str(tmp_path / "out")]) == 2
    assert "are looked for in" in capsys.readouterr().err


@pytest.mark.parametrize("plan", PLANS)
def test_a_plan_finds_its_data_and_stays_the_same_plan(plan, tmp_path, monkeypatch):
    for name in MADE_UP:
        convert(copied(name, tmp_path / "copy" / name), tmp_path / "copy" / name, tmp_path / "data")
    monkeypatch.setenv(FOLDER, str(tmp_path / "data"))
    found = load_plan(plan)
    assert found.tasks and all(task.recorded is not None and task.recorded.holdout for task in found.tasks)
    for task in found.tasks:
        assert not {one.path for one in task.recorded.files} & {one.path for one in task.recorded.holdout}
    monkeypatch.delenv(FOLDER)
    (tmp_path / "plan.toml").write_text(found.text, encoding="utf-8")
    assert load_plan(tmp_path / "plan.toml").tasks == found.tasks


def test_the_folder_of_a_set_that_there_is_not():
    with pytest.raises(InputError, match="no data set 'bam'; there are xl330"):
        folder_of("bam")
