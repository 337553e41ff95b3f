"""`emaviz compare --by unit`: whose a recording is, all outputs, and one clear line for each thing that is wrong."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest
from support.bench_units import ACTUATOR, FRICTION, write_units
from support.compared import compared, one_file

from ema_model.actuator import load_actuator
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
