"""Every file that is refused, with its line; odd files that are good."""

from __future__ import annotations

import os
from time import perf_counter

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ema_model.errors import InputError
from ema_model.quantities import lookalikes
from ema_model.recordings import SIGNALS, Measurement, check_needed, write_measurement
from ema_model.recordings.formats import WRITTEN
from ema_model.recordings.health import health
from ema_model.recordings.read import read_measurement

N = 120


def rows(count=N, separator=",", end="\n"):
    return [f"{k / 1000:.3f}{separator}{k}{separator}{-k / 2}{end}" for k in range(count)]


def text(header="time_s,current_A,duty", lines=None, **changed):
    """A CSV file; changed={'line_7': "…"} puts another text in that line."""
    lines = [header + "\n", *(rows() if lines is None else lines)]
    for where, line in changed.items():
        lines[int(where.removeprefix("line_")) - 1] = line + "\n"
    return "".join(lines)


def made(name="", **columns):
    return Measurement({key: np.asarray(values, np.float64) for key, values in columns.items()}, name)


def refused(path, **kw):
    """The message, which must be one line that starts with the file as given."""
    with pytest.raises(InputError) as caught:
        read_measurement(path, **kw)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and message.isprintable() and len(message) < 500 + len(str(path))
    assert caught.value.__cause__ is None
    return message


GARBAGE = bytes(range(256)) * 10
CSV_REFUSALS = {
    "empty": ("", ["is empty"]),
    "only_blanks": (" \n\n", ["is empty", "header line"]),
    "only_header": (text(lines=[]), ["0 samples", "100 or more"]),
    "only_header_cut": (text(lines=[]).rstrip("\n"), ["0 samples", "100 or more"]),
    "short": (text(lines=rows(99)), ["99 samples", "100 or more"]),
    "binary": (GARBAGE, ["is not text (neither UTF-8"]),
    "no_header": ("".join(rows()), ["line 1", "names of columns", "header line"]),
    "ragged_short": (text(line_50="0.048,1"), ["line 50", "2 cells", "header has 3"]),
    "ragged_long": (text(line_50="0.048,1,2,3"), ["line 50", "4 cells", "header has 3"]),
    "ragged_after_blank_line": (text(line_9="", line_50="0.048"), ["line 50", "1 cell where"]),
    "decimal_comma": (text(line_2="0,1,2,3,4,5"), ["line 2", "6 cells", "decimal point"]),
    "text": (text(line_7="0.005,much,2"), ["line 7", "'current_A'", "'much'", "a number is expected"]),
    "long_text": (text(line_7="0.005," + "x" * 90 + ",2"), ["line 7", "'current_A'", "x…'"]),
    "text_of_types": (text(line_2="real,real,int"), ["line 2", "'time_s'", "'real'"]),
    "text_after_quotes": (text(line_3='"0.001","1","ä"'), ["line 3", "'duty'", "'ä'"]),
    "underscore": (text(line_3="0.001,1_000,2"), ["line 3", "'1_000'"]),
    "nan": (text(line_90="0.088,nan,2"), ["line 90", "'current_A'", "NaN", "finite"]),
    "infinite": (text(line_90="0.088,1,-inf"), ["line 90", "'duty'", "infinite"]),
    "overflow": (text(line_90="0.088,1e999,1"), ["line 90", "'current_A'", "infinite"]),
    "nan_after_blank_line": (text(line_5="", line_90="0.088,nan,2"), ["line 90", "'current_A'"]),
    "NA": (text(line_4="0.002,NA,2"), ["line 4", "'current_A'", "'NA'"]),
    "blank": (text(line_11="0.009,,2"), ["line 11", "'current_A'", "blank"]),
    "blank_of_spaces": (text(line_11="0.009,1,  "), ["line 11", "'duty'", "blank"]),
    "no_time": (text("x,current_A,duty"), ["no column time_s", "present: x, current_A, duty"]),
    "time_unnamed": (text("time,current_A,duty"), ["'time' looks like time", "name it time_s"]),
    "time_t_s": (text("t_s,current_A,duty"), ["'t_s' looks like time"]),
    "time_ms": (text("time_ms,current_A,duty"), ["'time_ms' looks like time", "in seconds"]),
    "time_capital": (text("Time [s],current_A,duty"), ["'Time [s]' looks like time"]),
    "time_repeats": (text(line_60="0.057,58,1"), ["line 60", "'time_s'", "0.057 follows 0.057", "must increase"]),
    "time_falls": (text(line_60="0.001,58,1"), ["line 60", "0.001 follows 0.057"]),
    "twice": (text("time_s,current_A,current_A"), ["'current_A' stands twice"]),
    "twice_foreign": (text("time_s,x,x"), ["'x' stands twice"]),
    "current": (text("time_s,current,duty"), ["'current' looks like current_A"]),
    "current_mA": (text("time_s,current_mA,duty"), ["'current_mA' looks like current_A", "convert"]),
    "speed": (text("time_s,speed,duty"), ["'speed'", "motor_speed_rad_s"]),
    "rpm": (text("time_s,Motor speed (rpm),duty"), ["motor_speed_rad_s"]),
    "user_position": (text("time_s,user_position,duty"), ["user_position_rad", "user_position_m"]),
    "segment_fraction": (text("time_s,segment,duty", line_4="0.002,1.5,1"), ["line 4", "'segment'", "whole"]),
    "enabled_2": (text("time_s,drive_enabled,x", line_2="0,1,1"), ["line 4", "'drive_enabled'", "0 or 1", "found 2"]),
}


@pytest.mark.parametrize("name", CSV_REFUSALS)
def test_csv_refused(name, tmp_path):
    content, facts = CSV_REFUSALS[name]
    path = tmp_path / f"{name}.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    message = refused(path)
    for fact in facts:
        assert fact in message


def test_no_file_to_read(tmp_path, monkeypatch):
    assert "no such file" in refused(tmp_path / "missing.csv")
    assert "is a folder" in refused(tmp_path)
    assert "File name too long" in refused("x" * 260 + ".csv")
    with pytest.raises(InputError, match=r"a␀b\.csv: cannot be read"):
        read_measurement("a\0b.csv")
    (tmp_path / "a.csv").write_text(text())
    assert "no such file" in refused(tmp_path / "a.csv" / "b.csv")
    os.mkfifo(tmp_path / "pipe.csv")
    assert "not a regular file" in refused(tmp_path / "pipe.csv")
    for name, fact in {"a.xlsx": "'.xlsx' is not known", "a": "no suffix", ".csv": "no such"}.items():
        if name != ".csv":
            (tmp_path / name).write_text(text())
        assert fact in refused(tmp_path / name)
    assert "over the limit of 0.001 MB" in refused(tmp_path / "a.csv", max_bytes=1000)
    monkeypatch.chdir(tmp_path)
    os.mkdir("b.csv")
    assert "is a folder" in refused("b.csv")


@pytest.mark.parametrize("suffix", sorted(WRITTEN))
def test_no_permission(suffix, tmp_path, monkeypatch):
    def denied(*_args, **_kw):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / f"a{suffix}"
    path.write_text(text())
    monkeypatch.setattr("builtins.open", denied)
    assert "cannot be read (Permission denied)" in refused(path)


def parquet(path, **changed):
    columns = {"time_s": np.arange(N) / 1000, "current_A": np.arange(float(N)), **changed}
    table = pa.table({name: values for name, values in columns.items() if values is not None})
    pq.write_table(table, path)
    return path


def with_value(value, at=6):
    return [value if k == at else float(k) for k in range(N)]


PARQUET_REFUSALS = {
    "text": ({"current_A": ["much"] * N}, ["'current_A'", "string", "numbers are expected"]),
    "nan": ({"current_A": with_value(float("nan"))}, ["row 7", "'current_A'", "NaN"]),
    "null": ({"current_A": with_value(None)}, ["row 7", "'current_A'", "blank"]),
    "time_falls": ({"time_s": with_value(3.0)}, ["row 7", "3.0 follows 5.0"]),
    "no_time": ({"time_s": None}, ["no column time_s"]),
    "timestamp": ({"time_s": pa.array(range(N), pa.timestamp("ms"))}, ["'time_s'", "timestamp[ms]"]),
    "speed": ({"speed": [0.0] * N}, ["motor_speed_rad_s"]),
    "short": ({"time_s": [1.0], "current_A": [2.0]}, ["1 sample;"]),
}


@pytest.mark.parametrize("name", PARQUET_REFUSALS)
def test_parquet_refused(name, tmp_path):
    changed, facts = PARQUET_REFUSALS[name]
    message = refused(parquet(tmp_path / "a.parquet", **changed))
    for fact in facts:
        assert fact in message


def test_damaged_parquet_refused(tmp_path):
    whole = parquet(tmp_path / "whole.parquet").read_bytes()
    path = tmp_path / "a.parquet"
    for damaged in (whole[:-20], whole[:200], GARBAGE, text().encode(), whole[:4] + whole[60:]):
        path.write_bytes(damaged)
        assert "is not a whole Parquet file" in refused(path)
    twice = pa.Table.from_arrays([pa.array(np.arange(N) / 1.0)] * 2, names=["time_s", "time_s"])
    pq.write_table(twice, path)
    assert "'time_s' stands twice" in refused(path)
    newer = pa.table({"time_s": np.arange(N) / 1.0}).replace_schema_metadata({"emaviz_schema": "2"})
    pq.write_table(newer, path)
    assert "emaviz_schema 2 is not known" in refused(path)
    pq.write_table(pa.table({"time_s": np.zeros(1_000_000)}), path)
    assert "unpacks to 8 MB" in refused(path, max_bytes=100_000)


@pytest.mark.parametrize("suffix", sorted(WRITTEN))
def test_flipped_bytes_never_give_another_error(suffix, tmp_path):
    path, rng = tmp_path / f"a{suffix}", np.random.default_rng(0)
    write_measurement(made(time_s=np.arange(N) / 1e3, current_A=np.arange(N)), path)
    whole = np.frombuffer(path.read_bytes(), np.uint8)
    for _ in range(300):
        damaged = whole.copy()
        damaged[rng.integers(0, whole.size, 3)] = rng.integers(0, 256, 3)
        path.write_bytes(damaged.tobytes())
        try:
            read_measurement(path)
        except InputError as error:
            assert str(error).isprintable()


def test_foreign_file_name_stays_on_one_line(tmp_path):
    path = tmp_path / "a\nb.csv"
    path.write_text(text(line_7="0.005,a\tb\x07,2"))
    with pytest.raises(InputError) as caught:
        read_measurement(path)
    assert str(caught.value).isprintable() and "a␊b.csv: line 7" in str(caught.value)


GOOD = {
    "plain": text().encode(),
    "bom": text().encode("utf-8-sig"),
    "crlf": text().replace("\n", "\r\n").encode(),
    "old_mac": text().replace("\n", "\r").encode(),
    "semicolons": text().replace(",", ";").encode(),
    "tabs": text().replace(",", "\t").encode(),
    "decimal_commas": text().replace(",", ";").replace(".", ",").encode(),
    "quotes": text('"time_s","current_A","duty"', line_4='"0.002","2","-1.0"').encode(),
    "spaces": text(" time_s , current_A,duty ", line_4=" 0.002 , 2 , -1").encode(),
    "blank_lines": ("\n\n" + text() + "\n\n").encode(),
    "no_last_line_end": text().rstrip("\n").encode(),
    "foreign_columns": text(
        "note ä,time_s,,current_A,current_mA,duty",
        [f"x;,{k / 1000},,{k},?,{-k / 2}\n" for k in range(N)],
    ).encode(),
}


@pytest.mark.parametrize("name", GOOD)
def test_odd_but_good_csv(name, tmp_path):
    path = tmp_path / "a.CSV"
    path.write_bytes(GOOD[name])
    measurement = read_measurement(str(path))
    k = np.arange(N)
    assert sorted(measurement) == ["current_A", "duty", "time_s"] and measurement.name == "a"
    np.testing.assert_array_equal(measurement["time_s"], k / 1000)
    np.testing.assert_array_equal(measurement["current_A"], k)
    np.testing.assert_array_equal(measurement["duty"], -k / 2)
    notes = " ".join(measurement.notes)
    expected = {"semicolons": "semicolons", "tabs": "tabs", "decimal_commas": "decimal comma"}
    expected["foreign_columns"] = "left aside, as their names are not known: note ä, current_mA"
    assert expected[name] in notes if name in expected else notes == ""


def test_jitter_is_noted_and_segments_start_anew(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text(line_60="0.05825,58,1"))
    measurement = read_measurement(path)
    assert not measurement.is_uniform
    assert measurement.notes == ("samples lie up to 25 % of a period off a regular grid; the median step is 0.001 s",)
    path.write_text(text("time_s,segment", [f"{k % 60},{k // 60}\n" for k in range(N)]))
    assert read_measurement(path).is_uniform
    path.write_text(text("time_s,segment", [f"{k % 60},{k // 50}\n" for k in range(N)]))
    assert "line 62" in refused(path)


def test_parquet_of_other_number_types(tmp_path):
    path = parquet(
        tmp_path / "a.parquet",
        current_A=pa.array(range(N), pa.float32()),
        segment=pa.array([2**60] * N, pa.int64()),
        drive_enabled=[True] * N,
        label=["x"] * N,
    )
    measurement = read_measurement(path)
    assert all(values.dtype == np.float64 for values in measurement.signals.values())
    assert measurement["drive_enabled"].all() and measurement["current_A"][7] == 7.0
    assert measurement.notes == ("left aside, as their names are not known: label",)


def test_needed_columns():
    k = np.arange(N)
    measurement = made("bench 3", time_s=k / 1e3, current_A=k * 0.0, duty=k)
    check_needed(measurement, "duty")
    with pytest.raises(InputError, match=r"bench 3: column 'current_A' is constant \(0\)"):
        check_needed(measurement, "duty", "current_A")
    with pytest.raises(
        InputError, match=r"bench 3: column user_position_rad is needed.*present: time_s, current_A, du"
    ):
        check_needed(measurement, "user_position_rad")
    with pytest.raises(InputError, match="is empty"):
        check_needed(made(time_s=[]), "time_s")


def test_canonical_names_are_their_own_lookalikes():
    for name, signal in SIGNALS.items():
        assert signal.name == name and name in lookalikes(name)
        assert name in lookalikes(name.upper())
    for foreign in ("current_reference_A", "phase", "mode", "a", "m", "", "t"):
        assert lookalikes(foreign) == ()


# --- a large recording, of every format, is read in 4 s and its health card made in 1 s -------------------------------


@pytest.mark.study
@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".npz", ".mat"])
def test_a_million_samples(suffix, tmp_path):
    time = np.arange(1_000_000) / 10_000.0
    rng = np.random.default_rng(13)
    names = "command_rad user_position_rad motor_position_rad motor_speed_rad_s current_A bus_voltage_V temperature_C"
    signals = {name: np.round(np.sin((1.0 + i) * time) + 0.01 * rng.normal(size=time.size), 6) for i, name in
               enumerate(names.split())}  # fmt: skip
    write_measurement(Measurement({"time_s": time, **signals}), tmp_path / f"a{suffix}")
    seconds = []
    for _ in range(3):
        began = perf_counter()
        measurement = read_measurement(tmp_path / f"a{suffix}")
        between = perf_counter()
        assert health(measurement).findings
        seconds.append((between - began, perf_counter() - between))
    reading, checking = np.median(seconds, axis=0)
    print(f"{suffix}: read in {reading:.2f} s, health in {checking:.2f} s")
    assert len(measurement.signals) == 8 and reading <= 4.0 and checking <= 1.0
