"""`emaviz export`: files, words and JSON; and one line for what it cannot take, with nothing half written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.documents import result_of

import ema_model as em
from ema_model.actuator import actuator_text
from ema_model.effects import Parameter, register
from ema_model.effects.effect import PLACES
from ema_model.effects.user.torque import UserEffect, generated_module
from ema_model.exports import c, fmu
from ema_model.exports.exported import exported, identifier
from emaviz.cli import main

ACTUATORS = Path(__file__).parents[2] / "assets" / "actuators"
XL330 = str(ACTUATORS / "xl330.toml")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    file = tmp_path_factory.mktemp("recordings") / "step.csv"
    assert main(["simulate", "--duration", "0.2", "--noise-current", "0.05", "--out", str(file)]) == 0
    return str(file)


def refused(capsys, *arguments) -> str:
    """The one line."""
    assert main(["export", *map(str, arguments)]) == 2
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert told.startswith("emaviz: ")
    return told


def test_files_stand_wherever_the_options_do(recording, tmp_path, capsys):
    out, found = tmp_path / "home", tmp_path / "found.json"
    given = [
        str(ACTUATORS / "thesis.toml"),
        "--to",
        "c",
        recording,
        "--to",
        "python",
        "--out",
        str(out),
        "--json",
        str(found),
    ]
    assert main(["export", *given]) == 0
    told = capsys.readouterr().out
    assert {file.name for file in out.iterdir()} == {"thesis_ema.c", "thesis_ema.h", "thesis_ema.py"}
    assert "replayed on step" in told and "monitor model   ratio" in told and "1.000" in told
    result = result_of(found, "export")
    of_c = result["export"]["c"]
    assert set(result["export"]) == {"c", "python"} and of_c["difference"] <= 1e-9 and of_c["ratio"] <= 1.01
    assert of_c["rmse"]["current_A"] == pytest.approx(of_c["rmse_ours"]["current_A"], rel=1e-6)
    assert of_c["rmse"]["current_A"] > 0.01, "the reference model's chopping, and noise"
    assert of_c["recordings"][0]["signals"]["motor_speed_rad_s"]["begins_s"] is None


def test_without_recordings_a_run_is_made(tmp_path, capsys):
    found = tmp_path / "found.json"
    assert main(["export", XL330, "--to", "c", "--out", str(tmp_path / "home"), "--json", str(found)]) == 0
    assert "replayed on a run made for it" in capsys.readouterr().out
    of_c = json.loads(found.read_text())["export"]["c"]
    assert of_c["ratio"] is None and of_c["rmse"] == {} and of_c["difference"] <= 1e-9


def test_an_unknown_controller_is_said_to_be_left_out(tmp_path, capsys):
    assert main(["export", str(ACTUATORS / "odrive.toml"), "--to", "c", "--out", str(tmp_path / "home")]) == 0
    assert "exported as a plant that is driven by the motor's torque" in capsys.readouterr().out
    assert "command: torque that the motor's current makes, N·m" in (tmp_path / "home" / "odrive_motor.h").read_text()


def test_from_python(tmp_path):
    result = em.export(em.load_actuator(XL330), tmp_path / "home", ["c"], name="Elbow joint")
    assert [file.name for file in sorted((tmp_path / "home").iterdir())] == ["elbow_joint.c", "elbow_joint.h"]
    assert result.targets[0].difference <= 1e-9 and "elbow_joint.c" in str(result)


# --- what it cannot take ----------------------------------------------------------------------------------------------


def test_a_folder_that_holds_something(tmp_path, capsys):
    file = tmp_path / "mine.txt"
    file.write_text("mine")
    told = refused(capsys, XL330, "--to", "c", "--out", tmp_path)
    assert "exists already; name a folder that is new or empty" in told
    assert "exists already" in refused(capsys, XL330, "--to", "c", "--out", file)
    assert "does not exist; make it first" in refused(capsys, XL330, "--to", "c", "--out", tmp_path / "no" / "where")
    assert file.read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_no_compiler(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    told = refused(capsys, XL330, "--to", "c", "--out", tmp_path / "home")
    assert "no C compiler found" in told and "install gcc" in told
    assert not list(tmp_path.iterdir())


def test_a_target_that_is_not_installed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(fmu.importlib.util, "find_spec", lambda name: None)
    told = refused(capsys, XL330, "--to", "fmu", "--out", tmp_path / "home")
    assert "fmpy is not installed" in told and "emaviz[export]" in told and not list(tmp_path.iterdir())


def test_a_target_that_does_not_exist(tmp_path, capsys):
    assert "'simulink' is none of c, fmu" in refused(capsys, XL330, "--to", "simulink", "--out", tmp_path / "home")
    with pytest.raises(em.InputError, match="no target 'fmi'; targets are"):
        em.export(em.load_actuator(XL330), tmp_path / "home", ["fmi"])
    with pytest.raises(em.InputError, match="name a target"):
        em.export(em.load_actuator(XL330), tmp_path / "home", [])


@pytest.mark.parametrize(
    "line",
    [
        "    return torque + math.erf(theta) * gain",
        "    return torque + [gain][0]",
        "    while omega > gain:\n        omega -= gain\n    return torque",
    ],
)
def test_an_effect_that_has_no_form(line, tmp_path):
    """A line that Python runs, and C has no like of here, is refused where it stands."""
    arguments = ", ".join([*PLACES["shaft_torque"], "gain"])
    name, module = generated_module("user_strange", f"import math\n\n@scalar\ndef shaft_torque({arguments}):\n{line}\n")
    register(
        UserEffect(
            title="Strange", equation="", source="", explanation="",
            parameters=(Parameter("gain", "gain", 1.0, 0.0, 2.0),),
            severities=(1.0, 1.0, 1.0), places=(module.shaft_torque,), shows="", mistaken_for="",
            family="mechanics", name=name, kind="user_torque",
        )
    )  # fmt: skip
    actuator = replace(em.load_actuator(XL330), effects={name: {"gain": 1.0}})
    with pytest.raises(em.InputError, match="has no form in it") as error:
        em.export(actuator, tmp_path / "home", ["c"])
    assert ", line " in str(error.value) and "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_a_complaint_of_the_compiler_is_one_line_and_nothing_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(c, "source", lambda one: "this is no C;\n")
    with pytest.raises(em.InputError, match=r"refuses xl330_on_a_pendulum\.c") as error:
        em.export(em.load_actuator(XL330), tmp_path / "home", ["c"])
    assert "\n" not in str(error.value) and not list(tmp_path.iterdir())


def test_foreign_names_stay_within_comments(tmp_path):
    """What an actuator's author wrote can end no comment, and makes no code."""
    text = actuator_text(XL330).replace("XL330 on a pendulum", 'A */ int x; /* \\" \\"\\"\\" \\\\ evil ??/')
    (tmp_path / "a.toml").write_text(text)
    result = em.export(em.load_actuator(tmp_path / "a.toml"), tmp_path / "home", ["c", "fmu", "python"], name="fine")
    assert {one.target for one in result.targets} == {"c", "fmu", "python"}
    assert "*/ int x" not in (tmp_path / "home" / "fine.c").read_text()


def test_names_are_those_of_code():
    assert identifier("XL330 on a pendulum") == "xl330_on_a_pendulum"
    assert identifier("3 Achsen, Prüfstand Ä") == "actuator_3_achsen_prufstand_a"
    with pytest.raises(em.InputError, match="no name for files"):
        identifier("电机")
    assert exported(em.load_actuator(XL330), "Arm").name == "arm"
