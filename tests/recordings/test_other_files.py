"""No file makes us read another one of the machine: what its format lets it name is refused, or not looked for."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from support.foreign_files import mat73, tdms

from ema_model.errors import InputError
from ema_model.recordings import read_columns
from ema_model.recordings.formats import mdf
from ema_model.recordings.read import read_measurement

N = 120
TIME = np.arange(N) / 1e3
SECRET = np.arange(float(N)) + 7.0


def external_storage(file, other):
    SECRET.tofile(other)
    file.create_dataset("current_A", (N,), "f8", external=[(str(other), 0, 8 * N)])


def external_link(file, other):
    with h5py.File(other, "w") as target:
        target["x"] = SECRET
    file["current_A"] = h5py.ExternalLink(str(other), "/x")


def soft_link_along_an_external_one(file, other):
    with h5py.File(other, "w") as target:
        target["x"] = SECRET
    file.create_group("a/b")["away"] = h5py.ExternalLink(str(other), "/")
    file["current_A"] = h5py.SoftLink("/a/b/away/x")


def virtual_dataset(file, other):
    with h5py.File(other, "w") as target:
        target["x"] = SECRET
    layout = h5py.VirtualLayout((N,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "x", shape=(N,))
    file.create_virtual_dataset("current_A", layout)


def virtual_dataset_of_external_storage(file, other):
    SECRET.tofile(other)
    file.create_dataset("#hidden/x", (N,), "f8", external=[(str(other), 0, 8 * N)])
    layout = h5py.VirtualLayout((N,), "f8")
    layout[:] = h5py.VirtualSource(file["#hidden/x"])
    file.create_virtual_dataset("current_A", layout)


WAYS = [
    external_storage,
    external_link,
    soft_link_along_an_external_one,
    virtual_dataset,
    virtual_dataset_of_external_storage,
]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("suffix", [".h5", ".mat"])
def test_hdf5_that_leads_to_another_file_is_refused(way, suffix, tmp_path):
    path, other = tmp_path / f"a{suffix}", tmp_path / "other.h5"
    if suffix == ".mat":
        mat73(path, {"time_s": TIME})
    with h5py.File(path, "a") as file:
        if "log" not in file:
            file["time_s"] = TIME
        way(file, other)
    for read in (read_columns, read_measurement):
        with pytest.raises(InputError) as caught:
            read(path)
        line = str(caught.value)
        assert line.startswith(f"{path}: ") and "leads to another file" in line and "other.h5" in line
        assert "save the numbers in this file itself" in line


def test_hdf5_links_within_the_file(tmp_path):
    """Those that lead nowhere, or in a circle, are left out and the rest is read; the others are read."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = TIME
        rig = file.create_group("rig")
        rig["current_A"] = SECRET
        file["duty"] = h5py.SoftLink("/rig/current_A")
        file["itself"] = h5py.SoftLink("/itself")
        file["gone"] = h5py.SoftLink("/rig/nowhere")
        rig["up"] = h5py.SoftLink("/")
        rig["again"] = rig
        layout = h5py.VirtualLayout((N,), "f8")
        layout[:] = h5py.VirtualSource(rig["current_A"])
        file.create_virtual_dataset("motor_position_rad", layout)
    measurement = read_measurement(path)
    assert set(measurement) == {"time_s", "current_A", "duty", "motor_position_rad"}
    for name in ("current_A", "duty", "motor_position_rad"):
        np.testing.assert_array_equal(measurement[name], SECRET)
    left = "links that lead nowhere, or in a circle, are left out: gone, itself, rig.again, rig.up"
    assert left in measurement.notes


def test_an_index_beside_a_tdms_file_is_not_read(tmp_path):
    path = tmp_path / "a.tdms"
    tdms(tmp_path / "other.tdms", {"t": TIME, "voltage [V]": SECRET})
    (tmp_path / "a.tdms_index").write_bytes((tmp_path / "other.tdms").read_bytes().replace(b"TDSm", b"TDSh"))
    tdms(path, {"t": TIME, "current [A]": TIME})
    assert set(read_columns(path)) == {"time_s", "current [A]"}


def test_an_attachment_of_an_mdf_file_is_not_read(tmp_path, monkeypatch):
    """Of a bus's channels, where asammdf reads the description of the bus that an attachment names."""
    from asammdf import MDF, Signal, Source
    from asammdf.blocks import v4_constants

    path, other = tmp_path / "a.mf4", tmp_path / "other.dbc"
    other.write_text('VERSION ""\n')
    fields = [("BusChannel", "u1"), ("ID", "<u4"), ("DLC", "u1"), ("DataLength", "u1"), ("DataBytes", "u1", (8,))]
    frames = np.zeros(N, [(f"CAN_DataFrame.{name}", *kind) for name, *kind in fields])
    can = Source("CAN", "CAN", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    with MDF(version="4.10") as file:
        file.append([Signal(TIME, TIME, name="current", unit="A")])
        attached = (b"x", other, None)
        file.append(Signal(frames, TIME, name="CAN_DataFrame", source=can, attachment=attached), acq_source=can)
        file.groups[1].channel_group.flags |= v4_constants.FLAG_CG_BUS_EVENT
        [block] = file.attachments
        block.flags, block.embedded_data, block.embedded_size = 0, b"", 0
        block.file_name, block.block_len = str(other), v4_constants.AT_COMMON_SIZE
        file.save(path, overwrite=True)
    read = []
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.append(path) or b"")
    with MDF(path):
        assert read == [other]  # or the file would show nothing
    read.clear()
    with mdf.opened(str(path), 10_000_000) as log:
        assert next(channel.path[-1] for channel in log.channels) == "current"
    assert not read
