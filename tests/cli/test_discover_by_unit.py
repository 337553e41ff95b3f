"""`emaviz discover --by unit`: what all units lack, what one alone lacks, and what differs beside it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from support.bench_units import ACTUATOR, FRICTION, RUNS
from support.documents import result_of

from ema_model.actuator import load_actuator
from ema_model.recordings import Measurement, write_measurement
from emaviz.cli import main

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
