"""HDF5, MATLAB, JSON and TDMS whose channels, or groups of them, have times of their own: brought onto one clock."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.io import savemat
from support.mat_structs import write_dspace

from ema_model.errors import InputError
from ema_model.recordings import read_columns
from ema_model.recordings.health import health
from ema_model.recordings.read import read_header, read_measurement

POSITION, SPEED = "motor_position_rad", "motor_speed_rad_s"
DELAY = 0.005
FAST, SLOW = np.arange(3000) * 1e-3, np.arange(1000) * 3e-3


def angle(time):
    return np.sin(7.0 * time) + 0.4 * np.sin(19.0 * time + 1.0)


def speed(time):
    return 7.0 * np.cos(7.0 * time) + 7.6 * np.cos(19.0 * time + 1.0)


LATE = speed(SLOW - DELAY)
GROUPS = {"encoder": {"t": FAST, "angle": angle(FAST)}, "drive": {"t": SLOW, "speed": LATE}}
FLAT = {"t_angle": FAST, "motor_angle": angle(FAST), "t_speed": SLOW, "motor_speed": LATE}


def hdf5(path, groups, userblock=0, cls=None):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for group, columns in groups.items():
            for name, values in columns.items():
                data = values[None, :] if cls else values
                file.create_dataset(f"{group}/{name}", data=data).attrs.update(cls or {})


def h5_groups(folder):
    hdf5(folder / "a.h5", GROUPS)
    return folder / "a.h5"


def h5_flat(folder):
    hdf5(folder / "a.h5", {"rig": FLAT})
    return folder / "a.h5"


def mat_structs(folder):
    savemat(folder / "a.mat", {"log": GROUPS, "kp": 3.0, "who": "me"})
    return folder / "a.mat"


def mat_flat(folder):
    savemat(folder / "a.mat", FLAT, oned_as="column")
    return folder / "a.mat"


def mat_73(folder):
    path = folder / "a.mat"
    hdf5(path, {f"log/{name}": group for name, group in GROUPS.items()}, 512, {"MATLAB_class": np.bytes_("double")})
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    return path


def npz_flat(folder):
    np.savez(folder / "a.npz", **FLAT)
    return folder / "a.npz"


def json_columns(folder):
    (folder / "a.json").write_text(json.dumps({n: {k: v.tolist() for k, v in g.items()} for n, g in GROUPS.items()}))
    return folder / "a.json"


def json_records(folder):
    streams = {
        name: [dict(zip(group, row)) for row in zip(*(values.tolist() for values in group.values()))]
        for name, group in GROUPS.items()
    }
    (folder / "a.json").write_text(json.dumps(streams))
    return folder / "a.json"


def tdms(folder):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(folder / "a.tdms") as file:
        parts = [(group, name, values) for group, columns in GROUPS.items() for name, values in columns.items()]
        file.write_segment([nptdms.ChannelObject(*part) for part in parts])
    return folder / "a.tdms"


@pytest.mark.parametrize(
    "write", [h5_groups, h5_flat, mat_structs, mat_flat, mat_73, npz_flat, json_columns, json_records, tdms]
)
def test_each_channel_has_its_own_time(write, tmp_path):
    path = write(tmp_path)
    time, position, rate = sorted(read_header(str(path), 10**9), key=lambda name: ("speed" in name, "angle" in name))
    assert time == "time" and "angle" in position and "speed" in rate
    measurement = read_measurement(path, [f"time_s={time}[s]", f"{POSITION}={position}[rad]", f"{SPEED}={rate}[rad/s]"])
    np.testing.assert_allclose(measurement.time_s, FAST[: measurement.samples], atol=1e-9)
    np.testing.assert_allclose(measurement[POSITION], angle(measurement.time_s), atol=1e-9)
    np.testing.assert_allclose(measurement[SPEED], speed(measurement.time_s - DELAY), atol=0.01)
    card = health(measurement)
    clocks, delay = card.of("clocks"), card.of("speed_delay")
    assert clocks is not None and "2 clocks: brought onto one, linearly" in clocks.sentence
    assert delay is not None and delay.values["delay_low_s"] <= DELAY <= delay.values["delay_high_s"]
    if write is mat_structs:
        assert {"single numbers in the file: kp = 3", "left aside, as they are no columns of numbers: who"} <= set(
            measurement.notes
        )


PAIRS = {
    "a time before each": {"t1": FAST, "v1": angle(FAST), "t2": SLOW, "v2": LATE},
    "a time after each": {"v1": angle(FAST), "t1": FAST, "v2": LATE, "t2": SLOW},
    "one time for two": {"t_1": FAST, "v1": angle(FAST), "t_2": SLOW, "v2": LATE, "temperature_2": 0.0 * SLOW},
}


@pytest.mark.parametrize("pairs", PAIRS)
def test_pairs_of_time_and_value_in_a_text(pairs, tmp_path):
    """Columns end where their signal ends."""
    columns = PAIRS[pairs]
    most = max(values.size for values in columns.values())
    cells = [[f"{value:.7f}" for value in values] + [""] * (most - values.size) for values in columns.values()]
    (tmp_path / "a.csv").write_text("\n".join([",".join(columns), *map(",".join, zip(*cells))]))
    time = next(name for name in columns if name.startswith("t") and name.endswith("1"))
    found = read_measurement(tmp_path / "a.csv", [f"time_s={time}", f"{POSITION}=v1", f"{SPEED}=v2"])
    np.testing.assert_allclose(found[POSITION], angle(found.time_s), atol=1e-6)
    np.testing.assert_allclose(found[SPEED], speed(found.time_s - DELAY), atol=0.01)
    assert any("each with a time of its own" in note and "v2" in note for note in found.notes)


def test_units_of_times_are_taken_out(tmp_path):
    hdf5(tmp_path / "a.h5", {"fast": {"t_ms": 1e3 * FAST, "angle": angle(FAST)}, "slow": {"t_s": SLOW, "speed": LATE}})
    columns = read_columns(tmp_path / "a.h5")
    assert list(columns) == ["time_s", "angle", "speed"]
    np.testing.assert_allclose(np.diff(columns["time_s"]), 1e-3, rtol=1e-6)
    np.testing.assert_allclose(columns["speed"][300], LATE[100], rtol=1e-9)


def test_each_raster_of_dspace_has_its_own_time(tmp_path):
    rasters = {
        "HostService": (FAST, {"q": ("deg", np.rad2deg(angle(FAST))), "iq": ("A", np.cos(FAST))}),
        "Slow": (SLOW, {"q": ("deg", SLOW), "speed": ("rpm", LATE * 30.0 / np.pi)}),
    }
    write_dspace(tmp_path / "a.mat", rasters)
    columns = read_columns(tmp_path / "a.mat")
    assert list(columns) == ["time_s", "Y(1).q [deg]", "iq [A]", "Y(3).q [deg]", "speed [rpm]"]
    np.testing.assert_allclose(columns["Y(3).q [deg]"], np.minimum(columns["time_s"], SLOW[-1]), atol=1e-9)
    one = {"HostService": rasters["HostService"]}
    write_dspace(tmp_path / "one.mat", one)
    assert list(read_columns(tmp_path / "one.mat")) == ["time [s]", "q [deg]", "iq [A]"]


def test_a_clock_that_begins_later_stays_later(tmp_path):
    """Stamps count from the document's first."""
    begin = np.datetime64("2024-05-01T12:00:00")
    streams = {
        name: {"stamp": [str(begin + np.timedelta64(int(1e6 * (t + late)), "us")) for t in time], name: time.tolist()}
        for name, time, late in (("angle", FAST, 0.0), ("speed", SLOW, 0.25))
    }
    (tmp_path / "a.json").write_text(json.dumps(streams))
    measurement = read_measurement(tmp_path / "a.json", ["time_s=time[s]", f"{POSITION}=angle", f"{SPEED}=speed"])
    np.testing.assert_allclose(measurement[SPEED], measurement[POSITION] - 0.25, atol=1e-6)


@pytest.mark.parametrize(
    "columns",
    [
        {"t": FAST, "angle": FAST, "speed": FAST},  # one clock
        {"t": FAST, "timestamp": FAST + 3.0, "angle": FAST},  # nobody knows which
        {"t1": FAST, "clock": SLOW, "angle": FAST, "speed": FAST},  # one of them is nobody's
        {"t": FAST, "angle": FAST, "dead_time": np.zeros(1000), "speed": SLOW},  # it does not rise
        {"t_ms": FAST, "angle": FAST, "clock": SLOW, "speed": SLOW},  # nobody knows how fast the other goes
    ],
)
def test_what_is_not_clear_stays_as_it_is(columns, tmp_path):
    savemat(tmp_path / "a.mat", columns, oned_as="column")
    assert read_header(str(tmp_path / "a.mat"), 10**9) == list(columns)


def test_channels_without_a_common_time(tmp_path):
    hdf5(tmp_path / "a.h5", {**GROUPS, "drive": {"t": SLOW + 9.0, "speed": LATE}})
    with pytest.raises(InputError, match="its channels have no time in common"):
        read_measurement(tmp_path / "a.h5", ["time_s=time", f"{POSITION}=angle", f"{SPEED}=speed"])
    savemat(tmp_path / "a.mat", {**FLAT, "t_speed": SLOW + 9.0})
    with pytest.raises(InputError, match="its channels have no time in common"):
        read_measurement(tmp_path / "a.mat", ["time_s=time", f"{POSITION}=motor_angle", f"{SPEED}=motor_speed"])


def test_a_name_that_says_nothing_has_its_groups_before_it(tmp_path):
    """As of ROS's std_msgs/Float64, whose one field is `data`, and of records with a time and a value."""
    topics = {"target_angle": {"stamp": FAST.tolist(), "data": FAST.tolist()}, "iq": {"stamp": SLOW.tolist()}}
    topics["iq"]["value"] = SLOW.tolist()
    (tmp_path / "a.json").write_text(json.dumps(topics))
    assert read_header(str(tmp_path / "a.json"), 10**9) == ["time", "target_angle.data", "iq.value"]
