"""What NumPy and MATLAB write is read: alone, structured, in structs, packed or not; those that are written agree."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from ema_model.errors import InputError
from ema_model.recordings import SIGNALS, Measurement, read_columns, write_measurement
from ema_model.recordings.formats import FORMATS, WRITTEN
from ema_model.recordings.formats.arrow import as_numpy, mask
from ema_model.recordings.read import read_measurement

N = 150
k = np.arange(float(N))
COLUMNS = {"time_s": k / 1e3, "current_A": np.sin(k / 9.0), "motor_position_rad": k / 7.0}


def assert_same(measurement, columns=COLUMNS):
    assert sorted(measurement) == sorted(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(measurement[name], np.asarray(values, float).ravel())
        assert measurement[name].dtype == np.float64 and measurement[name].dtype.isnative


@pytest.mark.parametrize(
    "column",
    [
        pa.array([1.5, None, -2.0]),
        pa.array([1, 2, 3], pa.int16()),
        pa.array([1, None, 3], pa.uint32()),
        pa.array([0.5, 0.25], pa.float32()),
        pa.array([True, False, True, True]),
        pa.array([], pa.float64()),
        pa.array(range(9)).slice(2, 5),
        pa.chunked_array([pa.array([1.0, 2.0]).slice(1), pa.array([None, 4.0])]),
        pa.chunked_array([[True, False], [], [False]]),
    ],
    ids=str,
)
def test_arrows_columns_are_numpys_as_arrow_would_make_them(column):
    alone = column if isinstance(column, pa.ChunkedArray) else pa.chunked_array([column])
    expected = alone.to_numpy()
    for one in (column, alone):
        found = as_numpy(one)
        np.testing.assert_array_equal(found, expected)
        assert found.dtype == expected.dtype and found.flags.writeable


def test_what_is_masked_reaches_arrow():
    kept = np.array([True, False, True, True, False, True, False, False, True])
    assert pa.array(range(9)).filter(mask(kept)).to_pylist() == [0, 2, 3, 5, 8]


def test_the_formats_that_are_written():
    assert next(iter(FORMATS)) == ".csv" and set(WRITTEN) == {".csv", ".parquet", ".npz", ".mat"}
    assert all(suffix in file_format.suffixes and file_format.title for suffix, file_format in FORMATS.items())


@pytest.mark.parametrize("suffix", sorted(WRITTEN))
def test_round_trip(suffix, tmp_path):
    states = {"segment": k // 50, "drive_enabled": k % 2}
    values = {name: np.sin(k * (1.0 + i)) * 10.0 ** (i - 9) for i, name in enumerate(SIGNALS)}
    values |= {"time_s": k / 3e3, **states}
    write_measurement(Measurement(values), tmp_path / f"run{suffix}")
    assert_same(read_measurement(tmp_path / f"run{suffix}"), values)
    table = read_columns(tmp_path / f"run{suffix}")
    assert list(table) == list(SIGNALS)
    np.testing.assert_array_equal(table["current_A"], values["current_A"])


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_of_vectors(save, tmp_path):
    path = tmp_path / "a.npz"
    save(path, time_s=COLUMNS["time_s"][None, :], current_A=COLUMNS["current_A"][:, None], gain=3.0, label="rig 1",
         motor_position_rad=COLUMNS["motor_position_rad"], table=np.zeros((N, 2)))  # fmt: skip
    measurement = read_measurement(path)
    assert_same(measurement)
    assert measurement.notes == (
        "left aside, as they are no columns of numbers: gain, label",
        "left aside, as their names are not known: table_1, table_2",
    )


@pytest.mark.parametrize("dtype", ["f2", "f4", ">f8", "<f8", "f16", "i1", "u2", ">i4", "u8", "?"])
def test_npz_of_other_number_types(dtype, tmp_path):
    if np.dtype(dtype).kind == "f" and np.dtype(dtype).itemsize == 16 and np.finfo(dtype).bits < 80:
        pytest.skip("no long double on this machine")
    numbers = (k % 2).astype(dtype)
    np.savez(tmp_path / "a.npz", time_s=k, duty=numbers)
    assert_same(read_measurement(tmp_path / "a.npz"), {"time_s": k, "duty": k % 2})


def test_npz_structured(tmp_path):
    table = np.rec.fromarrays([*COLUMNS.values(), np.array(["x"] * N)], names=[*COLUMNS, "note"])
    np.savez(tmp_path / "a.npz", log=np.asarray(table))
    assert_same(read_measurement(tmp_path / "a.npz"))
    # A name that stands twice is told apart by its array's.
    np.savez(tmp_path / "a.npz", rig=np.asarray(table), time_s=2.0 * k, model=np.asarray(table)[["current_A"]])
    assert set(read_columns(tmp_path / "a.npz")) == {"time_s", "rig.time_s", "current_A", "motor_position_rad",
                                                     "model.current_A"}  # fmt: skip
    np.testing.assert_array_equal(read_measurement(tmp_path / "a.npz").time_s, 2.0 * k)


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("oned_as", ["row", "column"])
def test_mat_of_vectors(packed, oned_as, tmp_path):
    path = tmp_path / "a.mat"
    more = {"gain": 3.0, "label": "rig 1", "table": np.zeros((N, 2)), "cells": np.array([1, "a"], object)}
    savemat(path, COLUMNS | more, do_compression=packed, oned_as=oned_as)
    measurement = read_measurement(path)
    assert_same(measurement)
    assert measurement.notes == (
        "single numbers in the file: gain = 3, cells{1} = 1",
        "left aside, as they are no columns of numbers: label, cells{2}",
        "left aside, as their names are not known: table_1, table_2",
    )


def test_mat_matrices_structs_in_a_row_and_cells(tmp_path):
    table = np.column_stack([k / 1e3, np.sin(k), np.cos(k)])
    two = np.array([(k, 2.0 * k), (3.0 * k, 4.0 * k)], dtype=[("speed", object), ("angle", object)])
    savemat(tmp_path / "a.mat", {"data": table, "log": two, "cells": np.array([k, "x", table], object), "kp": 7.0})
    columns = read_columns(tmp_path / "a.mat")
    assert list(columns) == [
        *("data_1", "data_2", "data_3", "log(1).speed", "log(1).angle", "log(2).speed", "log(2).angle"),
        *("cells{1}", "cells{3}_1", "cells{3}_2", "cells{3}_3"),
    ]
    np.testing.assert_array_equal(columns["data_2"], np.sin(k))
    np.testing.assert_array_equal(columns["log(2).angle"], 4.0 * k)
    mapped = read_measurement(tmp_path / "a.mat", ["time_s=data(:,1)", "current_A=data_3[mA]"])
    np.testing.assert_allclose(mapped["current_A"], np.cos(k) / 1e3)
    assert "single numbers in the file: kp = 7" in mapped.notes


AXES, SAMPLES = 7, 150
TIME = np.arange(SAMPLES) / 500.0
ANGLES = np.sin(np.linspace(0.0, 3.0, SAMPLES)[:, None] * np.arange(1, AXES + 1))  # (samples, axes)


def _npz_of_a_robot(path, angles):
    np.savez(path, time=TIME, q=angles, home=np.zeros(AXES), image=np.zeros((SAMPLES, 10_000), "u1"))


def _mat_of_a_robot(path, angles):
    savemat(path, {"time": TIME, "q": angles, "home": np.zeros(AXES), "image": np.zeros((SAMPLES, 10_000), "u1")})


def _hdf5_of_a_robot(path, angles):
    import h5py

    with h5py.File(path, "w") as file:
        file["robot/time"], file["robot/q"], file["robot/home"] = TIME, angles, np.zeros(AXES)
        file["image"] = np.zeros((SAMPLES, 10_000), "u1")


def _mat73_of_a_robot(path, angles):
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"time": TIME[:, None], "q": angles, "image": np.zeros((SAMPLES, 10_000), "u1")}.items():
            file.create_dataset(name, data=values.T).attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def _json_of_a_robot(path, angles):
    image = np.zeros((SAMPLES, 100)).tolist()
    path.write_text(json.dumps({"log": {"time": TIME.tolist(), "q": angles.tolist()}, "image": image}))


OF_A_ROBOT = {
    ".npz": _npz_of_a_robot,
    ".mat": _mat_of_a_robot,
    ".h5": _hdf5_of_a_robot,
    "73.mat": _mat73_of_a_robot,
    ".json": _json_of_a_robot,
}


@pytest.mark.parametrize("turned", [False, True], ids=["a column a joint", "a row a joint"])
@pytest.mark.parametrize("suffix", OF_A_ROBOT)
def test_a_matrix_gives_a_column_for_each_joint(suffix, turned, tmp_path):
    path = tmp_path / f"a{suffix}"
    OF_A_ROBOT[suffix](path, ANGLES.T if turned else ANGLES)
    assert {f"q_{i + 1}" for i in range(AXES)} <= set(read_columns(path))
    for place, joint in {"q_7": 6, "q[:,6]": 6, "q[6]": 6, "q(:, 7)": 6, "q[:, 0]": 0, "q_3[deg]": 2}.items():
        found = read_measurement(path, ["time_s=time", f"motor_position_rad={place}"])
        scale = np.pi / 180 if "deg" in place else 1.0
        np.testing.assert_allclose(found["motor_position_rad"], scale * ANGLES[:, joint], rtol=1e-14)
        assert any("image" in note and "over 64 columns" in note for note in found.notes)
    with pytest.raises(InputError, match=r"no column 'q\[:,7\]' for motor_position_rad"):
        read_measurement(path, ["time_s=time", "motor_position_rad=q[:,7]"])


def test_the_length_of_time_says_which_way_a_matrix_lies(tmp_path):
    signals = np.arange(40.0)[:, None] * np.arange(60.0)  # (40, 60)
    for samples, first, last in ((40, signals[:, 0], 60), (60, signals[0], 40)):
        np.savez(tmp_path / "a.npz", t=np.arange(float(samples)), q=signals)
        columns = read_columns(tmp_path / "a.npz")
        assert list(columns) == ["t", *(f"q_{i + 1}" for i in range(last))]
        np.testing.assert_array_equal(columns["q_1"], first)


def test_a_matrix_of_too_many_columns_alone_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", q=np.zeros((200, 10_000), "u1"))
    with pytest.raises(InputError, match=r"a.npz: holds no rows of numbers \(q \(200×10000, over 64 columns\)\)"):
        read_measurement(tmp_path / "a.npz", ["time_s=q[:,0]"])


@pytest.mark.parametrize("packed", [False, True])
def test_mat_structs(packed, tmp_path):
    path = tmp_path / "a.mat"
    inner = {name: COLUMNS[name] for name in ("current_A", "motor_position_rad")}
    savemat(path, {"rig": {"time_s": COLUMNS["time_s"], "signals": inner, "operator": "x"}}, do_compression=packed)
    assert_same(read_measurement(path))
    # Simulink's "structure with time", mapped by its label
    savemat(path, {"out": {"time": k / 1e3, "signals": {"values": k / 7.0, "label": "theta"}}}, do_compression=packed)
    mapped = read_measurement(path, ["time_s=time[s]", "motor_position_rad=theta"])
    assert_same(mapped, {"time_s": k / 1e3, "motor_position_rad": k / 7.0})
    savemat(path, {"x": {"time_s": k, "duty": k}, "y": {"duty": -k}}, do_compression=packed)
    assert set(read_columns(path)) == {"time_s", "x.duty", "y.duty"}


@pytest.mark.parametrize("dtype", ["f4", "f8", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "?"])
def test_mat_of_other_number_types(dtype, tmp_path):
    savemat(tmp_path / "a.mat", {"time_s": k, "duty": (k % 2).astype(dtype)})
    assert_same(read_measurement(tmp_path / "a.mat"), {"time_s": k, "duty": k % 2})


def test_mat_of_a_big_endian_machine(tmp_path):
    """MATLAB on older machines; written by hand, as no library does so any more."""

    def element(kind, content):
        return kind.to_bytes(4, "big") + len(content).to_bytes(4, "big") + content + bytes(-len(content) % 8)

    def array(name, values):
        shape = np.array([values.size, 1], ">i4").tobytes()
        parts = (
            (6, np.array([6, 0], ">u4").tobytes()),
            (5, shape),
            (1, name.encode()),
            (9, values.astype(">f8").tobytes()),
        )
        return element(14, b"".join(element(*part) for part in parts))

    header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\1\0MI"
    (tmp_path / "a.mat").write_bytes(header + b"".join(array(name, values) for name, values in COLUMNS.items()))
    assert_same(read_measurement(tmp_path / "a.mat"))


def test_older_mat_refused(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, COLUMNS, format="4")
    with pytest.raises(InputError, match=r"not a MATLAB file of version 5 to 7\.3; save it with -v7"):
        read_measurement(path)


def test_an_episode_of_lerobot(tmp_path):
    """As LeRobot 2.1 writes one: lists of fixed length, the joints' names in meta/info.json."""
    path = tmp_path / "data" / "chunk-000" / "episode_000000.parquet"
    path.parent.mkdir(parents=True)
    (tmp_path / "meta").mkdir()
    features = {"action": {"dtype": "float32", "shape": [2], "names": ["hip", "knee"]}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"codebase_version": "v2.1", "features": features}))
    rows = np.column_stack([np.sin(k), np.cos(k)]).astype("f4")
    lists = pa.FixedSizeListArray.from_arrays(pa.array(rows.ravel()), 2)
    columns = {"action": lists, "observation.state": lists, "timestamp": (k / 30.0).astype("f4"), "task_index": k}
    pq.write_table(pa.table(columns), path)
    found = read_columns(path)
    assert list(found) == [
        *("action.hip", "action.knee", "observation.state.0", "observation.state.1", "timestamp", "task_index")
    ]
    np.testing.assert_array_equal(found["action.knee"], rows[:, 1])


def test_gzip_filled_with_zeros_to_whole_blocks(tmp_path):
    """As tapes and block devices give it back, and between parts that were packed one by one."""
    rows = [f"{i / 1e3},{i}\n" for i in range(N)]
    first, second = (gzip.compress("".join(part).encode()) for part in (["time_s,current_A\n", *rows[:70]], rows[70:]))
    (tmp_path / "a.csv.gz").write_bytes(first + bytes(700) + second + bytes(3_000_000))
    measurement = read_measurement(tmp_path / "a.csv.gz")
    np.testing.assert_array_equal(measurement["current_A"], np.arange(N))


@pytest.mark.parametrize("lines", [False, True])
def test_nan_in_json_stands_only_where_it_is_not_used(lines, tmp_path):
    """As Python's json writes what the sensor did not give."""
    columns = {"time_s": k / 1e3, "current_A": np.sin(k), "spare": np.where(k == 3, np.nan, k)}
    rows = [dict(zip(columns, row)) for row in zip(*(values.tolist() for values in columns.values()))]
    text = "\n".join(map(json.dumps, rows)) if lines else json.dumps(rows)
    (tmp_path / "a.json").write_text(text)
    assert np.isnan(read_columns(tmp_path / "a.json")["spare"][3])
    np.testing.assert_array_equal(read_measurement(tmp_path / "a.json")["current_A"], np.sin(k))


def test_a_static_map_needs_no_time(tmp_path):
    path = tmp_path / "map.csv"
    path.write_text("theta_rad,iq_A\n" + "".join(f"{value},{value}\n" for value in k))
    path.with_suffix(".toml").write_text(
        'kind = "map"\n[mapping]\nmotor_position_rad = "theta_rad"\ncurrent_A = "iq_A"\n'
    )
    measurement = read_measurement(path)
    assert measurement.is_map and measurement.samples == N
    np.testing.assert_array_equal(measurement.time_s, k)
