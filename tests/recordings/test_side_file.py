"""The side file: what it says reaches the measurement; written and read back; one for a whole folder;
and what is wrong with one, in one line."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ema_model.actuator import load_actuator, parse_actuator, save_actuator, shipped
from ema_model.campaign import load_plan
from ema_model.errors import InputError
from ema_model.recordings import (
    ColumnMapping,
    MappedColumn,
    SideFile,
    change_side_file,
    find_side_file,
    read_side_file,
    side_path,
    write_side_file,
)
from ema_model.recordings.formats.text_layout import ENCODINGS, Hints
from ema_model.recordings.read import read_measurement
from ema_model.recordings.side_file import SENSOR_KEYS

N = 600
TEXT = """
actuator = "../actuators/rig.toml"
sampling = "mean"
segments = [0, 2]
[window]
from_s = 0.05
[sensors]
current_noise_A = 0.02
motor_position_step_rad = 1.5e-3
[mapping]
time_s = "t[ms]"
current_A = { column = "i", unit = "mA", sign = -1, offset = 0.5 }
segment = "run"
"""


def log(path, header="t,i,run"):
    path.write_text(f"{header}\n" + "".join(f"{k % 200},{k},{k // 200}\n" for k in range(N)))
    return path


def test_what_it_says_reaches_the_measurement(tmp_path):
    path = log(tmp_path / "a.csv")
    side_path(path).write_text(TEXT)
    measurement = read_measurement(path)
    side = measurement.side
    assert side.actuator == "../actuators/rig.toml" and side.sampling == "mean" and side.kind == "run"
    assert side.actuator_path == str(tmp_path / "../actuators/rig.toml")
    assert side.sensors == {"current_noise_A": 0.02, "motor_position_step_rad": 1.5e-3}
    assert measurement.samples == 300 and len(measurement.runs) == 2  # of 200 each, from 50 ms on
    assert measurement.time_s[0] == 0.05 and set(measurement["segment"]) == {0.0, 2.0}
    np.testing.assert_allclose(measurement["current_A"][:2], [0.45, 0.449])
    assert "the side file a.toml is used" in measurement.notes


def test_a_byte_order_mark_is_no_part_of_toml(tmp_path):
    """Windows' editors write one; what is read is the same, and it goes when the file is changed."""
    mark = "\ufeff"
    path = log(tmp_path / "a.csv")
    side_path(path).write_text(mark + TEXT, encoding="utf-8")
    side = read_side_file(side_path(path))
    assert side.sampling == "mean" and read_measurement(path).samples == 300
    change_side_file(side_path(path), side, window_s=(0.1, 0.2))
    assert not side_path(path).read_text(encoding="utf-8").startswith(mark)
    assert 'current_A = { column = "i"' in side_path(path).read_text(encoding="utf-8")
    actuator = tmp_path / "b.toml"
    text = "# mine\n" + shipped("odrive.toml")
    actuator.write_text(mark + text, encoding="utf-8")
    assert load_actuator(actuator) == replace(parse_actuator(text, actuator), text="")
    save_actuator(load_actuator(actuator), actuator)
    assert actuator.read_text(encoding="utf-8").startswith("# mine\n")
    (tmp_path / "c.toml").write_text(mark + "x = 1", encoding="utf-8")
    with pytest.raises(InputError, match=r"c\.toml: has no 'x'"):
        load_plan(tmp_path / "c.toml")


def test_given_entries_go_before(tmp_path):
    path = log(tmp_path / "a.csv")
    side_path(path).write_text(TEXT)
    measurement = read_measurement(path, ["current_A=i[A]"])
    assert measurement["current_A"][0] == 50.0 and measurement.time_s[0] == 0.05
    assert read_measurement(path, ["time_s=t[s]", "segment=run"], side=SideFile()).samples == N


def test_one_for_a_folder(tmp_path):
    first, second = log(tmp_path / "first.csv"), log(tmp_path / "second.csv", "t,amps,run")
    assert find_side_file(first) is None
    with pytest.raises(InputError, match="no column time_s"):
        read_measurement(first)
    shared = tmp_path / "recordings.toml"
    shared.write_text(TEXT)
    assert find_side_file(first) == shared
    measurement = read_measurement(first)
    assert measurement.samples == 300 and measurement.side.path == str(shared)
    assert "the side file recordings.toml is used" in measurement.notes
    with pytest.raises(InputError, match=r"second\.csv: no column 'i' for current_A, which recordings\.toml asks for"):
        read_measurement(second)
    # Its own goes before it, and nothing of the folder's is mixed in.
    side_path(second).write_text('[mapping]\ntime_s = "t[ms]"\ncurrent_A = "amps"\nsegment = "run"\n')
    measurement = read_measurement(second)
    assert find_side_file(second) == side_path(second)
    assert measurement.samples == N and measurement.side.actuator is None and measurement.side.sensors == {}
    # Folders below are others.
    (tmp_path / "below").mkdir()
    assert find_side_file(log(tmp_path / "below" / "first.csv")) is None


def test_what_is_no_file_is_no_side_file(tmp_path):
    path = log(tmp_path / "a.csv", "time_s,current_A,segment")
    (tmp_path / "a.toml").mkdir()
    assert read_measurement(path).side == SideFile()


def test_a_texts_layout_is_said(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("A;B\ntime_s;iq [mA]\n" + "".join(f"{k / 1e3};{k}\n" for k in range(N)))
    side_path(path).write_text('[text]\nheader_line = 2\n[mapping]\ncurrent_A = { column = "iq [mA]", unit = "mA" }\n')
    assert read_measurement(path)["current_A"][-1] == pytest.approx((N - 1) / 1e3)
    with pytest.raises(InputError, match=r"no column 'iq \[mA\]' for current_A"):
        read_measurement(path, hints=Hints(header_line=1))
    # A folder's stands beside recordings that are no texts, too.
    np.save(tmp_path / "b.npy", np.zeros(N, [("time_s", float), ("current_A", float)]))
    (tmp_path / "recordings.toml").write_text("[text]\nheader_line = 2\n")
    with pytest.raises(InputError, match="time must increase"):
        read_measurement(tmp_path / "b.npy")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("header_line = 0", r"\[text\] header_line must be the number of a line, from 1 on, not 0"),
        ("header_line = true", "header_line must be"),
        ('encoding = "klingon"', r"\[text\] encoding 'klingon' is none; write utf-8, cp1252 or utf-16"),
        ("encoding = 8", "encoding '8' is none"),
        ("row = 1", r"\[text\] unknown entry 'row'"),
    ],
)
def test_a_layout_that_makes_no_sense_is_refused(tmp_path, text, line):
    (tmp_path / "a.toml").write_text(f"[text]\n{text}\n")
    with pytest.raises(InputError, match=line):
        read_side_file(tmp_path / "a.toml")


names = st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=20)
finite = st.floats(allow_nan=False, allow_infinity=False)
sized = st.floats(-1e30, 1e30).filter(lambda value: value != 0.0)
entries = st.lists(
    st.builds(
        MappedColumn,
        st.sampled_from(["current_A", "phase_a_current_A", "phase_b_current_A"]),
        names,
        st.sampled_from(["", "mA", "kA"]),
        st.sampled_from([1, -1]),
        sized,
        st.floats(-1e30, 1e30),
    ),
    min_size=1,
    max_size=3,
    unique_by=lambda entry: entry.signal,
)
side_files = st.builds(
    SideFile,
    actuator=st.none() | st.sampled_from(["rig.toml", "../a b/ä\"'.toml"]),
    kind=st.sampled_from(["run", "map"]),
    sampling=st.sampled_from([None, "mean", "instantaneous"]),
    mapping=st.none() | entries.map(lambda found: ColumnMapping(tuple(found))),
    sensors=st.dictionaries(st.sampled_from(SENSOR_KEYS), st.floats(0.0, 1e300), max_size=4),
    window_s=st.none() | st.tuples(finite, finite).filter(lambda pair: pair[0] < pair[1]),
    segments=st.none() | st.lists(st.integers(-(2**53), 2**53), min_size=1, max_size=4).map(tuple),
    text=st.builds(Hints, st.none() | st.integers(1, 2**53), st.sampled_from([None, *ENCODINGS])),
)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(side_files)
def test_written_and_read_back(tmp_path, side):
    """Over whatever was there before, with somebody's comments in it."""
    path = tmp_path / "a.toml"
    if path.exists():
        path.write_text(f"# of the bench\n{path.read_text(encoding='utf-8')}# the end\n", encoding="utf-8")
    write_side_file(side, path)
    again = read_side_file(path)
    assert again.path == str(path)
    for name in ("actuator", "kind", "sampling", "sensors", "window_s", "segments", "text"):
        assert getattr(again, name) == getattr(side, name)
    found, wanted = ({one.signal: one for one in (m.entries if m else ())} for m in (again.mapping, side.mapping))
    assert found == wanted
    path.write_text(path.read_text(encoding="utf-8").replace("# of the bench\n", ""), encoding="utf-8")


def test_a_window_open_at_one_end(tmp_path):
    for window in ((0.5, np.inf), (-np.inf, 2.0)):
        write_side_file(SideFile(window_s=window), tmp_path / "a.toml")
        assert read_side_file(tmp_path / "a.toml").window_s == window


def test_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "a.toml"
    write_side_file(SideFile(sampling="mean"), path)
    before = path.read_bytes()

    def full(*_args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match=r"a\.toml: cannot be written \(No space left on device\)"):
        write_side_file(SideFile(), path)
    monkeypatch.undo()
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["a.toml"]
    with pytest.raises(InputError, match="cannot be written"):
        write_side_file(SideFile(), tmp_path / "none" / "a.toml")


def sides(actuator):
    return f"actuator = {json.dumps(actuator)}"


SIDE_FILES = {
    "no_toml": ("actuator = ", "is not valid TOML"),
    "binary": (b"\xff\xfe\x00", "is not text in UTF-8"),
    "too_large": ("# " + "x" * 200_000, "over the limit of 0.1 MB"),
    "deep": ("x = " + "[" * 20_000, "is not valid TOML"),
    "many_digits": ("schema = " + "9" * 5000, "too many digits"),
    "many_hexadecimal_digits": ("schema = 0x" + "f" * 5000, "too many digits"),
    "entry": ("actuater = 'a.toml'", "unknown entry 'actuater'; correct or remove it (known: schema, actuator, kind"),
    "schema": ("schema = 2", "schema 2 is not known"),
    "kind": ("kind = 'curve'", 'kind must be "run" or "map", not \'curve\''),
    "kind_number": ("kind = 1", "kind must be"),
    "sampling": ("sampling = 'slow'", 'sampling must be "mean" or "instantaneous"'),
    "actuator_number": ("actuator = 1", "actuator must be the name of an actuator file"),
    "actuator_absolute": (sides("/etc/secret.toml"), "must be given from the side file's folder"),
    "actuator_on_a_drive": (sides("C:\\secret.toml"), "must be given from the side file's folder"),
    "actuator_no_toml": (sides("../../etc/passwd"), "actuator must be the name of an actuator file"),
    "actuator_with_zero": (sides("a\0.toml"), "actuator must be the name of an actuator file"),
    "sensor": ("[sensors]\nnoise = 1", "[sensors] unknown entry 'noise'; correct or remove it"),
    "sensor_negative": ("[sensors]\ncurrent_noise_A = -1", "must be a number of 0 or more"),
    "sensor_text": ("[sensors]\ncurrent_noise_A = 'low'", "[sensors] current_noise_A must be a number"),
    "sensor_nan": ("[sensors]\ncurrent_noise_A = nan", "must be a number"),
    "sensor_infinite": ("[sensors]\ncurrent_noise_A = inf", "must be finite"),
    "sensor_huge": ("[sensors]\nencoder_bits = 1" + "0" * 400, "must be below 2⁵³"),
    "sensors_no_table": ("sensors = 1", "sensors must be a table"),
    "window_order": ("[window]\nfrom_s = 2\nto_s = 1", "from_s (2) must be before to_s (1)"),
    "window_entry": ("[window]\nstart = 2", "[window] unknown entry 'start'"),
    "window_text": ("[window]\nfrom_s = 'a'", "[window] from_s must be a number"),
    "window_beyond": ("[window]\nfrom_s = 99", "no sample lies in the chosen window"),
    "window_short": ("[window]\nto_s = 0.01", "has 11 samples; 100 or more are expected"),
    "segments_text": ("segments = 'all'", "segments must be a list of whole numbers"),
    "segments_none": ("segments = []", "segments must be a list of whole numbers"),
    "segments_huge": ("segments = [1" + "0" * 400 + "]", "segments must be a list of whole numbers"),
    "segments_absent": ("segments = [0]", "column segment is needed"),
    "signal": ("[mapping]\nspeed = 'x'", "no signal 'speed'"),
    "column_absent": ("[mapping]\nduty = 'x'", "no column 'x' for duty, which a.toml asks for"),
    "column_number": ("[mapping]\nduty = 1", "a column's name or a table is expected"),
    "column_unnamed": ("[mapping]\nduty = {unit = '%'}", "the column's name is missing"),
    "column_list": ("[mapping]\nduty = {column = ['x']}", "column must be text"),
    "column_entry": ("[mapping]\nduty = {column = 'x', factor = 2}", "unknown entry 'factor'"),
    "unit": ("[mapping]\ncurrent_A = {column = 'current_A', unit = 'furlong'}", "the unit 'furlong' is not known"),
    "sign": ("[mapping]\ncurrent_A = {column = 'current_A', sign = 0.5}", "the sign must be 1 or -1"),
    "sign_bool": ("[mapping]\ncurrent_A = {column = 'current_A', sign = true}", "sign must be a number"),
    "scale": ("[mapping]\ncurrent_A = {column = 'current_A', scale = 0}", "the scale not 0"),
    "scale_huge": ("[mapping]\ncurrent_A = {column = 'current_A', scale = 1e300}", "numbers up to 1e30"),
}


@pytest.mark.parametrize("kind", SIDE_FILES)
def test_side_file_refused(kind, tmp_path):
    content, fact = SIDE_FILES[kind]
    path = tmp_path / "a.csv"
    path.write_text("time_s,current_A\n" + "".join(f"{k / 1000},{k}\n" for k in range(120)))
    side_path(path).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        read_measurement(path)
    message = str(caught.value)
    assert fact in message and message.isprintable() and message.startswith((f"{path}: ", f"{side_path(path)}: "))
