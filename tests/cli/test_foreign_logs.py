"""Twelve logs as foreign rigs write them, opened by `emaviz compare FILE --actuator …` with no option more."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
from support.foreign_files import FILES as WRITERS
from support.mat_structs import write_dspace, write_simulink
from support.servo_logs import SERVO_SIGNALS, duty_of, write_servo_log

from ema_model import comparison
from ema_model.actuator import load_actuator, shipped
from ema_model.commands import command
from ema_model.simulation.run import Run, simulate_reference
from emaviz.cli import main

# Names and units as the maker's manual or a public log has them: signal → column, and SI of one of its units.
ENGLISH = {
    "time_s": ("t [s]", 1.0),
    "command_rad": ("target position [deg]", np.pi / 180.0),
    "user_position_rad": ("actual position [deg]", np.pi / 180.0),
    "motor_speed_rad_s": ("motor speed [rpm]", np.pi / 30.0),
    "current_A": ("iq [mA]", 1e-3),
}
SNAKE = {  # where a format has no units, people put them into the names (PX4's and ROS's messages do not, but are SI)
    "time_s": ("t", 1.0),
    "command_rad": ("position_setpoint_rad", 1.0),
    "user_position_rad": ("output_position_rad", 1.0),
    "motor_speed_rad_s": ("motor_velocity_rad_s", 1.0),
    "current_A": ("motor_current_A", 1.0),
}
GERMAN = {
    "time_s": ("Zeit", "ms", 1e-3),
    "command_rad": ("Sollwinkel", "°", np.pi / 180.0),
    "user_position_rad": ("Abtriebswinkel", "°", np.pi / 180.0),
    "motor_speed_rad_s": ("Motordrehzahl", "1/min", np.pi / 30.0),
    "current_A": ("Strom", "mA", 1e-3),
}


@pytest.fixture(scope="module")
def run():
    return simulate_reference(Run(command("chirp", {}), 0.3), load_actuator())


def renamed(run, names):
    return {column: np.array(run[signal]) / si for signal, (column, si) in names.items()}


def german_rows(run, separator):
    table = np.column_stack([run[signal] / si for signal, (_, _, si) in GERMAN.items()])
    return [separator.join(f"{value:.9g}" for value in row).replace(".", ",") for row in table]


def diadem(path, run):
    """NI DIAdem, "Exporting ASCII files": names in one row, units in the next; Windows-1252, decimal comma."""
    names, units = (";".join(part[i] for part in GERMAN.values()) for i in (0, 1))
    lines = ["Prüfer;Müller", "Prüfstand;Aktor 3", "", names, units, *german_rows(run, ";")]
    path.write_bytes("\r\n".join(lines).encode("cp1252"))


def excel(path, run):
    """Excel's "Unicode text": UTF-16 with a mark, tabs."""
    names = "\t".join(f"{name} [{unit}]" for name, unit, _ in GERMAN.values())
    path.write_bytes("\r\n".join([names, *german_rows(run, "\t")]).encode("utf-16"))


def twincat(path, run):
    """Beckhoff TwinCAT 3 Scope (TE13xx manual, "Export to CSV"): a preamble of names and values, then the table."""
    head = ["Name\tScope Project", "File\tC:\\Messung.svdx", "Starttime of export\t133", "Endtime of export\t134", ""]
    names = "\t".join(f"{name} [{unit}]" for name, unit, _ in GERMAN.values())
    path.write_bytes("\r\n".join([*head, names, *german_rows(run, "\t"), "", "EOF"]).encode("cp1252"))


def bam(path, run):
    """Rhoban/bam, bam/xl330/record.py: see support.servo_logs."""
    write_servo_log(path, {signal: np.array(run[signal])[::10] for signal in SERVO_SIGNALS}, kp=400)


def simulink(path, run):
    columns = renamed(run, SNAKE)
    write_simulink(path, columns.pop("t"), columns)


def dspace(path, run):
    """As ControlDesk's users name signals: by the block's own name, with its unit."""
    named = {
        "command_rad": ("PosSetpoint", "deg", np.pi / 180.0),
        "user_position_rad": ("OutputPosition", "deg", np.pi / 180.0),
        "motor_speed_rad_s": ("MotorSpeed", "rpm", np.pi / 30.0),
        "current_A": ("MotorCurrent", "A", 1.0),
    }
    signals = {name: (unit, np.array(run[signal]) / si) for signal, (name, unit, si) in named.items()}
    write_dspace(path, {"HostService": (np.array(run["time_s"]), signals)})


def by_writer(kind, names):
    return lambda path, run: WRITERS[kind][1](path, renamed(run, names))


LOGS = {  # name: ending, writer, actuator
    "h5py": (".h5", by_writer("hdf5", ENGLISH), "thesis"),
    "MATLAB 7.3": (".mat", by_writer("mat 7.3", SNAKE), "thesis"),
    "Simulink": (".mat", simulink, "thesis"),
    "dSPACE": (".mat", dspace, "thesis"),
    "LabVIEW TDMS": (".tdms", by_writer("tdms", ENGLISH), "thesis"),
    "CANape MDF4": (".mf4", by_writer("mdf", ENGLISH), "thesis"),
    "PX4 ULog": (".ulg", by_writer("ulog", SNAKE), "thesis"),
    "ROS 2 MCAP": (".mcap", by_writer("mcap", SNAKE), "thesis"),
    "Rerun": (".rrd", by_writer("rerun", SNAKE), "thesis"),
    "NumPy": (".npy", by_writer("npy", SNAKE), "thesis"),
    "DIAdem": (".csv", diadem, "thesis"),
    "Excel": (".txt", excel, "thesis"),
    "TwinCAT": (".csv", twincat, "thesis"),
    "bam": (".json", bam, "xl330"),
    "JSON lines": (".jsonl", by_writer("json records", ENGLISH), "thesis"),
    "packed CSV": (".csv.gz", by_writer("gzip", SNAKE), "thesis"),
}


NEEDED = {
    ".h5": ["h5py"],
    ".mat": ["h5py"],
    ".tdms": ["nptdms"],
    ".mf4": ["asammdf"],
    ".ulg": ["pyulog"],
    ".mcap": ["mcap"],
}


class Seen(Exception):
    """What came in; ends the command there."""


@pytest.mark.parametrize("name", LOGS)
def test_opened_with_no_option(name, run, tmp_path, monkeypatch, capsys):
    ending, write, actuator = LOGS[name]
    for library in NEEDED.get(ending, ()):
        pytest.importorskip(library)
    path = tmp_path / f"log{ending}"
    write(path, run)
    (tmp_path / "mine.toml").write_text(shipped(f"{actuator}.toml"), encoding="utf-8")

    def look(given, *_, **__):
        raise Seen(given)

    monkeypatch.setattr(comparison, "compare", look)
    with pytest.raises(Seen) as seen:
        main(["compare", str(path), "--actuator", str(tmp_path / "mine.toml")])
    (found,) = seen.value.args[0]
    step = 10 if name == "bam" else 1
    for signal in ("time_s", "command_rad", "user_position_rad", "motor_speed_rad_s"):
        wanted = np.array(run[signal])[::step]
        # Logs begin at their first sample.
        np.testing.assert_allclose(found[signal], wanted, atol=2e-5 * np.ptp(wanted), err_msg=signal)
    if name == "bam":
        np.testing.assert_allclose(found["duty"], duty_of(found, 400), atol=1.0 / 885)
    told = capsys.readouterr().err
    assert told.count("\n") <= 1
    if name == "DIAdem":
        assert told.startswith("log.csv: header in line 4, units in line 5, Windows-1252; time_s from Zeit [ms], ")


def test_the_layout_may_be_said(run, tmp_path, capsys):
    path = tmp_path / "log.csv"
    diadem(path, run)
    assert main(["compare", str(path), "--header-line", "1"]) == 2
    assert "line 1: no table begins there" in capsys.readouterr().err
    (tmp_path / "log.npy").write_bytes(b"x")
    assert main(["compare", str(tmp_path / "log.npy"), "--encoding", "cp1252"]) == 2
    assert "is NumPy array, no text; leave --header-line and --encoding out" in capsys.readouterr().err
    assert main(["compare", str(path), "--encoding", "klingon"]) == 2
    assert "klingon is no encoding" in capsys.readouterr().err


def test_a_reader_that_is_not_installed_is_told_with_its_command(tmp_path, monkeypatch, capsys):
    import importlib.util

    (tmp_path / "a.h5").write_bytes(gzip.compress(b"x"))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["compare", str(tmp_path / "a.h5")]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "read with h5py, which is not installed: pip install 'emaviz[rigs]'" in told
