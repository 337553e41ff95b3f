"""`emaviz compare|discover --by unit`: whose a recording is, what units differ in and lack, and what is wrong."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.bench_units import ACTUATOR, FRICTION, RUNS, write_units
from support.compared import compared, one_file
from support.documents import result_of

from ema_model.actuator import load_actuator
from ema_model.recordings import Measurement, write_measurement
from emaviz.cli import main


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder of three units' folders, one file of all of them with a column for the unit, and the actuator's file."""
    folder = tmp_path_factory.mktemp("bench")
    slow = write_units(folder / "units")
    one_file(folder / "all.csv", [{"serial": np.full(1000, i + 11.0), **signals} for i, signals in enumerate(slow)])
    assert main(["actuator", "new", str(folder / "mine.toml"), *ACTUATOR]) == 0
    return folder


def check(found: dict, unit: str) -> None:
    (one,) = found["differences"]
    assert (one["unit"], one["parameter"]) == (unit, "motor.dynamic_friction_Nm")
    low, high = one["interval90"]
    assert 0.007 < low < one["change"] < high < 0.009


def test_folders_are_units_with_all_outputs(bench, capsys):
    page, kept = bench / "units.html", bench / "type.toml"
    outputs = ("--report", page, "--save-actuator", kept, "--force")
    found = compared(bench, bench / "units", "--by", "unit", "--holdout", "*unseen*", *outputs)
    check(found, "right")
    assert found["differences"][0]["held_out_evidence"] > 0.0
    assert [one["name"] for one in found["units"]] == list(FRICTION)
    assert found["units"][0]["recordings"] == ["left_fast", "left_slow"] and found["units"][0]["holdout"] == [
        "left_unseen"
    ]
    told = capsys.readouterr().out
    assert re.match(r"right (differs|seems to differ) from the rest in motor dynamic friction \(\+6\d", told)
    assert "The model of one unit on another" in page.read_text() and "<h1>right " in page.read_text()
    assert load_actuator(kept).value("motor.dynamic_friction_Nm") == pytest.approx(0.012, rel=0.05)
    assert found["transfer"]["floors"][0][2] > 2.0 * found["transfer"]["floors"][0][0]


def test_a_column_tells_the_unit(bench):
    check(compared(bench, bench / "all.csv", "--by", "serial"), "serial 13")


def test_patterns_tell_the_unit(bench):
    given = [text for unit in FRICTION for text in ("--unit", f"U{unit[0]}=*{unit}*")]
    check(compared(bench, bench / "units", *given), "Ur")


LEFT = "units/left/left_slow.csv"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["units/left", "--by", "unit"], "one unit only .*left.*two or more"),
        (["units", "--by", "serial"], "no such column.*--by unit takes folders"),
        (["units", "--unit", "a=*left*"], "of no unit"),
        (["units", "--unit", "a=*", "--unit", "b=*left*"], "of a and of b"),
        (["units", "--unit", "a=*", "--unit", "b=*nowhere*"], "b=.*nowhere.*none of the recordings"),
        (["units", "--unit", "left"], "NAME=GLOB"),
        (["units/none*.csv", "--by", "unit"], "check the pattern"),
        (["units", "--by", "unit", "--holdout", "left*"], "unit left: no recording of it is left"),
        (["units", LEFT, "--by", "unit", "--holdout", LEFT], "left_slow.csv: is named to be fitted and by --holdout"),
        (["units", "left.csv", "--by", "unit", "--holdout", LEFT], "left_slow: is both fitted and held out .*of left"),
        (["units", "--by", "unit", "--no-calibrate"], "--no-calibrate: has no meaning"),
        (["units", "--by", "unit", "--fault", "k1=0.2"], "--fault: has no meaning"),
        (["units", "--by", "unit", "--free", "motor.mass"], "motor.mass cannot be calibrated"),
        (["all.csv", "--by", "serial", "--runs", "serial"], "give one of them"),
        (["all.csv", "--by", "serial", "--unit", "a=*"], "give one of them"),
        (["empty", "--by", "unit"], "a folder without recordings"),
    ],
)
def test_bad_input_is_one_clear_line(bench, arguments, words, capsys, monkeypatch):
    monkeypatch.chdir(bench)
    (bench / "empty").mkdir(exist_ok=True)
    shutil.copy(LEFT, "left.csv")
    assert main(["compare", *arguments, "--actuator", "mine.toml"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "Traceback" not in told
    assert re.search(words, told), told


def test_mixed_actuators_are_refused(bench, tmp_path, capsys):
    shutil.copytree(bench / "units", tmp_path / "units")
    for unit, name in (("left", "a"), ("right", "b")):
        (tmp_path / "units" / unit / f"{unit}_slow.toml").write_text(f'actuator = "{name}.toml"\n')
    assert main(["compare", str(tmp_path / "units"), "--by", "unit", "--actuator", str(bench / "mine.toml")]) == 2
    told = capsys.readouterr().err
    assert "right_slow.csv" in told and "of one type" in told and told.count("\n") == 1


def test_without_by_a_folder_of_units_is_no_set(bench, capsys):
    assert main(["compare", str(bench / "units"), "--actuator", str(bench / "mine.toml")]) == 2
    assert "a folder without recordings" in (told := capsys.readouterr().err) and told.count("\n") == 1


# --- emaviz discover --by unit: what all units lack, what one alone lacks, and what differs beside it -----------------

COGGING_Nm = 0.004


@pytest.fixture(scope="module")
def actuator(tmp_path_factory):
    file = tmp_path_factory.mktemp("bench") / "mine.toml"
    assert main(["actuator", "new", str(file), *ACTUATOR]) == 0
    return file


def write(folder: Path, cogging: dict[str, float]) -> Path:
    """Three motors on a bench, with so much cogging each."""
    time = np.arange(0.0, 2.0, 2e-3)
    for i, (unit, friction) in enumerate(FRICTION.items()):
        (folder / unit).mkdir(parents=True)
        for j, run in enumerate(RUNS):  # always forward: at a reversal the friction's own law would stand out
            pace = 2.0 * np.pi * (0.8 + 0.3 * j)
            position = 10.0 * time + 6.0 / pace * np.sin(pace * time)
            torque = friction - 1.1e-4 * 6.0 * pace * np.sin(pace * time) + cogging[unit] * np.sin(12.0 * position)
            noise = np.random.default_rng([i, j]).standard_normal(len(time))
            signals = {"time_s": time, "motor_position_rad": position, "current_A": torque / 0.05 + 0.04 * noise}
            write_measurement(Measurement(signals), folder / unit / f"{unit}_{run}.csv")
    return folder


def discovered(folder: Path, actuator: Path, *more: object) -> dict:
    out = folder / "result.json"
    given = ["--by", "unit", "--holdout", "*unseen*", "--actuator", actuator, "--json", out, *more]
    assert main(["discover", str(folder), *map(str, given)]) == 0
    return result_of(out, "discover")


@pytest.mark.long
def test_what_all_units_lack_is_one_statement_and_what_differs_stands_beside(tmp_path, actuator, capsys):
    folder = write(tmp_path / "units", dict.fromkeys(FRICTION, COGGING_Nm))
    report, kept = tmp_path / "units.html", tmp_path / "type.toml"
    found = discovered(folder, actuator, "--report", report, "--save-actuator", kept)
    (effect,) = found["effects"]
    assert effect["name"] == "cogging_torque" and effect["all_units"] and [*effect["units"]] == [*FRICTION]
    for one in effect["units"].values():
        low, high = one["parameters"]["amplitude_Nm"]["interval90"]
        assert low < COGGING_Nm < high or abs(one["parameters"]["amplitude_Nm"]["value"] - COGGING_Nm) < 5e-4
        assert one["holdout_rmse_after"] < 0.7 * one["holdout_rmse_before"]
    differ = {(one["unit"], one["parameter"]) for one in found["compared"]["differences"]}
    assert differ == {("right", "motor.dynamic_friction_Nm")}
    told = capsys.readouterr().out
    assert re.search("^all 3 units lack cogging torque$", told, re.MULTILINE)
    assert re.search(r"^beside it, right differs from the rest in motor dynamic friction \(\+6\d", told, re.MULTILINE)
    assert "<h1>All 3 units lack cogging torque" in report.read_text()
    assert "The model of one unit on another" in report.read_text()
    assert load_actuator(kept).effects["cogging_torque"]["amplitude_Nm"] == pytest.approx(COGGING_Nm, rel=0.15)


@pytest.mark.long
def test_what_one_unit_alone_lacks_is_said_of_it(tmp_path, actuator, capsys):
    folder = write(tmp_path / "units", {"left": 0.0, "middle": COGGING_Nm, "right": 0.0})
    found = discovered(folder, actuator)
    (effect,) = found["effects"]
    assert [*effect["units"]] == ["middle"] and not effect["all_units"]
    assert found["sentences"][0] == "middle alone lacks cogging torque; left and right do not show it"


def test_one_unit_only_is_one_clear_line(tmp_path, actuator, capsys):
    folder = write(tmp_path / "units", dict.fromkeys(FRICTION, 0.0))
    given = ["--by", "unit", "--actuator", str(actuator)]
    assert main(["discover", str(folder / "left"), *given]) == 2
    assert "one unit only (left)" in capsys.readouterr().err
    assert main(["discover", str(folder), *given, "--record", str(tmp_path / "a.rrd")]) == 2
    assert "--record: has no meaning where units are compared" in capsys.readouterr().err
