"""The command line: results and their JSON, and one clear line for each mistake."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from options_of import command_parser, every_command
from support.documents import result_of

from ema_model.commands import COMMANDS as MODEL_COMMANDS
from ema_model.effects import CATALOGUE
from ema_model.effects.user.torque import KINDS
from ema_model.identification.run import ALGORITHMS
from ema_model.recordings.read import read_measurement
from ema_model.simulation.plant import FITNESSES
from emaviz.cli import main, options


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "friction.csv"
    assert main(["simulate", "--fault", "k1=0.25", "--noise-current", "0.1", "--out", str(path)]) == 0
    return path


def test_simulate_writes_the_measurement_format(recording):
    measurement = read_measurement(recording)
    for name in (
        "time_s command_rad user_position_rad motor_position_rad motor_speed_rad_s current_A phase_a_current_A "
        "phase_b_current_A phase_c_current_A"
    ).split():
        assert name in measurement
    assert measurement.samples == 5001
    assert measurement.sample_period_s == pytest.approx(1e-4)


def test_simulate_is_reproducible_by_seed(tmp_path):
    def run(seed, name):
        path = tmp_path / name
        arguments = ["simulate", "--model", "mm", "--noise-current", "0.4", "--encoder-bits", "12"]
        assert main([*arguments, "--seed", str(seed), "--out", str(path)]) == 0
        return read_measurement(path)["current_A"]

    first = run(1, "a.parquet")
    assert np.array_equal(first, run(1, "b.csv"))
    assert not np.array_equal(first, run(2, "c.csv"))


@pytest.mark.parametrize("model", ["rm", "mm"])
def test_effects_act_in_both_models(tmp_path, model):
    plain, rippled = tmp_path / "plain.csv", tmp_path / "cogging.csv"
    assert main(["simulate", "--model", model, "--out", str(plain)]) == 0
    effect = "cogging_torque:amplitude_Nm=0.024,order=12"
    assert main(["simulate", "--model", model, "--effect", effect, "--out", str(rippled)]) == 0
    difference = read_measurement(rippled)["current_A"] - read_measurement(plain)["current_A"]
    assert 0.1 < np.sqrt(np.mean(difference**2)) < 1.0


def test_identify_finds_the_fault_of_a_file(recording, tmp_path, capsys):
    out = tmp_path / "result.json"
    assert main(["identify", str(recording), "--algorithm", "do", "--json", str(out), "--seed", "3"]) == 0
    result = result_of(out, "identify")
    assert result["schema"] == 1 and result["seed"] == 3
    assert set(result["versions"]) == {"emaviz", "numpy", "numba"}
    assert abs(result["k"][0] - 0.25) < 0.02
    assert result["alarms"] and "k1" in result["alarms"] and result["healthy"] is False
    assert len(result["k_interval90"]) == 8 and len(result["history"]["rmse"]) == 151
    assert result["physical"]["friction_factor"] == pytest.approx(1.5, abs=0.05)
    assert "friction × 1." in capsys.readouterr().out


def test_identify_with_faults_tells_the_error(tmp_path):
    out = tmp_path / "result.json"
    arguments = ["identify", "--fault", "k3=0.25", "--algorithm", "do", "--json", str(out)]
    assert main(arguments) == 0
    assert result_of(out, "identify")["error_percent"] < 0.6


def test_effects_lists_and_explains(capsys):
    assert main(["effects"]) == 0
    assert "stribeck_friction" in capsys.readouterr().out
    assert main(["effects", "cogging_torque"]) == 0
    assert "amplitude_Nm" in capsys.readouterr().out


BAD = {
    "missing file": ["identify", "nothing-here.csv"],
    "folder": ["identify", "."],
    "no such fault": ["identify", "--fault", "k9=0.1"],
    "fault outside": ["identify", "--fault", "k1=1.5"],
    "fault is text": ["identify", "--fault", "k1=much"],
    "fault is nan": ["identify", "--fault", "k1=nan"],
    "no such algorithm": ["identify", "--algorithm", "magic"],
    "population": ["identify", "--population", "0"],
    "population text": ["identify", "--population", "many"],
    "iterations": ["identify", "--iterations", "0"],
    "no such command": ["simulate", "--command", "wiggle", "--out", "x.csv"],
    "no such setting": ["simulate", "--set", "colour=3", "--out", "x.csv"],
    "setting is text": ["simulate", "--set", "end_Hz=fast", "--out", "x.csv"],
    "setting without value": ["simulate", "--set", "end_Hz", "--out", "x.csv"],
    "zero sweep": ["simulate", "--set", "end_time_s=0", "--out", "x.csv"],
    "duration": ["simulate", "--duration", "-1", "--out", "x.csv"],
    "duration nan": ["simulate", "--duration", "nan", "--out", "x.csv"],
    "load": ["simulate", "--load-torque", "inf", "--out", "x.csv"],
    "sample rate": ["simulate", "--sample-rate", "0", "--out", "x.csv"],
    "noise": ["simulate", "--noise-current", "-1", "--out", "x.csv"],
    "encoder": ["simulate", "--encoder-bits", "99", "--out", "x.csv"],
    "no such effect": ["simulate", "--effect", "magic", "--out", "x.csv"],
    "effect setting": ["simulate", "--effect", "cogging_torque:colour=1", "--out", "x.csv"],
    "effect range": ["simulate", "--effect", "cogging_torque:order=1.5", "--out", "x.csv"],
    "no out": ["simulate"],
    "out suffix": ["simulate", "--out", "x.docx"],
    "out folder": ["simulate", "--out", "no/such/folder/x.csv"],
    "json folder": ["effects", "--json", "no/such/folder/x.json"],
    "actuator": ["identify", "--actuator", "none.toml"],
    "view missing": ["view", "none.rrd"],
    "unknown option": ["simulate", "--colour", "red"],
    "gui port": ["gui", "--port", "99999", "--no-open"],
    "unknown word": ["recognise"],
}


@pytest.mark.parametrize("arguments", BAD.values(), ids=BAD.keys())
def test_a_mistake_is_one_line_and_exit_code_2(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert told.startswith("emaviz: ") and told.count("\n") == 1, told
    assert not (tmp_path / "x.csv").exists()


def test_a_taken_port_is_told(capsys, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["gui", "--port", str(port), "--no-open", "--data-dir", str(tmp_path)]) == 2
    assert f"port {port} is in use" in capsys.readouterr().err


def test_the_model_core_imports_no_screen():
    code = "import sys, ema_model.identification.run; print(sorted({'viser', 'rerun', 'emaviz'} & set(sys.modules)))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"


# Commands one after another in one process: after each, its exit code and which of these modules are there by then.
RUNS_ALL = """
import contextlib, io, json, sys
from emaviz.cli import main

for line in json.load(sys.stdin):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            code = main(line.split())
        except SystemExit as ended:
            code = ended.code
    heavy = ("numpy", "numba", "scipy", "msgspec", "pyarrow", "pandas", "plotly", "rerun", "viser")
    print(json.dumps([line, code, [name for name in heavy if name in sys.modules]]))
"""
AT_ONCE = {
    0: ["--version", "--help", *(f"{one} --help" for one in every_command()), "completion bash"],
    2: [
        *("comapre x.csv", "compare x.csv --fruit 1", "compare", "identify --algorithm magic", "identify --seed=-1"),
        *("simulate --command chrip --out x.csv", "simulate --effect coging_torque --out x.csv", "simulate --colour 1"),
        *("effects coging_torque", "campaign thesis", "campaign thesis --out x --scheduler here", "actuator nwe"),
        "compare missing.csv",
    ],
}
WITHOUT_KERNELS = [
    *("compare missing*.csv", "identify .", "compare bad.csv", "discover bad.csv --actuator bad.csv", "view bad.csv"),
    *("compare short.csv", "compare unknown.csv", "compare words.csv"),
    *("simulate --out missing/x.csv", "identify --fault k9=0.1", "simulate --set amplitude=1 --out x.csv"),
]


def runs(lines, folder):
    (folder / "bad.csv").write_text("a,b\n1,2\n")
    for name, columns, rows, last in (
        ("short", "time_s,current_A", 50, "1"),
        ("unknown", "a,b", 200, "1"),
        ("words", "time_s,current_A", 200, "many"),
    ):
        text = [columns, *(f"{i * 1e-3},1" for i in range(rows)), f"{rows * 1e-3},{last}", f"{rows * 1e-3 + 1e-3},1"]
        (folder / f"{name}.csv").write_text("\n".join(text))
    command, given = [sys.executable, "-c", RUNS_ALL], json.dumps(lines)
    done = subprocess.run(command, input=given, cwd=folder, capture_output=True, text=True, check=True)
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def test_help_completion_and_refused_arguments_import_nothing_that_computes(tmp_path):
    expected = [(line, code, []) for code, lines in AT_ONCE.items() for line in lines]
    assert runs([line for line, _, _ in expected], tmp_path) == expected


def test_a_refused_file_needs_no_kernels(tmp_path):
    for line, code, modules in runs(WITHOUT_KERNELS, tmp_path):
        heavy = {"numba", "scipy", "pandas", "plotly", "rerun", "viser"} & set(modules)
        assert code == 2 and not heavy, (line, code, modules)


def test_the_names_that_options_list_are_the_models():
    assert options.command_names() == tuple(MODEL_COMMANDS)
    for name in (*CATALOGUE, *KINDS, "cogging_torque_2", "user_torque_own"):
        assert options.effect_name(name) == name
    identify = command_parser("identify")
    choices = {action.dest: tuple(action.choices) for action in identify._actions if action.choices}
    assert choices["algorithm"] == tuple(ALGORITHMS) and choices["fitness"] == FITNESSES


SUGGESTED = {
    "comapre x.csv": "comapre: neither a command nor a file; did you mean 'compare'? (see emaviz --help)",
    "fly": "fly: neither a command nor a file (see emaviz --help)",
    "actuator nwe": "'nwe' is none of new, check, keys; did you mean 'new'? (see emaviz actuator --help)",
    "compare x.csv --holdaut y": "no option --holdaut; did you mean '--holdout'? (see emaviz compare --help)",
    "simulate --ouut=x.csv": "no option --ouut; did you mean '--out'? (see emaviz simulate --help)",
    "actuator check a.toml --jsn x": "no option --jsn; did you mean '--json'? (see emaviz actuator check --help)",
    "identify --algorithm robost": "did you mean 'robust'? (see emaviz identify --help)",
    "simulate --out x.csv --command chrip": "or a recording's file; did you mean 'chirp'? (see emaviz simulate --help)",
    "simulate --out x.csv --effect coging_torque": "no effect 'coging_torque'; did you mean 'cogging_torque'?",
    "simulate --out x.csv --effect cogging_torque:amplitud_Nm=1": "phase_rad; did you mean 'amplitude_Nm'?",
    "simulate --out x.csv --set amplitude=1": "did you mean 'amplitude_rad'?",
    "effects stribeck": "no effect 'stribeck'; did you mean 'stribeck_friction'?",
    "compare RUN --signal curent_A": "did you mean 'current_A'?",
    "compare RUN --free motor.inertia_kgm": "did you mean 'motor.inertia_kgm2'?",
    "identify --fault k9=1": "no fault 'k9'; faults are k1 … k8",
    "challenge frist": "no challenge frist; there are ",
}


@pytest.mark.parametrize("line", SUGGESTED)
def test_a_mistyped_name_is_answered_by_the_one_like_it(line, recording, capsys):
    assert main([str(recording) if text == "RUN" else text for text in line.split()]) == 2
    said = capsys.readouterr().err
    assert SUGGESTED[line] in said and said.count("\n") == 1, said


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("line", ["--version", "compare --help", "effects", "challenge", "completion zsh"])
def test_an_output_that_cannot_be_written_is_told(line):
    for to, unbuffered in (("> /dev/full", ""), ("> /dev/full", "1"), (">&-", "")):
        environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
        command = f"{sys.executable} -m emaviz {line} {to}"
        done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, env=environment)
        told = "emaviz: the standard output cannot be written ("
        assert done.returncode == 1 and done.stderr.startswith(told) and done.stderr.count("\n") == 1, done


def test_closed_streams_do_not_become_files(tmp_path):
    out = tmp_path / "a.json"
    done = subprocess.run(["sh", "-c", f"{sys.executable} -m emaviz effects cogging_torque --json {out} <&- >&- 2>&-"])
    assert done.returncode == 1 and result_of(out, "effects")["effects"][0]["name"] == "cogging_torque"


COMPLETED = {
    "comp": ["compare", "completion"],
    "compare --hol": ["--holdout"],
    "actuator n": ["new"],
    "actuator new --contr": ["--controller"],
    "identify --algorithm ": list(ALGORITHMS),
    "compare --no-c": ["--no-calibrate"],
}


def test_bash_completes_commands_options_and_choices(capsys):
    assert main(["completion", "bash"]) == 0
    script = capsys.readouterr().out
    for line in COMPLETED:
        words = ["emaviz", *line.split(" ")]
        script += f"COMP_WORDS=({' '.join(map(repr, words))}); COMP_CWORD={len(words) - 1}; _emaviz\n"
        script += 'echo "${COMPREPLY[@]}"\n'
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert [line.split() for line in done.stdout.splitlines()] == list(COMPLETED.values())


def test_each_shell_gets_every_command_and_option(capsys):
    options_there = {name for sub in every_command() for name in re.findall(r"--[a-z-]+", _help(sub, capsys))}
    for shell, dashes in (("zsh", "--"), ("fish", "-l ")):
        assert main(["completion", shell]) == 0
        script = capsys.readouterr().out
        assert all(f"{dashes}{name[2:]}" in script for name in options_there)


def _help(command, capsys):
    with pytest.raises(SystemExit):
        main([*command.split(), "--help"])
    return capsys.readouterr().out.partition("options:")[2]


def test_verbose_says_what_is_done_and_when(recording):
    command = [sys.executable, "-m", "emaviz", "-v", "compare", str(recording), "--no-calibrate"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    lines = done.stderr.splitlines()
    assert all(re.match(r"\d\d:\d\d:\d\d ", line) for line in lines), done.stderr
    assert "emaviz -v compare" in lines[0] and "reading friction.csv" in done.stderr and "ended after" in lines[-1]


BROKEN = """
import sys
from emaviz import cli
from emaviz.cli.verbs import challenge

def run(arguments):
    raise RuntimeError("this is broken")

challenge.run = run
sys.argv = ["emaviz", "challenge", *sys.argv[1:]]
sys.exit(cli.main())
"""


def test_a_failure_of_ours_is_a_line_and_with_verbose_a_traceback():
    line, traceback = (
        subprocess.run([sys.executable, "-c", BROKEN, *verbose], capture_output=True, text=True)
        for verbose in ([], ["--verbose"])
    )
    assert line.returncode == traceback.returncode == 1
    assert line.stderr == "emaviz: an internal failure, RuntimeError: this is broken; --verbose shows where\n"
    assert "Traceback" in traceback.stderr and "in run" in traceback.stderr
