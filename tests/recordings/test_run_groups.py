"""A group for each run, in HDF5, MATLAB and JSON: one table with the runs' numbers, and recordings of their own."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import savemat
from support.mat_structs import row_of_structs

from ema_model.recordings import read_columns
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.read import read_header, read_measurement
from ema_model.recordings.recording_set import runs_of


def run(index):
    """Of a length of its own, its time from zero."""
    time = np.arange(150 + 10 * index) / 1e3
    return {"time_s": time, "motor_position_rad": index + np.sin(time), "current_A": np.cos(time)}


RUNS = {f"trial_{index}": run(index) for index in (2, 10, 3)}


def hdf5(path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for group, columns in RUNS.items():
            for name, values in columns.items():
                file[f"day/{group}/{name}"] = values


def mat(path):
    savemat(path, RUNS)


def documents(path):
    runs = {name: {k: v.tolist() for k, v in columns.items()} for name, columns in RUNS.items()}
    path.write_text(json.dumps(runs))


@pytest.mark.parametrize(("ending", "write"), [(".h5", hdf5), (".mat", mat), (".json", documents)])
def test_groups_are_runs(ending, write, tmp_path):
    path = tmp_path / f"day{ending}"
    write(path)
    assert set(read_header(str(path), 10**9)) == {*run(1), "run"}
    measurement = read_measurement(path, ["segment=run"])
    assert any("a run a group: 2 is trial_2, 3 is trial_3, 10 is trial_10" in note for note in measurement.notes)
    recordings = runs_of(measurement)
    assert [one.name for one in recordings] == ["day#2", "day#3", "day#10"]
    for one, index in zip(recordings, (2, 3, 10)):
        for name, values in run(index).items():
            np.testing.assert_allclose(one[name], values, atol=1e-12)


def test_a_row_of_structs_is_runs(tmp_path):
    savemat(tmp_path / "a.mat", {"log": row_of_structs([run(1), run(2)])})
    columns = read_columns(tmp_path / "a.mat")
    np.testing.assert_array_equal(columns["run"], np.repeat([1.0, 2.0], [160, 170]))


@pytest.mark.parametrize(
    "groups",
    [
        {"axis_1": run(1), "axis_2": run(1)},  # of one machine
        {"trial_1": run(1), "trial_2": {"time_s": run(2)["time_s"], "duty": run(2)["current_A"]}},
        {"trial_1": run(1), "settings_2": run(2)},
        {"trial_1": {**run(1), "run": run(1)["current_A"]}, "trial_2": {**run(2), "run": run(2)["current_A"]}},
    ],
)
def test_groups_that_are_no_runs(groups, tmp_path):
    savemat(tmp_path / "a.mat", groups)
    columns = read_columns(tmp_path / "a.mat")
    assert "run" not in columns and len(columns) >= 4


def test_a_list_of_runs_in_json(tmp_path):
    """Each a record with a list for each signal, of its own length; samples may be lists of one or more numbers."""
    random = np.random.default_rng(2)
    lengths, runs = (150, 50, 75), []
    for length, kind in zip(lengths, ("chirp", "step", "prbs")):
        goal = random.standard_normal(length)
        angle = (0.5 * goal)[:, None]
        runs.append({"type": kind, "targets": [0.1, 0.2], "actions": goal.tolist(), "sensor_data": angle.tolist(),
                     "currents": np.column_stack([goal, 2.0 * goal]).tolist(), "kp": 32.0})  # fmt: skip
    document = {"dataset": "real", "config": {"action_hz": 50}, "data": runs}
    (tmp_path / "a.json").write_text(json.dumps(document))
    names = read_header(str(tmp_path / "a.json"), 10**8)
    assert names == ["actions", "sensor_data", "currents_1", "currents_2", "run"]
    mapping = ["command_rad=actions", "user_position_rad=sensor_data", "current_A=currents[:,1]", "segment=run"]
    found = read_measurement(tmp_path / "a.json", mapping, hints=Hints(rate_Hz=50.0))
    assert found.samples == sum(lengths) and [run.stop - run.start for run in found.runs] == list(lengths)
    np.testing.assert_allclose(found["user_position_rad"], 0.5 * found["command_rad"])
    np.testing.assert_allclose(found["current_A"], 2.0 * found["command_rad"])
    np.testing.assert_allclose(np.diff(found.time_s), 0.02)
    assert "a run a record, 3 in all: 1 is chirp, 2 is step, 3 is prbs" in found.notes
    assert any("config.action_hz = 50" in note for note in found.notes)


def test_a_single_run_in_a_list(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"data": [{"x": list(range(120)), "y": list(range(120))}]}))
    assert list(read_columns(tmp_path / "a.json")) == ["x", "y", "run"]


def test_samples_in_json_that_hold_lists_are_no_runs(tmp_path):
    rows = [{"t": i / 100.0, "q": [float(i)] * 30, "dq": [2.0 * i] * 30} for i in range(120)]
    (tmp_path / "a.json").write_text(json.dumps(rows))
    found = read_measurement(tmp_path / "a.json", ["time_s=t", "motor_position_rad=q[:,29]", "motor_speed_rad_s=dq_1"])
    np.testing.assert_allclose(found["motor_position_rad"], np.arange(120.0))
    np.testing.assert_allclose(found["motor_speed_rad_s"], 2.0 * np.arange(120.0))
