"""An actuator file that knows the faults of its unit: the commands start from them, and `--fault` says otherwise."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.documents import result_of

from ema_model.actuator import load_actuator, save_actuator
from emaviz.cli import main
from emaviz.session.explore import Session


@pytest.fixture
def worn(tmp_path):
    """A unit with worn bearings and a low gain."""
    save_actuator(replace(load_actuator(), faults={"k1": 0.3, "k8": 0.25}), tmp_path / "worn.toml")
    return tmp_path / "worn.toml"


def test_a_run_and_a_comparison_take_the_known_faults(worn, tmp_path):
    run, out = tmp_path / "run.csv", tmp_path / "out.json"
    simulated = ["simulate", "--actuator", str(worn), "--duration", "0.2", "--noise-current", "0.1", "--out", str(run)]
    assert main([*simulated, "--json", str(out)]) == 0
    assert result_of(out, "simulate")["k"] == [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.25]
    compared = ["compare", str(run), "--no-calibrate", "--json", str(out)]
    adequate = []
    for options in (["--actuator", str(worn)], [], ["--actuator", str(worn), "--fault", "k1=0", "--fault", "k8=0.5"]):
        assert main([*compared, *options]) == 0
        adequate.append(result_of(out, "compare")["adequate"])
    assert adequate == [True, False, False]


def test_an_option_goes_before_the_file(worn, tmp_path):
    out = tmp_path / "out.json"
    arguments = ["--fault", "k1=0.1", "--fault", "k2=0.2", "--out", str(tmp_path / "run.csv"), "--json", str(out)]
    assert main(["simulate", "--actuator", str(worn), "--duration", "0.05", *arguments]) == 0
    assert result_of(out, "simulate")["k"] == [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.5, 0.25]


def test_an_identification_counts_from_the_healthy_actuator(worn, tmp_path):
    run, out = tmp_path / "run.csv", tmp_path / "out.json"
    assert main(["simulate", "--actuator", str(worn), "--noise-current", "0.1", "--out", str(run)]) == 0
    assert main(["identify", str(run), "--actuator", str(worn), "--population", "20", "--json", str(out)]) == 0
    found = result_of(out, "identify")
    assert found["k"][0] == pytest.approx(0.3, abs=0.05) and found["k"][7] == pytest.approx(0.25, abs=0.05)
    assert not found["healthy"]


def test_the_page_breaks_the_unit_from_where_it_is(worn, tmp_path):
    session = Session(load_actuator(worn), tmp_path)
    try:
        assert session.settings.k.tolist() == [0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.25]
    finally:
        session.close()
