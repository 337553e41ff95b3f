"""A group for each run, in HDF5, MATLAB and JSON: one table with the runs' numbers, and recordings of their own."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import savemat
from support.mat_structs import row_of_structs

from ema_model.recordings import read_columns
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
