"""A discovery as a recording: read back exactly, laid out, and failures told in one line."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader
from support.discovered import with_cogging, with_unknown

from ema_model.errors import InputError
from ema_model.quantities import number
from emaviz.recording import read
from emaviz.recording.discovery import write_discovery


@pytest.fixture(scope="module")
def found():
    return with_cogging()


@pytest.fixture(scope="module")
def written(found, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "discover.rrd"
    write_discovery(found, path, {"files": ["a.csv"], "seed": 0})
    return path


def _columns(path, entity, component, **store):
    """Values of one component of an entity, or of all, a list for each row."""
    rows = []
    for chunk in RrdReader(path).stream(**store):
        batch = chunk.to_record_batch()
        if entity in (None, str(chunk.entity_path)) and component in batch.schema.names:
            rows += [value for value in batch.column(component).to_pylist() if value is not None]
    return rows


def test_signals_and_the_residual_of_each_step_come_back(found, written):
    signals = read(written).signals
    windows = found.plant.windows
    for name in ("current_A", "user_position_rad", "motor_position_rad"):
        measured = np.concatenate([window.measured[name] for window in windows])
        assert_array_equal(signals["measurement"][name].values, measured)
        for step, rung in enumerate(found.ladder):
            model = np.concatenate([shown[name] for shown in rung.signals_per_window])
            assert_array_equal(signals["residual"][f"step_{step}/{name}"].values, measured - model)
        assert_array_equal(signals["residual"][name].values, measured - signals["monitor"][name].values)
        assert_array_equal(signals["floor_low"][name].values, -signals["floor_high"][name].values)
    before, after = (float(np.std(signals["residual"][f"step_{step}/current_A"].values)) for step in (0, 1))
    assert after < 0.95 * before


def test_recordings_stand_one_after_another_with_a_gap(found, written):
    recording = read(written)
    time = recording.signals["residual"]["step_1/current_A"].time_s
    first, second = found.plant.windows
    assert np.all(np.diff(time) > 0.0)
    assert_allclose(time[: first.blocks], first.time_s, atol=1e-9)
    assert_allclose(time[first.blocks :], second.time_s + recording.properties["shift_s"][1], atol=1e-8)
    assert "a\\|b &lt;script>" in recording.config and "moved by" in recording.config
    ends = {
        str(chunk.entity_path)
        for chunk in RrdReader(written).stream()
        if "Clear:is_recursive" in chunk.to_record_batch().schema.names
    }
    assert {"/measurement/current_A", "/residual/step_0/current_A"} <= ends


def test_ladder_has_a_row_for_each_step(found, written):
    rows = _columns(written, "/discovery/ladder", "Scalars:scalars")
    assert_allclose(rows, [[rung.rmse, rung.holdout_rmse, 1.0] for rung in found.ladder])
    assert _columns(written, "/discovery/ladder", "iteration") == list(range(len(found.ladder)))


def test_words_tell_the_verdict_the_effect_and_the_candidates(found, written):
    [verdict] = _columns(written, "/discovery/verdict", "TextDocument:text")
    value = found.calibration.parameters["effects.cogging_torque.amplitude_Nm"].value
    for told in ("The model lacks cogging torque.", f"{1e3 * value:.1f} ± ", "mN·m", "| 12 |", "+ Cogging torque"):
        assert told in verdict[0], told
    assert "effects_found" not in verdict[0], "that name is for programs"
    [ranking] = _columns(written, "/discovery/candidates", "TextDocument:text")
    assert (
        "|\n| Cogging torque |" in ranking[0]
        and "| Dead time | – |  | &lt; 0.1 % | these recordings cannot show it" in ranking[0]
    )
    told = read(written).properties["discovery"]
    assert told["verdict"] == "effects_found" and told["effects"][0]["name"] == "cogging_torque"


def test_it_opens_arranged(written):
    reader = RrdReader(written)
    (layout,) = reader.blueprints()
    texts = " ".join(str(chunk.to_record_batch().columns) for chunk in reader.stream(store=layout))
    for title in ("Signals", "Ladder", "Candidates", "Residuals", "Configuration", "step 1: + Cogging torque"):
        assert title in texts, title
    legends = _columns(written, None, "PlotLegend:visible", store=layout)
    assert legends.count([False]) == 2, "bars are named by their view: a legend would have their paths"
    for title in ("left: fitted; purple, right: held out", "left: predicted; teal, right: refitted"):
        assert title in texts, title


@pytest.mark.long
def test_nothing_held_out_and_only_a_curve_added(tmp_path):
    found = with_unknown()
    write_discovery(found, tmp_path / "d.rrd")
    rows = [[rung.rmse, 1.0] for rung in found.ladder]
    assert len(rows) == 2
    assert_allclose(_columns(tmp_path / "d.rrd", "/discovery/ladder", "Scalars:scalars"), rows)
    [verdict] = _columns(tmp_path / "d.rrd", "/discovery/verdict", "TextDocument:text")
    assert "none of the known effects explains" in verdict[0] and "motor angle" in verdict[0]
    assert f"The calibrated model's error is {number(found.ladder[0].rmse)} times the floor" in verdict[0]
    assert "curve stands in for it" in verdict[0]


def test_a_place_that_cannot_be_written_is_told_in_one_line(found, tmp_path):
    for path in (tmp_path / "none" / "d.rrd", tmp_path / "d.html"):
        with pytest.raises(InputError) as error:
            write_discovery(found, path)
        assert "\n" not in str(error.value) and str(path.parent) in str(error.value)
