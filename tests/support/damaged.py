"""Whole files of every kind that is read, and changes of their bytes, in what a checksum or a packing covers too."""

from __future__ import annotations

import io
import json
import random
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

from ema_model.actuator import load_actuator
from ema_model.actuator.file import shipped
from ema_model.challenges import challenge as challenge_challenges
from ema_model.challenges.truth import Truth, seal
from emaviz.recording import RecordingWriter
from emaviz.session.settings import Settings
from support.foreign_files import FILES
from support.mat_structs import write_dspace
from support.robot_datasets import write_robot_dataset
from support.servo_logs import SERVO_SIGNALS, write_servo_log

N = 120
k = np.arange(float(N))
COLUMNS = {"time_s": k / 1e3, "current_A": np.sin(k / 9.0), "motor_position_rad": k / 7.0, "duty": np.cos(k / 5.0)}
TABLE = np.rec.fromarrays(list(COLUMNS.values()), names=list(COLUMNS))
SIDE = """schema = 1
kind = "run"
actuator = "mine.toml"
sampling = "mean"
segments = [0, 1, 4]
[window]
from_s = 0.5
to_s = 2.0
[sensors]
motor_position_noise_rad = 1e-4
encoder_bits = 12
[mapping]
current_A = "I[mA]"
time_s = { column = "t", unit = "ms", sign = 1, scale = 1.5, offset = -2 }
"""
EFFECTS = """
[effects.user_torque]
expression = "c*omega + A*sin(7*theta)"
c = { value = -1e-4, sigma = 5e-5, low = -0.01, high = 0.0 }
A = 0.02
[effects.torque_curve]
variable = "omega"
modulator = "sign_speed"
low = -500
high = 500.0
values = [-0.01, { value = -0.002, sigma = 0.005 }, -0.01]
[[recordings.where]]
match = "*kp100*"
set = { "controller.position_gain_1_s" = 100.0 }
"""
SLOW = k[: N // 2] / 500.0
TWO_CLOCKS = {
    "encoder": {name: COLUMNS[name] for name in ("time_s", "motor_position_rad")},
    "drive": {"time_s": SLOW, "current_A": np.sin(SLOW)},
}
RUNS = {"trial_1": COLUMNS, "trial_2": {**COLUMNS, "time_s": COLUMNS["time_s"] + 1.0}}
JOINTS = np.sin(k[:, None] * np.arange(1, 8))
OF_A_ROBOT = {**COLUMNS, "q": JOINTS, "torque": JOINTS.T}
Change = Callable[[bytes, random.Random], bytes]


def written(write: Callable[..., object], *args: object, **kw: object) -> bytes:
    """What `write(file, …)` writes."""
    file = io.BytesIO()
    write(file, *args, **kw)
    return file.getvalue()


def as_text(separator: str, decimal: str = ".") -> bytes:
    rows = (separator.join(f"{value:.6g}" for value in row) for row in zip(*COLUMNS.values()))
    return "\n".join([separator.join(COLUMNS), *(row.replace(".", decimal) for row in rows)]).encode()


def as_labels() -> bytes:
    """As Arduino's plotter takes it."""
    rows = (",".join(f"{name}:{value:.6g}" for name, value in zip(COLUMNS, row)) for row in zip(*COLUMNS.values()))
    return "\n".join(rows).encode()


def as_parquet(**options: object) -> bytes:
    return written(lambda file: pq.write_table(pa.table(COLUMNS), file, **options))


def zipped(members: Mapping[str, bytes]) -> bytes:
    def write(file: io.BytesIO) -> None:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name, content)

    return written(write)


def session() -> bytes:
    document = {"schema": 1, "emaviz": "0", "files": ["uploads/a.csv"], "settings": Settings().saved()}
    parts = {"session.json": json.dumps(document).encode(), "files/uploads/a.csv": as_text(",")}
    return zipped({**parts, "files/uploads/a.toml": SIDE.encode()})


def challenge(folder: Path) -> bytes:
    path = folder / "whole.challenge"
    seal(Truth("", 7, "Hidden.", faults={"k1": 0.4}), path, "A title", "A story.", load_actuator())
    return path.read_bytes()


def recording(folder: Path) -> bytes:
    path = folder / "whole.rrd"
    with RecordingWriter(path) as writer:
        writer.config("# Settings\n")
        writer.properties({"seed": 7, "faults": {"k1": 0.25}})
        writer.truth(np.full(8, 0.25))
        writer.signals("reference", k / 1e3, {"current_A": np.sin(k)})
        for i in range(5):
            writer.iteration("hba", i, 1.0 / (i + 1), np.full(8, 0.1), np.full((4, 8), 0.2), np.ones(4))
    return path.read_bytes()


def in_groups(reader: str, folder: Path) -> list[bytes]:
    """The same with two clocks, a group for each run, and matrices, in formats that know of none of these."""
    path, found = folder / "in groups", []
    for groups in (TWO_CLOCKS, RUNS, {"robot": OF_A_ROBOT}):
        parts = [(group, name, values) for group, columns in groups.items() for name, values in columns.items()]
        if reader == "json columns":
            document = {"data": [*groups.values()]} if "robot" in groups else groups
            path.write_text(json.dumps(document, default=np.ndarray.tolist))
        elif reader == "hdf5":
            with h5py.File(path, "w") as file:
                for group, name, values in parts:
                    file[f"{group}/{name}"] = values
        elif reader == "tdms" and "robot" not in groups:
            with nptdms.TdmsWriter(path) as file:
                file.write_segment([nptdms.ChannelObject(*part) for part in parts])
        elif reader == "tdms":
            continue
        else:
            return []
        found.append(path.read_bytes())
    return found


def npy_arrays() -> list[bytes]:
    """Tables of other numbers: short floats, whole ones beside a time, and a column of records."""
    short = [("time_s", "f8"), *((name, "f4") for name in COLUMNS if name != "time_s")]
    whole_numbers = [("time_s", "f8"), ("current_A", "i2"), ("duty", "u1"), ("note", "S3")]
    tables = (TABLE.astype(short), np.zeros(N, whole_numbers), TABLE.reshape(N, 1))
    tables[1]["time_s"], tables[1]["current_A"] = COLUMNS["time_s"], np.round(100.0 * COLUMNS["current_A"])
    return [written(np.save, np.asarray(one)) for one in tables]


def as_mat73(content: bytes, folder: Path) -> bytes:
    """An HDF5 file's objects behind MATLAB's header."""
    plain, path = folder / "plain.h5", folder / "behind.mat"
    plain.write_bytes(content)
    with h5py.File(plain, "r") as file, h5py.File(path, "w", userblock_size=512) as behind:
        for name in file:
            file.copy(name, behind)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")
    return path.read_bytes()


def dspace(folder: Path) -> bytes:
    fast = k / 1e3, {"motor_position_rad": ("", COLUMNS["motor_position_rad"])}
    write_dspace(folder / "whole.mat", {"Fast": fast, "Slow": (SLOW, {"current_A": ("", np.sin(SLOW))})})
    return (folder / "whole.mat").read_bytes()


def servo_log(folder: Path) -> bytes:
    signals = {**dict.fromkeys(SERVO_SIGNALS, np.sin(k)), "time_s": k / 200.0, "duty": np.cos(k)}
    write_servo_log(folder / "whole.json", signals, 100)
    return (folder / "whole.json").read_bytes()


def robot_dataset(folder: Path) -> bytes:
    """Its description, beside which it stands whole."""
    root, state = folder / "dataset", np.column_stack([k, np.sin(k)])
    write_robot_dataset(root, 3, 500.0, {"state": ["position_rad", "current_A"]}, [{"state": state}, {"state": state}])
    return (root / "meta" / "info.json").read_bytes()


def whole(reader: str, folder: Path) -> list[bytes]:
    """Some files that the reader takes."""
    if reader == "csv":
        return [as_text(","), as_text(";", ","), b"\xef\xbb\xbf" + as_text("\t"), as_text(" "), as_labels()]
    if reader == "parquet":
        plain = as_parquet(compression="none", use_dictionary=False)
        return [as_parquet(), plain, as_parquet(data_page_size=64)]
    if reader == "npz":
        table = written(np.savez, table=np.asarray(TABLE), label="x")
        return [
            written(np.savez, **COLUMNS),
            written(np.savez_compressed, **COLUMNS),
            table,
            written(np.savez, **OF_A_ROBOT),
        ]
    if reader in ("mat", "packed mat"):
        rig = {"rig": {**COLUMNS, "label": "x", "inner": {"x": k}}, "cells": np.array([k, "a"], object)}
        kinds = (COLUMNS, rig, TWO_CLOCKS, RUNS, OF_A_ROBOT)
        found = [written(savemat, arrays, do_compression=reader == "packed mat") for arrays in kinds]
        return found if reader == "packed mat" else [*found, dspace(folder)]
    if reader in ("robot dataset", "servo log"):
        return [robot_dataset(folder) if reader == "robot dataset" else servo_log(folder)]
    if reader in FILES:
        ending, write = FILES[reader]
        write(folder / f"whole{ending}", COLUMNS)
        found = [(folder / f"whole{ending}").read_bytes(), *in_groups(reader, folder)]
        if reader == "mat 7.3":
            found += [as_mat73(one, folder) for one in in_groups("hdf5", folder)]
        return [*found, *npy_arrays()] if reader == "npy" else found
    if reader == "side file":
        return [SIDE.encode()]
    if reader == "actuator":
        return [shipped("thesis.toml").encode()]
    if reader == "user effects":
        return [(shipped("thesis.toml") + EFFECTS).encode()]
    return [{"session": lambda _: session(), "challenge": challenge}.get(reader, recording)(folder)]


def damage(reader: str, content: bytes, rng: random.Random, folder: Path) -> bytes:
    """The file with some bytes changed; half of the packed ones within, under a good checksum."""
    inside = {"npz": _within_zip, "session": _within_zip, "challenge": _resealed, "packed mat": _within_mat}
    if reader == "user effects":
        start = content.index(b"[effects.user_torque]")
        return content[:start] + changed(content[start:], rng)
    if reader in inside and rng.random() < 0.5:
        return inside[reader](content, rng, folder)
    return changed(content, rng)


def changed(content: bytes, rng: random.Random) -> bytes:
    """Up to four changes: other bytes, more or fewer of them, some repeated, words and numbers that mean harm."""
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(content) + 1)
        piece = rng.choice((rng.randbytes(rng.randint(1, 8)), rng.choice(_NASTY)))
        end = at + len(piece)
        kind = rng.choice(("put", "put", "insert", "cut", "drop", "repeat", "flip"))
        if kind == "put":
            content = content[:at] + piece + content[end:]
        elif kind == "insert":
            content = content[:at] + piece + content[at:]
        elif kind == "cut":
            content = content[:at]
        elif kind == "drop":
            content = content[:at] + content[end:]
        elif kind == "repeat":
            content = content[:at] + content[at:end] * (1 + piece[0]) + content[end:]
        else:
            content = content[:at] + bytes(byte ^ 1 << piece[0] % 8 for byte in content[at:end]) + content[end:]
    return content


_NASTY = (
    *(
        b"\xff\xff\xff\xff",
        b"\xff\xff\xff\x7f",
        b"\0\0\0\0",
        b"\0\0\0\x80",
        b"\n",
        b'"',
        b"=",
        b"[",
        b"{}",
        b"[[",
        b",",
    ),
    *(
        b"nan",
        b"1e999",
        b"-1",
        b"null",
        b"true",
        b"[]",
        b'""',
        b"9" * 20,
        b"0x" + b"f" * 30,
        b"../",
        b"\\ud800",
        b"-inf",
    ),
)


def _within_zip(content: bytes, rng: random.Random, _: Path) -> bytes:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    members[name] = changed(members[name], rng)
    return zipped(members)


def _resealed(content: bytes, rng: random.Random, folder: Path) -> bytes:
    """Under a good seal, since whoever seals may be hostile."""
    path = folder / "resealed.challenge"
    path.write_bytes(content)
    parts = challenge_challenges.read_parts(path)
    head = parts.pop("challenge.json")
    name = rng.choice([*parts, "challenge.json"])
    if name != "challenge.json":
        parts[name] = changed(parts[name], rng)
        challenge_challenges.write_sealed(path, json.loads(head), parts)
        return path.read_bytes()
    try:
        challenge_challenges.write_sealed(path, json.loads(changed(head, rng)), parts)
    except (ValueError, TypeError):  # no longer JSON, or no table
        return changed(content, rng)
    return path.read_bytes()


def _within_mat(content: bytes, rng: random.Random, _: Path) -> bytes:
    """With one packed element unpacked, changed and packed again."""
    starts, at = [], 128
    while at < len(content):
        starts.append(at)
        at += 8 + struct.unpack_from("<I", content, at + 4)[0]
    start = rng.choice(starts)
    end = start + 8 + struct.unpack_from("<I", content, start + 4)[0]
    packed = zlib.compress(changed(zlib.decompress(content[start + 8 : end]), rng))
    return content[:start] + struct.pack("<II", 15, len(packed)) + packed + content[end:]
