"""What is written is read back, under the fixed names, with its layout."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rerun.chunk import RrdReader

from emaviz.recording import RecordingError, RecordingWriter
from emaviz.recording.read import read

K = [f"k{i}" for i in range(1, 9)]


@pytest.fixture
def written(tmp_path, write):
    path = tmp_path / "run.rrd"
    with RecordingWriter(path, name="run one") as writer:
        arrays = write(writer)
    assert writer.failed is None
    return path, arrays


def test_everything_comes_back_exactly(written, signals):
    path, arrays = written
    found = read(path)
    time, values = signals
    assert found.complete and found.name == "run one"
    assert found.groups == ["reference", "monitor", "residual"]
    for group in ("reference", "monitor"):
        for name, expected in values.items():
            assert_array_equal(found.signals[group][name].time_s, time)
            assert_array_equal(found.signals[group][name].values, expected)
    trace = found.identification["hba"]
    assert_array_equal(trace.iteration, np.arange(60))
    for name in ("rmse", "best", "population", "population_rmse"):
        assert_array_equal(getattr(trace, name), arrays[name])
    assert list(trace.monitor) == [40]
    assert_array_equal(trace.monitor[40].values, values["current_A"])
    assert_array_equal(found.truth, arrays["truth"])
    assert found.config is not None and "| seed | 7 |" in found.config
    assert trace.result is not None and "k1 \\| friction" in trace.result
    assert found.properties == {"seed": 7, "faults": {"k1": 0.25}, "k": arrays["truth"].tolist(), "name": "x|y"}


def test_entity_paths_and_timelines_are_the_agreed_ones(written):
    over_time, static = {}, set()
    for chunk in RrdReader(written[0]).stream():
        path = str(chunk.entity_path)
        if chunk.is_static:
            static.add(path)
        else:
            over_time.setdefault(path, set()).update(chunk.timeline_names)
    hba = "/identification/hba"
    for path in ("/reference/current_A", "/monitor/user_position_rad", "/residual/current_A"):
        assert over_time[path] == {"sim_time"}
    assert over_time[f"{hba}/monitor/iteration_0040/current_A"] == {"sim_time"}
    for path in [f"{hba}/rmse", *(f"{hba}/{kind}/{k}" for kind in ("best", "population") for k in K)]:
        assert over_time[path] == {"iteration"}
    assert {"/config", f"{hba}/result", *(f"/truth/{k}" for k in K)} <= static
    assert {name for names in over_time.values() for name in names} == {"sim_time", "iteration"}


def test_one_layout_is_stored_with_views_of_what_is_there(written):
    (layout,) = RrdReader(written[0]).blueprints()
    texts = " ".join(str(c.to_record_batch().columns) for c in RrdReader(written[0]).stream(store=layout))
    for title in ("Signals", "Equivalent current [A]", "Identification hba", "k1 friction [-]", "Configuration"):
        assert title in texts
    for absent in ("Motor speed", "/measurement/", "Phase currents"):
        assert absent not in texts


def test_parts_of_a_recording_are_enough(tmp_path, signals):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.signals("measurement", signals[0], signals[1])
    assert read(tmp_path / "a.rrd").groups == ["measurement"]
    with RecordingWriter(tmp_path / "b.rrd") as writer:
        writer.iteration("ssa", 0, float("inf"), np.zeros(8))
    trace = read(tmp_path / "b.rrd").identification["ssa"]
    assert trace.population is None and trace.rmse[0] == np.inf
    with RecordingWriter(tmp_path / "c.rrd"):
        pass
    assert read(tmp_path / "c.rrd").groups == []


def test_populations_may_change_size(tmp_path):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        writer.iteration("do", 0, 1.0, np.zeros(8), np.ones((3, 8)))
        writer.flush()
        writer.iteration("do", 1, 1.0, np.zeros(8), np.ones((2, 8)))
    population = read(tmp_path / "a.rrd").identification["do"].population
    assert population is not None and population.shape == (2, 3, 8)
    assert np.isnan(population[1, 2]).all() and np.isfinite(population[1, :2]).all()
    path, name = "/identification/do/population/k1", "Scalars:scalars"
    drawn = [c.to_record_batch() for c in RrdReader(tmp_path / "a.rrd").stream() if str(c.entity_path) == path]
    rows = [row for batch in drawn if name in batch.schema.names for row in batch.column(name).to_pylist()]
    assert [len(row) for row in rows] == [3, 3], "the viewer complains of rows of different lengths"


def test_mistakes_of_the_caller_are_raised(tmp_path):
    with RecordingWriter(tmp_path / "a.rrd") as writer:
        with pytest.raises(ValueError, match="no group"):
            writer.signals("rm", [0.0], {"current_A": [1.0]})
        with pytest.raises(ValueError, match="shape"):
            writer.signals("monitor", [0.0, 1.0], {"current_A": [1.0]})
        with pytest.raises(ValueError, match="shape"):
            writer.iteration("hba", 0, 1.0, np.zeros(7))
        with pytest.raises(ValueError, match="letters"):
            writer.iteration("h/a", 0, 1.0, np.zeros(8))
        with pytest.raises(ValueError, match="algorithm"):
            writer.result({"a": 1})
        assert writer.failed is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such file"),
        (b"", "empty"),
        (b"time_s,current_A\n", "no Rerun recording"),
        (b"RRF2" + b"x" * 99, "damag"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / "bad.rrd"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=message) as error:
        read(path)
    assert "\n" not in str(error.value) and str(path) in str(error.value)
    with pytest.raises(RecordingError, match="folder"):
        read(tmp_path)


def test_a_file_cut_in_the_middle_is_read_as_far_as_it_goes(written, tmp_path):
    whole = written[0].read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: len(whole) * 9 // 10])  # what it found stands first, signals over time stand last
    found = read(cut)
    assert found.identification and "current_A" in found.signals["reference"]
    assert cut.read_bytes() == whole[: len(whole) * 9 // 10]


def test_what_is_looked_at_first_stands_first(written):
    """A viewer shows what it has read so far."""
    chunks = [chunk for chunk in RrdReader(written[0]).stream().to_chunks() if not chunk.is_static]
    over_time = ["iteration" not in chunk.timeline_names for chunk in chunks]
    assert over_time == sorted(over_time) and 0 < sum(over_time) < len(over_time)
