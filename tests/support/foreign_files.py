"""Files of foreign formats, made by the formats' own writers, or byte by byte as their specification says.

Each function takes a path and columns by name, (n,) each, `t` the time in seconds; names may have a unit in brackets.
"""

from __future__ import annotations

import gzip
import json
import re
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

Columns = Mapping[str, np.ndarray]


def plain(name: str) -> tuple[str, str]:
    """Name and unit of `speed [rpm]`."""
    found = re.fullmatch(r"(.*?)(?: \[(.*)\])?", name)
    assert found
    return found[1], found[2] or ""


def _time_and_rest(columns: Columns) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rest = dict(columns)
    time = next(rest.pop(name) for name in list(rest) if plain(name)[0] in ("t", "time_s"))
    return time, rest


def hdf5(path: Path, columns: Columns) -> None:
    """As h5py writes, units as attributes."""
    import h5py

    with h5py.File(path, "w") as file:
        rig = file.create_group("rig")
        for name, values in columns.items():
            label, unit = plain(name)
            rig.create_dataset(label, data=values).attrs["units"] = unit
        file.attrs["sample_rate"] = 1000.0
        file["operator"] = "Miller"


def mat73(path: Path, columns: Columns) -> None:
    """As MATLAB's save -v7.3: a header of 512 bytes, then HDF5, arrays on their side (MathWorks, MAT-File)."""
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in columns.items():
            label = re.sub(r"\W+", "_", name).strip("_")
            log.create_dataset(label, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("kp", data=[[25.0]]).attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Wed May  1 12:00:00 2024".ljust(124) + b"\0\2IM"
    with open(path, "r+b") as file:
        file.write(head)


def tdms(path: Path, columns: Columns) -> None:
    """As npTDMS writes LabVIEW's waveforms: increment and start, no column of time."""
    from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

    time, rest = _time_and_rest(columns)
    wave = {"wf_increment": float(np.median(np.diff(time))), "wf_start_offset": float(time[0])}
    with TdmsWriter(path) as file:
        channels = [
            ChannelObject("Rig", plain(name)[0], values, {**wave, "unit_string": plain(name)[1]})
            for name, values in rest.items()
        ]
        file.write_segment([RootObject({"operator": "Miller", "kp": 25.0}), GroupObject("Rig", {}), *channels])


def mf4(path: Path, columns: Columns) -> None:
    """As asammdf writes MDF 4.10: a group with a master of time, units with the channels."""
    from asammdf import MDF, Signal

    time, rest = _time_and_rest(columns)
    with MDF(version="4.10") as file:
        file.append([Signal(values, time, name=plain(name)[0], unit=plain(name)[1]) for name, values in rest.items()])
        file.save(path, overwrite=True)


def ulog(path: Path, columns: Columns) -> None:
    """By the specification of PX4 (docs.px4.io, "ULog File Format"): flags, format, parameter, subscription, data."""
    time, rest = _time_and_rest(columns)
    fields = "".join(f"double {re.sub(r'[^A-Za-z0-9_]+', '_', name).strip('_')};" for name in rest)

    def message(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<H", len(content)) + kind + content

    key = b"float RIG_KP"
    data = np.zeros(time.size, [("size", "<u2"), ("kind", "S1"), ("id", "<u2"), ("stamp", "<u8"),
                                ("values", "<f8", (len(rest),))])  # fmt: skip
    data["size"], data["kind"] = 10 + 8 * len(rest), b"D"
    data["stamp"] = np.round(1e6 * time) + 5_000_000
    data["values"] = np.column_stack(list(rest.values()))
    path.write_bytes(
        b"ULog\x01\x12\x35\x01"
        + struct.pack("<Q", 4_000_000)
        + message(b"B", bytes(40))
        + message(b"F", f"rig_state:uint64_t timestamp;{fields}".encode())
        + message(b"P", bytes([len(key)]) + key + struct.pack("<f", 25.0))
        + message(b"A", b"\0" + struct.pack("<H", 0) + b"rig_state")
        + data.tobytes()
    )


def mcap(path: Path, columns: Columns) -> None:
    """As Foxglove's writer does a topic of ROS 2: CDR, the schema as ros2msg."""
    from mcap.writer import Writer

    time, rest = _time_and_rest(columns)
    fields = [re.sub(r"[^A-Za-z0-9_]+", "_", name).strip("_") for name in rest]
    rows = np.column_stack(list(rest.values())).astype("<f8")
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        text = "".join(f"float64 {field}\n" for field in fields).encode()
        schema = writer.register_schema("rig_msgs/msg/State", "ros2msg", text)
        topic = writer.register_channel("/rig/state", "cdr", schema)
        for stamp, row in zip((1e9 * time).round().astype(int) + 1_700_000_000_000_000_000, rows):
            writer.add_message(topic, int(stamp), b"\0\1\0\0" + row.tobytes(), int(stamp))
        writer.finish()


def rrd(path: Path, columns: Columns) -> None:
    """As rerun's own recordings: a scalar for each entity on one timeline."""
    import rerun as rr

    time, rest = _time_and_rest(columns)
    stream = rr.RecordingStream("rig")
    stream.save(path)
    for name, values in rest.items():
        times = [rr.TimeColumn("time", duration=time)]
        entity = "/axis/" + re.sub(r"[^\w]+", "_", name).strip("_")
        stream.send_columns(entity, times, rr.Scalars.columns(scalars=values))
    stream.disconnect()


def json_columns(path: Path, columns: Columns) -> None:
    """An object of lists, with the settings beside."""
    path.write_text(json.dumps({"kp": 25.0, "log": {name: list(values) for name, values in columns.items()}}))


def json_records(path: Path, columns: Columns) -> None:
    """An object a line."""
    rows = zip(*(values.tolist() for values in columns.values()))
    path.write_text("\n".join(json.dumps(dict(zip(columns, row))) for row in rows))


def npy(path: Path, columns: Columns) -> None:
    """A structured array, as `np.save` writes it."""
    np.save(path, np.rec.fromarrays(list(columns.values()), names=list(columns)))


def csv_gz(path: Path, columns: Columns) -> None:
    """`gzip run.csv`."""
    rows = (",".join(f"{value:.6g}" for value in row) for row in zip(*columns.values()))
    path.write_bytes(gzip.compress("\n".join([",".join(columns), *rows]).encode(), 6))


FILES: dict[str, tuple[str, Callable[[Path, Columns], None]]] = {
    "hdf5": (".h5", hdf5),
    "mat 7.3": (".mat", mat73),
    "tdms": (".tdms", tdms),
    "mdf": (".mf4", mf4),
    "ulog": (".ulg", ulog),
    "mcap": (".mcap", mcap),
    "rerun": (".rrd", rrd),
    "json columns": (".json", json_columns),
    "json records": (".jsonl", json_records),
    "npy": (".npy", npy),
    "gzip": (".csv.gz", csv_gz),
}
