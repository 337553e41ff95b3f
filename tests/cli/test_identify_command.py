"""`emaviz identify`: the robust default, the polish of the others, effects that are added, what is told of a misfit."""

from __future__ import annotations

import pytest
from support.documents import result_of

from emaviz.cli import main

EFFECT = "cogging_torque:amplitude_Nm=0.012,order=12"


@pytest.fixture(scope="module")
def cogging(tmp_path_factory):
    path = tmp_path_factory.mktemp("identify") / "cogging.csv"
    arguments = ["simulate", "--model", "rm", "--effect", EFFECT, "--fault", "k2=0.2", "--encoder-bits", "12"]
    assert main([*arguments, "--noise-current", "0.1", "--out", str(path)]) == 0
    return path


def test_robust_is_the_default_and_says_how_sure_it_is(tmp_path, capsys):
    out = tmp_path / "result.json"
    assert main(["identify", "--fault", "k6=0.25", "--json", str(out)]) == 0
    result = result_of(out, "identify")
    assert result["algorithm"] == "robust" and result["polished"] is True
    assert result["error_percent"] < 0.5 and result["adequate"] is True
    assert result["alarms"] == ["k6"] and result["healthy"] is False
    low, high = result["k_interval90"][5]
    assert 0.2 < low <= 0.25 <= high < 0.3
    assert len(result["history"]["rmse"]) == len(result["history"]["k"]) > 2
    assert "not healthy: k6" in capsys.readouterr().out


def test_polish_is_told_beside_what_the_search_found(tmp_path):
    out = tmp_path / "result.json"
    arguments = ["identify", "--fault", "k1=0.25", "--algorithm", "ssa", "--population", "10", "--iterations", "8"]
    assert main([*arguments, "--polish", "--json", str(out)]) == 0
    result = result_of(out, "identify")
    assert result["polished"] is True and result["error_percent"] < 0.5
    assert result["searched_k"] != result["k"]


@pytest.mark.long
def test_missing_physics_blames_no_part_until_it_is_added(cogging, tmp_path, capsys):
    out = tmp_path / "result.json"
    assert main(["identify", str(cogging), "--json", str(out)]) == 0
    result = result_of(out, "identify")
    assert result["adequate"] is False and result["alarms"] == [] and result["healthy"] is False
    assert "Discover, on the same recordings, looks for it" in result["warnings"][0]
    assert "the model does not fit" in capsys.readouterr().out

    assert main(["identify", str(cogging), "--effect", EFFECT, "--json", str(out)]) == 0
    result = result_of(out, "identify")
    assert result["adequate"] is True and "k2" in result["alarms"]
    assert result["k"][1] == pytest.approx(0.2, abs=0.05)
