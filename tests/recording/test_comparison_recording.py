"""A comparison as a recording: read back exactly, laid out, and failures told in one line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rerun.chunk import RrdReader
from support.comparison_by_hand import comparison as by_hand

from ema_model.errors import InputError
from emaviz.recording import read
from emaviz.recording.blueprint import Contents, build
from emaviz.views.report import export


@pytest.fixture(scope="module")
def comparison():
    return by_hand(("bench run", "a|b <script>"))


@pytest.fixture(scope="module")
def written(comparison, tmp_path_factory):
    path = tmp_path_factory.mktemp("recording") / "compare.rrd"
    export(comparison, path, {"files": ["a.csv"], "seed": 0})
    return path


def test_one_recording_comes_back_on_its_own_time(tmp_path):
    comparison = by_hand(calibrated=False)
    export(comparison, tmp_path / "c.rrd")
    found, one = read(tmp_path / "c.rrd"), comparison.recordings[0]
    assert set(found.groups) == {"measurement", "monitor", "residual", "floor_high", "floor_low"}
    for name in comparison.signals:
        for group, expected in (
            ("measurement", one.measured[name]),
            ("monitor", one.model[name]),
            ("residual", one.measured[name] - one.model[name]),
            ("floor_high", 2.0 * one.sigma[name]),
        ):
            assert_allclose(found.signals[group][name].time_s, one.time_s, atol=1e-9)
            assert_array_equal(found.signals[group][name].values, expected)
    # what was not compared is there as it was recorded
    assert_array_equal(found.signals["measurement"]["command_rad"].values, one.measurement["command_rad"])


def test_several_recordings_stand_one_after_another(comparison, written):
    found = read(written)
    first, second = comparison.recordings
    time, values = found.signals["residual"]["current_A"]
    assert np.all(np.diff(time) > 0.0)
    assert_array_equal(
        values, np.concatenate([one.measured["current_A"] - one.model["current_A"] for one in (first, second)])
    )
    shifts = found.properties["shift_s"]
    assert shifts[0] == 0.0 and shifts[1] > first.measurement.time_s[-1] - second.measurement.time_s[0]
    assert_allclose(time[len(first.time_s) :], second.time_s + shifts[1], atol=1e-8)
    assert found.config is not None and "moved by" in found.config and "a\\|b &lt;script>" in found.config
    gaps = [
        chunk for chunk in RrdReader(written).stream() if "Clear:is_recursive" in chunk.to_record_batch().schema.names
    ]
    assert {"/residual/current_A", "/measurement/command_rad"} <= {str(chunk.entity_path) for chunk in gaps}


def test_runs_that_start_anew_follow_each_other(comparison, tmp_path):
    one = comparison.recordings[0]
    half = len(one.time_s) // 2
    time = one.time_s.copy()
    time[half:] -= time[half] - time[0]
    samples = one.measurement.time_s.copy()
    middle = len(samples) // 2
    samples[middle:] -= samples[middle] - samples[0]
    segment = np.repeat([0.0, 1.0], [middle, len(samples) - middle])
    measurement = one.measurement.with_signals(time_s=samples, segment=segment)
    restarted = replace(comparison, recordings=[replace(one, time_s=time, measurement=measurement)])
    restarted = replace(restarted, worst_regions=())
    export(restarted, tmp_path / "c.rrd")
    series = read(tmp_path / "c.rrd").signals["measurement"]["current_A"]
    assert_array_equal(series.values, one.measured["current_A"])
    assert np.all(np.diff(series.time_s) > 0.0)


def test_what_was_found_is_read_back(comparison, written):
    told = read(written).properties["comparison"]
    assert told["sentences"] == list(comparison.sentences) and told["adequate"] is comparison.adequate
    assert [region["sentence"] for region in told["worst_regions"]] == [r.sentence for r in comparison.worst_regions]


def test_it_opens_on_the_verdict_with_overlay_and_residuals(written):
    reader = RrdReader(written)
    (layout,) = reader.blueprints()
    texts = " ".join(str(chunk.to_record_batch().columns) for chunk in reader.stream(store=layout))
    for title in ("Overlay", "Residuals", "Where it fails", "More signals", "Configuration", "/comparison/regions"):
        assert title in texts
    tabs = [
        one.name for one in build(Contents({"residual": ["current_A"]}, findings=["answer"])).root_container.contents
    ]
    assert tabs[:3] == ["Where it fails", "Overlay", "Residuals"]
    documents = {
        str(chunk.entity_path): str(chunk.to_record_batch().columns)
        for chunk in reader.stream()
        if str(chunk.entity_path).startswith("/comparison/")
    }
    assert set(documents) == {"/comparison/answer", "/comparison/regions"}
    assert "18 mN·m" in documents["/comparison/regions"] and "not adequate" in documents["/comparison/answer"]


def test_a_place_that_cannot_be_written_is_told_in_one_line(comparison, tmp_path):
    path = tmp_path / "none" / "c.rrd"
    with pytest.raises(InputError) as error:
        export(comparison, path)
    assert "\n" not in str(error.value) and str(path.parent) in str(error.value)
