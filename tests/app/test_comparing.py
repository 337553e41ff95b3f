"""The session's part of Compare without a browser: files, mapping, side files, comparisons, stops and failures."""

from __future__ import annotations

import re
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator, shipped
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.files.opened import FILE_BYTES, PAGE_BYTES
from ema_model.recordings import ColumnMapping, MappedColumn, Measurement, read_side_file, side_path, write_measurement
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference
from emaviz.recording import read
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.files import UPLOADED, shipped_actuators


@pytest.fixture(scope="module")
def recording():
    """The Reference Model with cogging, as a rig's sensors would show it."""
    run = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5)
    true = simulate_reference(run, load_actuator(), effects={"cogging_torque": {}})
    return Sensors(current_noise_A=0.2, encoder_bits=12).record(true, seed=1)


def foreign_csv(recording, path):
    """The recording under names and in units of a rig."""
    columns = {
        "t [ms]": 1e3 * recording.time_s,
        "pos_cmd [deg]": np.rad2deg(recording["command_rad"]),
        "output_angle [deg]": np.rad2deg(recording["user_position_rad"]),
        "motor_angle [deg]": np.rad2deg(recording["motor_position_rad"]),
        "iq [mA]": 1e3 * recording["current_A"],
        "channel_7": np.arange(recording.samples) % 7.0,
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path


AXIS = """
[axes]
motor = "linear"
user = "linear"
[controller]
kind = "unknown"
[motor]
force_constant_N_A = 20.0
mass_kg = { value = 2.0, tolerance = 0.2 }
viscous_friction_Ns_m = { value = 3.0, sigma = 2.0 }
static_friction_N = 0.0
dynamic_friction_N = { value = 5.0, sigma = 3.0 }
"""


class Heard:
    """Waits for what a Comparing tells."""

    def __init__(self, comparing):
        self.told, self.opened, self.progress = [], [], []
        self.compared, self.ended = [], []
        comparing.session.events.told.connect(lambda title, text: self.told.append(text))
        comparing.events.opened.connect(self.opened.append)
        comparing.job.progressed.connect(lambda text, *_: self.progress.append(text))
        comparing.events.compared.connect(lambda comparison: self.compared.append(comparison))
        comparing.job.ended.connect(lambda text: None if comparing.job.finished else self.ended.append(text))

    @staticmethod
    def wait(what, count=1, seconds=60.0):
        end = time.monotonic() + seconds
        while len(what) < count:
            assert time.monotonic() < end
            time.sleep(0.01)
        return what[-1]


@pytest.fixture
def comparing(tmp_path):
    folder = DataFolder(tmp_path / "data")
    session = Session(load_actuator(), folder.recordings)
    comparing = Comparing(session, folder)
    yield comparing
    comparing.close()
    session.close()


@pytest.fixture
def heard(comparing):
    return Heard(comparing)


def test_a_measurement_is_refused_by_its_name_in_the_data_folder(tmp_path):
    session = Session(load_actuator(), tmp_path)
    comparing = Comparing(session, DataFolder(tmp_path))
    (comparing.folder.uploads / "broken.csv").write_text("time_s,current_A\n0,1\n0,2\nabc,3\n")
    try:
        with pytest.raises(InputError, match=r"^uploads/broken\.csv: line 4"):
            comparing.measurement("uploads/broken.csv")
    finally:
        comparing.close()
        session.close()


def test_foreign_columns_wait_for_the_user_and_are_remembered(comparing, heard, recording):
    foreign_csv(recording, comparing.folder.uploads / "rig.csv")
    comparing.add("uploads/rig.csv")
    opened = heard.wait(heard.opened)
    assert opened.measurement is None
    guessed = {entry.signal: (entry.column, entry.unit) for entry in opened.mapping.entries}
    assert guessed["current_A"] == ("iq [mA]", "mA") and guessed["time_s"] == ("t [ms]", "ms")
    assert "channel_7" in dict(opened.mapping.unmapped)
    with pytest.raises(InputError, match=r"rig\.csv: its columns are not mapped yet"):
        comparing.compare()

    comparing.use_mapping(opened.name, opened.mapping)
    mapped = heard.wait(heard.opened, 2)
    assert mapped.measurement is not None and mapped.health is not None
    assert np.allclose(mapped.measurement["current_A"], recording["current_A"], atol=1e-6)
    assert np.allclose(mapped.measurement["user_position_rad"], recording["user_position_rad"], atol=1e-9)

    again = Comparing(comparing.session, comparing.folder)
    later = Heard(again)
    again.add("uploads/rig.csv")
    assert later.wait(later.opened).measurement is not None, "the side file is used the next time"
    again.close()


def test_the_page_takes_less_than_the_command_line(comparing, heard, recording, monkeypatch):
    assert PAGE_BYTES < FILE_BYTES
    foreign_csv(recording, comparing.folder.uploads / "rig.csv")
    monkeypatch.setattr("emaviz.session.files.PAGE_BYTES", 1000)
    comparing.add("uploads/rig.csv")
    assert re.search(r"rig\.csv: is [0-9.]+ MB large, over the limit of 0\.001 MB", heard.wait(heard.told))


def test_a_corrected_sign_reaches_the_measurement_and_the_side_file(comparing, heard, recording):
    path = foreign_csv(recording, comparing.folder.uploads / "rig.csv")
    comparing.add("uploads/rig.csv")
    opened = heard.wait(heard.opened)
    entry = opened.mapping.get("current_A")
    comparing.use_mapping(opened.name, opened.mapping.with_entry(replace(entry, sign=-1)))
    mapped = heard.wait(heard.opened, 2)
    assert np.allclose(mapped.measurement["current_A"], -recording["current_A"], atol=1e-6)
    end = time.monotonic() + 10.0
    while not side_path(path).is_file() and time.monotonic() < end:
        time.sleep(0.01)
    assert read_side_file(side_path(path)).mapping.get("current_A").sign == -1


def test_a_mapping_that_does_not_fit_is_told_and_not_remembered(comparing, heard, recording):
    path = foreign_csv(recording, comparing.folder.uploads / "rig.csv")
    comparing.add("uploads/rig.csv")
    opened = heard.wait(heard.opened)
    wrong = ColumnMapping((MappedColumn("time_s", "channel_7"), MappedColumn("current_A", "iq [mA]", "mA")))
    comparing.use_mapping(opened.name, wrong)
    line = heard.wait(heard.told)
    assert "time must increase" in line and "\n" not in line and str(comparing.folder.folder) not in line
    assert not side_path(path).exists()
    assert comparing.opened[opened.name].measurement is None


def coded_csv(recording, path):
    """With a line of channels' codes above that of the names, which looks as much like a header."""
    names = {"t [ms]": 1e3 * recording.time_s, "Soll [°]": np.rad2deg(recording["command_rad"])}
    names["Strom [mA]"] = 1e3 * recording["current_A"]
    table = np.column_stack(list(names.values()))
    header = f"K1;K2;K3\n{';'.join(names)}"
    np.savetxt(path, table, delimiter=";", header=header, comments="", fmt="%.10g", encoding="cp1252")
    return path


def test_a_header_found_wrongly_is_named_and_remembered(comparing, heard, recording):
    path = coded_csv(recording, comparing.folder.uploads / "rig.csv")
    comparing.add("uploads/rig.csv")
    opened = heard.wait(heard.opened)
    assert list(opened.columns) == ["K1", "K2", "K3"] and opened.measurement is None
    assert opened.head.told == "header in line 1, Windows-1252" and opened.head.lines[1].startswith("t [ms];Soll [°]")

    refused = []
    comparing.events.refused.connect(lambda: refused.append(comparing.opened[opened.name]))
    for hints, line in (
        (Hints(100_000), "has no line 100000 among its first; name another header line"),
        (Hints(encoding="utf-16-le"), "no table is seen in it as UTF-16; name another encoding"),
    ):
        comparing.use_layout(opened.name, hints)
        heard.wait(refused, len(refused) + 1)
        assert line in heard.wait(heard.told, len(refused)) and refused[-1] is opened
    assert not side_path(path).exists()

    comparing.use_layout(opened.name, Hints(2))
    read = heard.wait(heard.opened, 2)
    assert list(read.columns) == ["t [ms]", "Soll [°]", "Strom [mA]"] and read.hints == Hints(2)
    assert {entry.signal for entry in read.mapping.entries} >= {"time_s", "current_A"}
    mapping = [MappedColumn("time_s", "t [ms]", "ms"), MappedColumn("command_rad", "Soll [°]", "deg")]
    comparing.use_mapping(read.name, ColumnMapping((*mapping, MappedColumn("current_A", "Strom [mA]", "mA"))))
    mapped = heard.wait(heard.opened, 3)
    assert np.allclose(mapped.measurement["current_A"], recording["current_A"], atol=1e-6)
    assert mapped.hints == Hints(2)

    again = Comparing(comparing.session, comparing.folder)
    later = Heard(again)
    again.add("uploads/rig.csv")
    assert later.wait(later.opened).measurement is not None, "the side file is used the next time"
    assert np.allclose(again.measurement("uploads/rig.csv")["current_A"], recording["current_A"], atol=1e-6)
    again.use_layout("uploads/rig.csv", Hints())
    assert list(later.wait(later.opened, 2).columns) == ["K1", "K2", "K3"]
    again.close()


def test_a_side_file_of_another_layout_is_corrected(comparing, heard, recording):
    path = comparing.folder.uploads / "run.csv"
    write_measurement(recording, path)
    side_path(path).write_text("[text]\nheader_line = 2\nencoding = 'utf-16'\n")
    comparing.add("uploads/run.csv")
    opened = heard.wait(heard.opened)
    assert opened.problem == "has no line 2 among its first; name another header line"
    assert opened.head.lines[0].startswith("time_s,")
    comparing.use_layout(opened.name, Hints())
    assert heard.wait(heard.opened, 2).measurement is not None


def test_columns_without_names_and_without_a_time_are_said_on_the_page(comparing, heard, recording):
    table = np.column_stack([np.rad2deg(recording["command_rad"]), recording["current_A"]])
    np.savetxt(comparing.folder.uploads / "bare.txt", table)
    comparing.add("uploads/bare.txt")
    opened = heard.wait(heard.opened)
    assert list(opened.columns) == ["#1", "#2"] and "columns by number" in opened.head.told
    comparing.use_layout(opened.name, Hints(rate_Hz=1000.0))
    assert heard.wait(heard.opened, 2).hints.rate_Hz == 1000.0
    mapping = ColumnMapping((MappedColumn("command_rad", "#1", "deg"), MappedColumn("current_A", "#2")))
    comparing.use_mapping(opened.name, mapping)
    found = heard.wait(heard.opened, 3).measurement
    np.testing.assert_allclose(np.diff(found.time_s), 1e-3)
    np.testing.assert_allclose(found["current_A"], recording["current_A"])
    comparing.use_layout(opened.name, Hints(rate_Hz=500.0))
    again = heard.wait(heard.opened, 4).measurement
    np.testing.assert_allclose(np.diff(again.time_s), 2e-3)
    np.testing.assert_allclose(again["current_A"], recording["current_A"])


def test_a_text_without_a_table_is_there_to_look_at(comparing, heard):
    (comparing.folder.uploads / "note.csv").write_text("What was measured\non Monday\n")
    comparing.add("uploads/note.csv")
    opened = heard.wait(heard.opened)
    assert opened.problem and not opened.columns and opened.head.lines == ("What was measured", "on Monday")
    with pytest.raises(InputError, match=r"note\.csv: its table was not found; say under Columns"):
        comparing.compare()
    comparing.choose_actuator(comparing.session.actuator.name)
    comparing.use_layout("uploads/note.csv", Hints(1))
    assert "line 1: no table begins there" in heard.wait(heard.told)


def test_canonical_names_need_no_mapping(comparing, heard, recording):
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    opened = heard.wait(heard.opened)
    assert opened.measurement is not None and opened.health.findings
    assert set(comparing.signals_available()) == {
        *("current_A", "motor_position_rad", "user_position_rad", "motor_speed_rad_s"),
    }


def test_a_bad_file_is_one_line_and_nothing_is_lost(comparing, heard, recording):
    write_measurement(recording, comparing.folder.uploads / "good.csv")
    comparing.add("uploads/good.csv")
    heard.wait(heard.opened)
    (comparing.folder.uploads / "bad.csv").write_text("time_s,current_A\n0,1\n1e-3,x\n" + "2e-3,1\n" * 200)
    for name in ("uploads/bad.csv", "../outside.csv", "uploads/none.csv"):
        count = len(heard.told)
        comparing.add(name)
        line = heard.wait(heard.told, count + 1)
        assert "\n" not in line and name.split("/")[-1] in line
    assert list(comparing.opened) == ["uploads/good.csv"]


def test_a_comparison_names_the_motors_angle(comparing, heard, recording):
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    assert comparing.compare()
    assert not comparing.compare(), "one at a time"
    comparison = heard.wait(heard.compared)
    assert heard.progress and not heard.told
    assert not comparison.adequate
    assert comparison.explained_by[0].variable == "motor_angle"
    assert comparing.comparison is comparison and not comparing.running
    comparing.calibrate = False
    comparing.set_window(0.1, 0.4)
    assert comparing.compare(), "the compute thread is free once the end is told"
    second = heard.wait(heard.compared, 2)
    assert second.calibration is None
    assert second.recordings[0].time_s[-1] < 0.41


def test_a_comparison_is_kept_as_report_and_recording(comparing, heard, recording):
    kept = []
    comparing.events.kept.connect(kept.append)
    comparing.save(".html")
    assert "nothing is compared yet" in heard.wait(heard.told)
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    assert comparing.compare()
    comparison = heard.wait(heard.compared)
    comparing.save(".html")
    comparing.save(".rrd")
    heard.wait(kept, 2)
    report, record = sorted(kept, key=lambda path: path.suffix)
    assert report.parent == record.parent == comparing.folder.recordings
    assert comparison.recordings[0].name in report.read_text(encoding="utf-8")
    assert set(read(record).signals) >= {"measurement", "monitor", "residual"}


def test_stop_ends_it_soon_and_keeps_the_last_result(comparing, heard, recording):
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    begun = threading.Event()
    comparing.job.progressed.connect(lambda *_: begun.set())
    assert comparing.compare()
    assert begun.wait(30.0)
    comparing.job.stop()
    assert heard.wait(heard.ended, seconds=20.0) == "Stopped."
    assert not heard.told and not comparing.session.worker.busy
    assert comparing.compare()
    comparing.job.stop()
    heard.wait(heard.ended, 2)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda c: c.weights.clear(), "no signal to fit is chosen"),
        (lambda c: c.free.clear(), "no parameter may move"),
        (lambda c: c.set_window(8.0, 9.0), "no sample lies in the chosen window"),
        (lambda c: c.set_window(1.0, 0.5), "must start before it ends"),
        (lambda c: c.set_window("x", 0.5), "the window's start must be a number"),
        (lambda c: c.set_free("motor.magic", True), "gives it no tolerance"),
        (lambda c: c.set_weight("time_s", 1.0), "is not compared"),
        (lambda c: c.choose_actuator("../../etc/passwd"), "no such file in the data folder"),
        (lambda c: c.choose_actuator("uploaded: nothing.toml"), "no such file in the data folder"),
    ],
)
def test_what_makes_no_sense_is_one_line(comparing, heard, recording, change, line):
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    with pytest.raises(InputError, match=line) as caught:
        change(comparing)
        comparing.compare()
    assert "\n" not in str(caught.value)
    assert not comparing.session.worker.busy


def test_nothing_to_compare_is_told(comparing):
    with pytest.raises(InputError, match="no measurement is chosen"):
        comparing.compare()


def test_actuators_come_with_the_app_or_by_upload(comparing):
    assert load_actuator().name in comparing.actuators()
    assert set(shipped_actuators()) <= set(comparing.actuators())
    text = shipped("thesis.toml").replace('name = "Thesis EMA"', 'name = "Rig two"')
    (comparing.folder.actuators / "rig.toml").write_text(text, encoding="utf-8")
    name = f"{UPLOADED}actuators/rig.toml"
    assert name in comparing.actuators()
    comparing.choose_actuator(name)
    assert comparing.actuator.name == "Rig two"
    (comparing.folder.actuators / "rig.toml").write_text("name = 3\n[motor]\n", encoding="utf-8")
    with pytest.raises(InputError):
        comparing.choose_actuator(name)
    assert comparing.actuator.name == "Rig two"


def test_another_actuators_axes_are_those_of_the_measurement(comparing, heard, recording):
    """The recording's own names stay: what is opened for a rotary axis serves a linear one as well."""
    text = shipped("odrive.toml").split("[controller]")[0] + AXIS
    (comparing.folder.actuators / "axis.toml").write_text(text, encoding="utf-8")
    own = {"time_s": recording.time_s, "current_A": recording["current_A"]}
    way = 1e-3 * recording["motor_position_rad"]
    write_measurement(Measurement({**own, "motor_position_m": way}), comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    assert comparing.signals_available() == ["current_A"]
    comparing.choose_actuator(f"{UPLOADED}actuators/axis.toml")
    assert comparing.signals_available() == ["current_A", "motor_position_rad"]
    assert np.array_equal(comparing.opened["uploads/run.csv"].measurement["motor_position_rad"], way)
    assert "motor_position_rad" not in comparing.measurement("uploads/run.csv"), "the app's own axis is rotary"


def test_a_side_files_actuator_outside_the_data_folder_is_left_alone(comparing, heard, recording, tmp_path):
    text = shipped("thesis.toml").replace('name = "Thesis EMA"', 'name = "Elsewhere"')
    (tmp_path / "elsewhere.toml").write_text(text, encoding="utf-8")
    path = comparing.folder.uploads / "run.csv"
    write_measurement(recording, path)
    side_path(path).write_text('schema = 1\nactuator = "../../elsewhere.toml"\n')
    comparing.add("uploads/run.csv")
    assert "outside the data folder" in heard.wait(heard.told)
    assert heard.opened[0].measurement is not None
    assert comparing.actuator.name == load_actuator().name


def test_a_side_file_that_is_a_link_outside_is_refused(comparing, heard, recording, tmp_path):
    (tmp_path / "secret.toml").write_text("schema = 1\n")
    path = comparing.folder.uploads / "run.csv"
    write_measurement(recording, path)
    side_path(path).symlink_to(tmp_path / "secret.toml")
    comparing.add("uploads/run.csv")
    assert "leads out of the data folder" in heard.wait(heard.told)


def test_a_recording_is_taken_off_the_list_and_its_file_stays(comparing, heard, recording):
    write_measurement(recording, comparing.folder.uploads / "run.csv")
    comparing.add("uploads/run.csv")
    heard.wait(heard.opened)
    comparing.remove("uploads/run.csv")
    comparing.remove("uploads/run.csv")
    assert not comparing.opened and (comparing.folder.uploads / "run.csv").is_file()
