"""CSV as instruments and tools write it, each in the shape that its maker's manual or a public file shows."""

from __future__ import annotations

import gzip
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.errors import InputError
from ema_model.recordings import SideFile, read, read_columns, read_head, read_side_file
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.read import read_header, read_measurement
from ema_model.recordings.side_file import write_side_file

N = 240
k = np.arange(N)
TIME, ANGLE, CURRENT = k / 1e3, np.sin(k / 40.0), 1234.5 * np.cos(k / 40.0)


def german(value, digits=6):
    return f"{value:.{digits}f}".replace(".", ",")


def grouped(value, thousands, decimal):
    return f"{value:,.3f}".replace(",", "?").replace(".", decimal).replace("?", thousands)


def rows(separator, *columns):
    return [separator.join(cells) for cells in zip(*columns)]


def text(value):
    return f"{value:.6f}"


PLAIN = [list(map(text, column)) for column in (TIME, ANGLE, CURRENT)]
GERMAN = [list(map(german, column)) for column in (TIME, ANGLE, CURRENT)]
STAMPS = [f"01.05.2024 23:59:{59 + i // 1000:02d},{i % 1000:03d}" for i in range(N)]

# name: content, encoding, what is told, header
FILES = {
    # Tektronix 4 series programmer's manual, SAVe:WAVEform: model, labels, then TIME and channels
    "tektronix": (
        ["Model,MSO44", "Firmware Version,1.28.7", "", "Waveform Type,ANALOG", "Record Length,240",
         "Sample Interval,1e-3", "", "", "TIME,CH1,CH2", *rows(",", *PLAIN)],
        "utf-8", "header in line 9", ["TIME", "CH1", "CH2"],
    ),
    # Keysight InfiniiVision: "x-axis,1,2" and "second,Volt,Volt" above the numbers
    "keysight": (
        ["x-axis,1,2", "second,Volt,Volt", *rows(",", *PLAIN)],
        "utf-8", "units in line 2", ["x-axis time [second]", "1 [Volt]", "2 [Volt]"],
    ),
    # LabVIEW .lvm: NI, "Specification for the LabVIEW Measurement File (.lvm)"
    "labview": (
        ["LabVIEW Measurement\t", "Writer_Version\t2", "Separator\tTab", "***End_of_Header***\t", "\t",
         "Channels\t2\t\t", "Samples\t240\t240\t", "***End_of_Header***\t\t\t", "X_Value\tAngle\tCurrent\tComment",
         *(line + "\t" for line in rows("\t", *PLAIN))],
        "utf-8", "header in line 9", ["X_Value", "Angle", "Current", "Comment"],
    ),
    # TwinCAT 3 Scope View, CSV export: name and file, then names, then numbers; tabs, German Windows
    "beckhoff": (
        ["Name\tScope Project", "File\tC:\\Messung\\Prüfstand.svdx", "Starttime of export\t133", "",
         "Zeit [ms]\tIstwinkel [°]\tStrom [mA]", *rows("\t", *GERMAN)],
        "cp1252", "header in line 5, Windows-1252", ["Zeit [ms]", "Istwinkel [°]", "Strom [mA]"],
    ),
    # Excel, "Unicode text": UTF-16 with a mark, tabs
    "excel": (["Zeit [s]\tWinkel [°]\tStrom [mA]", *rows("\t", *GERMAN)], "utf-16", "UTF-16",
              ["Zeit [s]", "Winkel [°]", "Strom [mA]"]),
    # DIAdem, ASCII export with name and unit in a row each; decimal comma
    "diadem": (
        ["Prüfer;Müller", "Datum;01.05.2024", "", "Zeit;Winkel;Strom", "s;°;mA", *rows(";", *GERMAN)],
        "cp1252", "header in line 4, units in line 5, Windows-1252", ["Zeit [s]", "Winkel [°]", "Strom [mA]"],
    ),
    # Excel's "sep=" line, thousands set off by points
    "thousands": (
        ["sep=;", "t [s];Winkel [rad];Strom [mA]",
         *rows(";", GERMAN[0], GERMAN[1], [grouped(value, ".", ",") for value in CURRENT])],
        "utf-8", "header in line 2, thousands set off by points", ["t [s]", "Winkel [rad]", "Strom [mA]"],
    ),
    # WinCC / TIA data log (Siemens, "Structure of a *.csv file with data"): stamps of date and time
    "siemens": (
        ["Datum und Uhrzeit;Winkel;Strom", *rows(";", STAMPS, *GERMAN[1:])],
        "utf-8", "", ["Datum und Uhrzeit [s]", "Winkel", "Strom"],
    ),
}  # fmt: skip


def written(folder, lines, encoding, ending="\r\n"):
    path = folder / "run.csv"
    path.write_bytes((ending.join(lines) + ending).encode(encoding))
    return path


@pytest.mark.parametrize("kind", FILES)
def test_found_and_told(kind, tmp_path):
    lines, encoding, told, header = FILES[kind]
    path = written(tmp_path, lines, encoding)
    columns = read_columns(path)
    assert read_header(str(path), 10_000_000) == header
    names = [name for name in header if name != "Comment"]
    assert list(columns) == names
    for name, values in zip(names, (TIME, ANGLE, CURRENT)):
        np.testing.assert_allclose(columns[name], values, atol=6e-4)
    measurement = read_measurement(path, [f"time_s={names[0]}[s]", f"current_A={names[2]}[mA]"])
    assert measurement.reading.layout == told


def test_a_header_again_and_text_at_the_end(tmp_path):
    lines = ["t [s];iq [A]", *rows(";", PLAIN[0][:100], PLAIN[1][:100])]
    lines += ["t [s];iq [A]", *rows(";", PLAIN[0][100:], PLAIN[1][100:]), "", "Messung beendet", "Operator;Miller"]
    measurement = read_measurement(written(tmp_path, lines, "utf-8"), ["time_s=t [s]", "current_A=iq [A]"])
    np.testing.assert_allclose(measurement["current_A"], ANGLE, atol=1e-6)
    assert "the header is repeated 1 times; those lines are left out" in measurement.notes
    assert "2 lines of text below the numbers left out" in measurement.notes


def test_what_is_wrong_amid_the_numbers_is_told_with_its_line(tmp_path):
    lines = list(FILES["diadem"][0])
    lines[60] = "0,055;abc;1,0"
    with pytest.raises(InputError, match=r"line 61, column 'Winkel': a number is expected, found 'abc'"):
        read_measurement(written(tmp_path, lines, "cp1252"), ["time_s=Zeit [s]", "command_rad=Winkel [°]"])
    lines[60] = "0,055;1"
    with pytest.raises(InputError, match=r"line 61: 2 cells where the header has 3"):
        read_measurement(written(tmp_path, lines, "cp1252"), ["time_s=Zeit [s]", "command_rad=Winkel [°]"])


def test_a_time_for_each_channel(tmp_path):
    """As loggers with a buffer for each channel export: the slower one is shorter, its cells below are blank."""
    slow = np.arange(N // 4) * 4e-3
    cells = [[text(value) for value in column] + [""] * (N - len(column)) for column in (slow, np.sin(slow * 25.0))]
    lines = ["t [s];angle [rad];t [s];current [A]", *rows(";", PLAIN[0], PLAIN[1], *cells)]
    path = written(tmp_path, lines, "utf-8")
    measurement = read_measurement(path, ["time_s=t [s]", "command_rad=angle [rad]", "current_A=current [A]"])
    assert measurement.samples == N - 3
    np.testing.assert_allclose(measurement["current_A"], np.sin(measurement.time_s * 25.0), atol=2e-3)
    assert any("each with a time of its own, brought onto one linearly" in note for note in measurement.notes)


def test_a_said_layout_goes_before_what_is_found(tmp_path):
    lines = ["a;b", "1;2", "3;4", "5;6", "t;iq", *rows(";", *PLAIN[:2])]
    path = written(tmp_path, lines, "cp1252")
    assert read_header(str(path), 10_000_000) == ["t", "iq"]
    assert read_header(str(path), 10_000_000, Hints(1)) == ["a", "b"]
    with pytest.raises(InputError, match="line 244: no table begins there"):
        read_header(str(path), 10_000_000, Hints(240 + 4))
    with pytest.raises(InputError, match=r"no table is seen in it as UTF-16; name another encoding"):
        read_header(str(path), 10_000_000, Hints(encoding="utf-16-le"))


def test_names_that_are_numbers_are_a_header_where_somebody_says_so(tmp_path):
    path = written(tmp_path, ["Rig;7", "", "1;2", *rows(";", *PLAIN[:2])], "utf-8")
    with pytest.raises(InputError, match="line 1: names of columns are expected, found Rig, 7"):
        read_columns(path)
    columns = read_columns(path, hints=Hints(3))
    assert list(columns) == ["1", "2"]
    np.testing.assert_allclose(columns["2"], ANGLE, atol=1e-6)


@pytest.mark.parametrize("packed", [False, True])
def test_the_first_lines_are_shown_as_they_stand(tmp_path, packed):
    lines, encoding, told, _ = FILES["diadem"]
    path = written(tmp_path, lines, encoding)
    if packed:
        path = tmp_path / "run.csv.gz"
        path.write_bytes(gzip.compress((tmp_path / "run.csv").read_bytes()))
    head = read_head(path)
    assert list(head.lines) == lines and head.told == told
    assert read_head(path, hints=Hints(encoding="cp850")).lines[0] != lines[0]
    plain = read_head(written(tmp_path, ["t,x", *rows(",", *PLAIN[:2])], "utf-8"))
    assert plain.told == "header in line 1" and plain.lines[0] == "t,x"
    np.save(tmp_path / "run.npy", TIME)
    assert read_head(tmp_path / "run.npy") is None


BARE = {
    "commas": rows(",", *PLAIN),
    "blanks, in columns": [f"  {a:>12}   {b:>12} {c:>14} " for a, b, c in zip(*PLAIN)],
    "numpy.savetxt": [" ".join(f"{value:.18e}" for value in row) for row in zip(TIME, ANGLE, CURRENT)],
    "tabs, below comments": ["# made by a rig", "", *rows("\t", *PLAIN)],
    "semicolons and decimal commas": rows(";", *GERMAN),
    "a time of day": rows(";", STAMPS, *PLAIN[1:]),
}


@pytest.mark.parametrize("ends", ["\n", "\r\n"])
@pytest.mark.parametrize("layout", BARE)
def test_columns_without_names_are_taken_by_number(layout, ends, tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(ends.join([*BARE[layout], ""]).encode())
    assert [name.partition(" ")[0] for name in read_header(str(path), 10_000_000)] == ["#1", "#2", "#3"]
    found = read_measurement(path, ["time_s=#1", "motor_position_rad=#2[deg]", "current_A=#3"])
    np.testing.assert_allclose(found.time_s, TIME, atol=1e-6)
    np.testing.assert_allclose(found["motor_position_rad"], np.radians(ANGLE), atol=1e-6)
    np.testing.assert_allclose(found["current_A"], CURRENT, atol=1e-5)
    assert "no line of names, columns by number" in found.reading.layout


def test_a_bad_cell_below_no_header_is_told_with_its_line(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([*BARE["commas"][:100], "0.1,off,2", *BARE["commas"][100:]]))
    with pytest.raises(InputError, match="line 101, column '#2': a number is expected, found 'off'"):
        read_measurement(path, ["time_s=#1", "motor_position_rad=#2"])
    with pytest.raises(InputError, match=r"line 1: names of columns are expected, found numbers; .* 'time_s=#1'"):
        read_measurement(path)
    with pytest.raises(InputError, match=r"no column '#4' for current_A"):
        read_measurement(path, ["time_s=#1", "current_A=#4"])


def test_columns_with_names_between_blanks(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("\n".join(["# t[s]    q   i_A", *BARE["blanks, in columns"]]))
    found = read_measurement(path, ["time_s=t[s]", "motor_position_rad=q", "current_A=#3"])
    np.testing.assert_allclose(found["current_A"], CURRENT, atol=1e-5)
    assert "columns are separated by blanks" in found.notes


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_the_rate_of_a_file_without_a_time_is_said(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    if suffix == ".csv":
        path.write_text("\n".join(["angle,current_A", *rows(",", *PLAIN[1:])]))
    else:
        np.savez(path, angle=ANGLE, current_A=CURRENT)
    mapping = ["motor_position_rad=angle"]
    with pytest.raises(InputError, match=r"no column time_s; .* or give the --rate of a file without one"):
        read_measurement(path, mapping)
    found = read_measurement(path, mapping, hints=Hints(rate_Hz=500.0))
    np.testing.assert_allclose(found.time_s, k / 500.0)
    assert "time_s counts the samples at 500 Hz, as was said" in found.notes
    path.with_suffix(".toml").write_text("rate_Hz = 250.0\n")
    np.testing.assert_allclose(read_measurement(path, mapping).time_s, k / 250.0)
    np.testing.assert_allclose(read_measurement(path, mapping, hints=Hints(rate_Hz=500.0)).time_s, k / 500.0)
    thesis = load_actuator()
    blind = replace(thesis, controller=replace(thesis.controller, kind="unknown"))
    np.testing.assert_allclose(read(path, blind, [*mapping, "current_A=current_A"]).time_s, k / 250.0)
    with pytest.raises(InputError, match="time_s stands in column 'angle'; leave the rate out, or that column"):
        read_measurement(path, ["time_s=angle"])


def test_a_side_file_says_the_rate_and_keeps_it(tmp_path):
    path = tmp_path / "a.toml"
    write_side_file(SideFile(text=Hints(rate_Hz=500.0)), path)
    assert read_side_file(path).text == Hints(rate_Hz=500.0)
    for wrong in ("0", "-3", "'fast'", "true"):
        path.write_text(f"rate_Hz = {wrong}\n")
        with pytest.raises(InputError, match="rate_Hz must be a number"):
            read_side_file(path)


VESC = "ms_today;input_voltage;temp_mos_max;temp_mos_1;temp_mos_2;temp_mos_3;temp_motor;current_motor;current_in;" \
       "d_axis_current;q_axis_current;erpm;duty_cycle;amp_hours_used;amp_hours_charged;watt_hours_used;" \
       "watt_hours_charged;tachometer;tachometer_abs;encoder_position;fault_code;vesc_id;d_axis_voltage;" \
       "q_axis_voltage;ms_today_setup;"  # fmt: skip


def test_a_vesc_tool_log_is_named_and_read(tmp_path):
    """Its columns as vesc_tool's vescinterface.cpp writes them, each with a semicolon after it."""
    names = VESC.rstrip(";").split(";")
    table = {name: np.zeros(N) for name in names}
    table |= {"ms_today": 36_000_000.0 + 10.0 * k, "q_axis_current": CURRENT, "current_motor": np.abs(CURRENT),
              "erpm": 7.0 * 300.0 * np.cos(k / 30.0), "duty_cycle": 0.3 + 0.0 * k, "input_voltage": 24.0 + 0.0 * k,
              "encoder_position": 10.0 * k % 360.0}  # fmt: skip
    lines = [";".join(f"{value:.8g}" for value in row) + ";" for row in zip(*table.values())]
    (tmp_path / "a.csv").write_text("\n".join([VESC, *lines]))
    thesis = load_actuator()
    blind = replace(thesis, controller=replace(thesis.controller, kind="unknown"))
    with pytest.raises(InputError, match=r"motor_position_rad is needed; .* this is a VESC Tool log; its erpm is"):
        read(tmp_path / "a.csv", blind)
    asked = ["motor_position_rad=encoder_position[deg]", "motor_speed_rad_s=erpm[rpm, scale=0.142857142857]"]
    found = read(tmp_path / "a.csv", blind, asked)
    assert "this is a VESC Tool log" in found.reading.told
    np.testing.assert_allclose(np.diff(found.time_s), 0.01, atol=1e-9)
    np.testing.assert_allclose(found["current_A"], CURRENT, rtol=1e-6)
    np.testing.assert_allclose(found["motor_speed_rad_s"], 10.0 * np.pi * np.cos(k / 30.0), atol=1e-4)
    np.testing.assert_allclose(found["motor_position_rad"], np.radians(10.0 * k), atol=1e-9)


def test_columns_of_the_simplefoc_monitor_are_named(tmp_path):
    table = [ANGLE, 0.1 * ANGLE, 0.0 * ANGLE, CURRENT, 0.0 * CURRENT, np.gradient(ANGLE, TIME), ANGLE]
    (tmp_path / "a.txt").write_text("\n".join("\t".join(f"{value:.4f}" for value in row) for row in zip(*table)))
    with pytest.raises(InputError, match=r"current q and d \[mA\], .*, if this is all that SimpleFOC's monitor prints"):
        read(tmp_path / "a.txt", load_actuator())
    found = read_measurement(
        tmp_path / "a.txt", ["current_A=#4[mA]", "motor_position_rad=#7"], hints=Hints(rate_Hz=1000.0)
    )
    np.testing.assert_allclose(found["current_A"], CURRENT / 1e3, atol=1e-6)


def test_one_number_a_line_is_named(tmp_path):
    (tmp_path / "oscilloscope.csv").write_text("\n".join(map(str, ANGLE)))
    with pytest.raises(InputError, match=r"line 1: .*; of one number a line, as odrivetool's oscilloscope_dump writes"):
        read_measurement(tmp_path / "oscilloscope.csv")


@pytest.mark.parametrize("separator", [",", "\t", " ", ", "])
def test_lines_of_the_arduino_plotter_have_their_labels_for_names(separator, tmp_path):
    """By arduino/Arduino, ArduinoSerialPlotterProtocol.md: a colon between label and value, or labels alone above."""
    labels = ("t_ms", "angle", "i_A")
    rows_of = [separator.join(f"{name}:{value:.6f}" for name, value in zip(labels, row)) + separator.rstrip()
               for row in zip(1e3 * TIME, ANGLE, CURRENT)]  # fmt: skip
    above = [separator.join(f"{name}:" for name in labels), *rows(separator, *PLAIN)]
    mapping = ["motor_position_rad=angle", "current_A=i_A"]
    (tmp_path / "a.txt").write_text("\r\n".join(rows_of))
    assert read_header(str(tmp_path / "a.txt"), 10**6) == list(labels)
    found = read_measurement(tmp_path / "a.txt", ["time_s=t_ms", *mapping])
    assert "a label before each number" in found.reading.layout
    np.testing.assert_allclose(found.time_s, TIME, atol=1e-6)
    np.testing.assert_allclose(found["current_A"], CURRENT, atol=1e-5)
    (tmp_path / "b.txt").write_text("\n".join(above))
    np.testing.assert_allclose(read_measurement(tmp_path / "b.txt", ["time_s=t_ms[s]", *mapping]).time_s, TIME)
