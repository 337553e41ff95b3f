"""Numbers that no command can take are told in one line, before anything is simulated."""

from __future__ import annotations

import pytest
from options_of import needed, options_with_values

from ema_model.simulation import plant, run
from emaviz.cli import main
from emaviz.cli.options import Number

NUMBERS = [one for one in options_with_values() if isinstance(one[2].type, Number)]
HOSTILE = ("nan", "inf", "-inf", "9" * 5000, "-" + "9" * 5000, "", "many", "1e999")
OUTSIDE = [
    *(f"simulate --duration={value} --out x.csv" for value in ("0", "-1", "1e300", "601", "1e-9")),
    *(f"simulate --sample-rate={value} --out x.csv" for value in ("0", "-1", "1e300", "1e-300")),
    "simulate --duration=600 --sample-rate=1e6 --out x.csv",
    *(f"simulate --load-torque={value} --out x.csv" for value in ("1e300", "-1e300")),
    *(f"{command}--noise-current={v}" for command in ("simulate --out x.csv ", "identify ") for v in ("-1", "1e300")),
    *(f"{command}--seed=-1" for command in ("simulate --noise-current 0.1 --out x.csv ", "identify ")),
    "compare in.csv --seed=-1",
    "discover in.csv --seed=-1",
    *(f"simulate --encoder-bits={value} --out x.csv" for value in ("-1", "33", "1.5")),
    *(f"identify --population={value}" for value in ("1", "-5", "1000000000000", "1e300")),
    *(f"identify --iterations={value}" for value in ("0", "-5", "1000000000000", "1e300")),
    "discover in.csv --max-effects=-1",
    *(f"{command} --port={value}" for command in ("gui --no-open", "view in.rrd") for value in ("-1", "65536", "80.5")),
    *(f"simulate --set {pair} --out x.csv" for pair in ("amplitude_rad=nan", "end_Hz=1e999", f"start_Hz={'9' * 5000}")),
    *(f"simulate --fault k1={value} --out x.csv" for value in ("nan", "-1", "9" * 5000)),
    *(f"simulate --effect cogging_torque:order={value} --out x.csv" for value in ("nan", "inf", "9" * 5000)),
    f"simulate --effect user_torque:expression={'9' * 5000}*omega --out x.csv",
    f"simulate --effect user_torque:expression=c*omega,c={'9' * 5000} --out x.csv",
]


@pytest.fixture(autouse=True)
def _nothing_is_simulated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("in.csv", "in.rrd", "in.part"):
        (tmp_path / name).write_text("x")

    def simulated(*_, **__):
        raise AssertionError("this was simulated")

    for module, name in ((run, "simulate_reference"), (run, "simulate_monitor"), (plant, "simulated")):
        monkeypatch.setattr(module, name, simulated)


def told(arguments, capsys):
    assert main(arguments) == 2
    line = capsys.readouterr().err
    assert line.startswith("emaviz: ") and line.count("\n") == 1
    assert "in." not in line  # which is no recording, and is not reached
    return line


@pytest.mark.parametrize("command, name, action", NUMBERS, ids=[f"{c} {n}" for c, n, _ in NUMBERS])
def test_no_option_takes_what_is_no_number(command, name, action, capsys):
    for value in HOSTILE:
        line = told([*needed(command, "in.csv"), f"{name}={value}"], capsys)
        assert f"argument {name}: must be a" in line and len(line) < 200


@pytest.mark.parametrize("line", OUTSIDE, ids=[line[:60] for line in OUTSIDE])
def test_numbers_outside_are_told_before_any_simulation(line, capsys):
    assert len(told(line.split(), capsys)) < 6000


def test_too_many_samples_name_the_limit(capsys):
    line = told("simulate --duration=600 --sample-rate=1e6 --out x.csv".split(), capsys)
    assert "600 s at 1e+06 Hz are 600000000 samples, and 10000000 are the most" in line
