"""Round trips, and files that appear whole or not at all."""

from __future__ import annotations

import os
import stat

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ema_model.errors import InputError
from ema_model.recordings import SIGNALS, Measurement, write_measurement
from ema_model.recordings.formats import WRITTEN
from ema_model.recordings.read import LARGEST, read_measurement

N = 120
each_format = pytest.mark.parametrize("suffix", sorted(WRITTEN))
finite = st.floats(-LARGEST, LARGEST)


def measured(**signals):
    return Measurement({"time_s": np.arange(N) / 1e4, **signals})


@each_format
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=st.lists(finite, min_size=1, max_size=8), start=st.floats(-1e3, 1e3))
def test_round_trip_is_exact(suffix, tmp_path, values, start):
    path = tmp_path / f"run 1{suffix}"
    written = Measurement({"time_s": start + np.arange(N) / 1e4, "current_A": np.resize(values, N), "duty": np.ones(N)})
    write_measurement(written, path)
    read = read_measurement(path)
    assert list(read) == list(written) and read.name == "run 1"
    for name in written:
        np.testing.assert_array_equal(read[name], written[name])


@each_format
def test_every_signal_round_trips(suffix, tmp_path):
    values = {name: np.arange(N) / 7 for name in SIGNALS} | {"drive_enabled": np.ones(N), "segment": np.arange(N) // 50}
    write_measurement(Measurement(values), tmp_path / f"a{suffix}")
    read = read_measurement(tmp_path / f"a{suffix}")
    assert list(read) == list(SIGNALS)
    assert all(np.array_equal(read[name], values[name]) for name in SIGNALS)


def test_csv_text_and_parquet_metadata(tmp_path):
    write_measurement(measured(current_A=np.full(N, 0.1), segment=np.zeros(N)), tmp_path / "a.csv")
    assert (tmp_path / "a.csv").read_bytes().startswith(b"time_s,current_A,segment\n0,0.1,0\n0.0001,0.1,0\n")
    write_measurement(measured(), tmp_path / "a.parquet")
    assert pq.read_schema(tmp_path / "a.parquet").metadata == {b"emaviz_schema": b"1"}


@each_format
def test_failure_leaves_the_old_file(suffix, tmp_path, monkeypatch):
    path = tmp_path / f"a{suffix}"
    write_measurement(measured(duty=np.ones(N)), path)
    before = path.read_bytes()

    def full(*_args, **_kw):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match=r"cannot be written \(No space left on device\)"):
        write_measurement(measured(), path)
    monkeypatch.undo()
    assert path.read_bytes() == before and os.listdir(tmp_path) == [path.name]
    write_measurement(measured(), path)
    assert list(read_measurement(path)) == ["time_s"] and os.listdir(tmp_path) == [path.name]


def test_a_writer_that_breaks_off_leaves_nothing(tmp_path, monkeypatch):
    def broken(table, file, *_args):
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("pyarrow.csv.write_csv", broken)
    with pytest.raises(KeyboardInterrupt):
        write_measurement(measured(), tmp_path / "a.csv")
    assert os.listdir(tmp_path) == []


def test_links_and_rights_are_kept_as_for_any_new_file(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "real" / "a.csv")
    write_measurement(measured(), tmp_path / "link.csv")
    assert (tmp_path / "link.csv").is_symlink()
    (tmp_path / "plain").write_text("")
    mode = stat.S_IMODE((tmp_path / "plain").stat().st_mode)
    assert stat.S_IMODE((tmp_path / "real" / "a.csv").stat().st_mode) == mode


@pytest.mark.parametrize(
    ("name", "fact"),
    {
        "a.xls": "the suffix '.xls' is not known; a measurement ends in .csv or .parquet",
        "a": "the name has no suffix",
        "none/a.csv": "there is no folder",
        "folder.csv": "is a folder",
        "pipe.csv": "not a regular file",
    }.items(),
)
def test_places_that_cannot_be_written(name, fact, tmp_path):
    (tmp_path / "folder.csv").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(InputError) as caught:
        write_measurement(measured(), tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: ") and fact in str(caught.value)
    assert sorted(os.listdir(tmp_path)) == ["folder.csv", "pipe.csv"]


def test_values_no_reader_takes_are_not_written(tmp_path):
    with pytest.raises(InputError, match="sample 4, column 'duty': NaN"):
        write_measurement(measured(duty=np.where(np.arange(N) == 3, np.nan, 1.0)), tmp_path / "a.csv")
    assert os.listdir(tmp_path) == []
