"""Recordings of others, which the shipped plans of benchmarks compute on: where they come from, and how they are read.

They are no part of this project.  `assets/field/sets.toml` lists each set with its repository, commit, licence and the
SHA-256 of its files; a user fetches them, and `convert` makes recordings of exactly these files.  EMAVIZ_DATA names
the folder that holds a folder for each set, where a plan's `data = "emps"` looks for them.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import open_user_file, refusal, shipped_folder
from ema_model.files.written import toml_of
from ema_model.recordings import Measurement, read_columns, write_measurement
from ema_model.recordings.formats.json import decoded, is_one, with_units

Array = NDArray[np.float64]
Signals = dict[str, Array]  # (samples,) by the name and unit of the measurement format

FOLDER = "EMAVIZ_DATA"  # the environment variable that names the folder of all sets
_PIECE = 1 << 20
_MOST_BYTES = 100e6


@dataclass(frozen=True)
class DataSet:
    """Files of one commit of a public repository, and what recordings they give."""

    name: str
    title: str
    repository: str  # of GitHub: owner/name
    commit: str
    licence: str
    files: Mapping[str, str]  # SHA-256 by path in the repository

    @property
    def address(self) -> str:
        """Where it can be looked at."""
        return f"https://github.com/{self.repository}/tree/{self.commit}"

    @property
    def how_to_get(self) -> list[str]:
        """Lines for a shell: they fetch its files, and make recordings of them."""
        clone = self.repository.split("/")[1]
        folders = sorted({os.path.dirname(path) for path in self.files})
        return [
            f"git clone --filter=blob:none --no-checkout https://github.com/{self.repository}",
            f"git -C {clone} fetch origin {self.commit}",
            f"git -C {clone} checkout {self.commit} -- {' '.join(folders)}",
            f"emaviz data {self.name} --from {clone} --out DIR && export {FOLDER}=DIR",
        ]


def data_sets() -> dict[str, DataSet]:
    """All sets, by name."""
    text = (shipped_folder("field") / "sets.toml").read_text(encoding="utf-8")
    return {name: DataSet(name, **table) for name, table in toml_of(text).items()}


def data_set(name: Any) -> DataSet:
    """The set of that name; InputError where there is none."""
    known = data_sets()
    if not isinstance(name, str) or name not in known:
        like = did_you_mean(name, known) if isinstance(name, str) else ""
        raise InputError(f"no data set {quoted(name, 40)!r}; there are {', '.join(known)}{like}")
    return known[name]


def folder_of(name: Any) -> Path:
    """The folder of a set's recordings; InputError, with what to do, where it is not there."""
    wanted = data_set(name)
    root = os.environ.get(FOLDER)
    if not root:
        where = f"name the folder that has them as {name}/ in the environment variable {FOLDER}"
    elif not (folder := Path(root) / name).is_dir():
        where = f"they are looked for in {quoted(folder, 300)}, which {FOLDER} says"
    else:
        return folder
    raise InputError(f"needs the recordings of {wanted.repository}; {where}; `emaviz data {name}` says how to get them")


def convert(wanted: DataSet, copy: str | os.PathLike[str], out: str | os.PathLike[str]) -> list[Path]:
    """Writes the recordings of a set into out/NAME, from a local copy of its repository; the files written.

    InputError where the copy lacks a file or has another version of one: then nothing is written.
    """
    files = {path: Path(copy) / path for path in wanted.files}
    for path, file in files.items():
        found = _sha256(file)
        if found != wanted.files[path]:
            raise refusal(
                file,
                f"is not the file of the benchmark (SHA-256 {found[:12]}…, not {wanted.files[path][:12]}…); "
                f"check out commit {wanted.commit[:12]} of https://github.com/{wanted.repository}",
            )
    recordings = _CONVERTERS[wanted.name](files)
    folder = Path(out) / wanted.name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(folder, f"cannot be made ({error.strerror}); name another folder") from None
    written = []
    for name, signals in recordings.items():
        written.append(folder / f"{name}.csv")
        write_measurement(Measurement(signals), written[-1])
    return written


def _sha256(path: Path) -> str:
    whole = hashlib.sha256()
    with open_user_file(path, "a file of the data set", _MOST_BYTES) as file:
        while piece := file.read(_PIECE):
            whole.update(piece)
    return whole.hexdigest()


# --- what the files of each set hold ----------------------------------------------------------------------------------


def _xl330(files: Mapping[str, Path]) -> dict[str, Signals]:
    """Logs of Rhoban/bam (bam/dynamixel/record.py), a recording each, named by gain and trajectory."""
    found = {}
    for file in files.values():
        log = decoded(_bytes(file))
        if not is_one(log):
            raise refusal(file, "is not a log of Rhoban/bam")
        columns = {name: np.asarray(one, dtype=float) for name, one in with_units(log)["entries"].items()}
        found[f"xl330_kp{log['kp']}_{log['trajectory']}"] = {
            "time_s": columns["timestamp [s]"],
            "command_rad": columns["goal_position [rad]"],
            "user_position_rad": columns["position [rad]"],
            "motor_speed_rad_s": columns["speed [rad/s]"],
            "duty": columns["duty"],
            "bus_voltage_V": columns["bus_voltage_V"],
            "temperature_C": columns["temperature_C"],
            "drive_enabled": columns["drive_enabled"],
        }
    return found


def _emps(files: Mapping[str, Path]) -> dict[str, Signals]:
    """Janot, Gautier, Brunot, Data set and reference models of EMPS, Nonlinear System Identification Benchmarks 2019.

    What drives it is the controller's voltage `vir`, as in every published simulation.  It stands in the current's
    place, since the amplifier makes a current of it, and the actuator's file has the force that a volt gives, g_τ.
    """
    found = {}
    for name, file in zip(("train", "test"), files.values()):
        columns = read_columns(file)
        found[name] = {
            "time_s": columns["t"],
            "command_m": columns["qg"],
            "motor_position_m": columns["qm"],
            "current_A": columns["vir"],
        }
    return found


def _ur10e(files: Mapping[str, Path]) -> dict[str, Signals]:
    """Columns without names (utils/data_processing/parseURData.m): time, q, dq, motor current, …, six joints each.

    Joint j moves alone, to and fro at one speed; the first half is to be fitted, the second one held out.
    """
    found = {}
    for joint, file in enumerate(files.values(), 1):
        table = np.loadtxt(file, delimiter=",")
        time = table[:, 0] - table[0, 0]
        whole = {"time_s": time, "motor_position_rad": table[:, joint], "current_A": table[:, 12 + joint]}
        found |= _halves(f"joint_{joint}", whole)
    return found


def _dynamometer(files: Mapping[str, Path]) -> dict[str, Signals]:
    """Logs of futek_testing.py: lines of remarks, then a table.  Actuator 1 behind its gear, as the log counts it."""
    names = [f"{rig}_{use}" for rig in ("ri50", "ex8", "stairs") for use in ("fit", "held")]
    found = {}
    for name, file in zip(names, files.values()):
        columns = read_columns(file)
        driven = columns["a1 q-axis cmd [A]"] != 0.0 if name.startswith("stairs") else np.ones(columns["time [s]"].size)
        on = np.flatnonzero((columns["c1 mode"] >= _CONTROLS) & (driven != 0.0))
        run = slice(on[0], on[-1] + 1)
        found[name] = {
            "time_s": columns["time [s]"][run],
            "motor_position_rad": columns["a1 position [rad]"][run],
            "current_A": columns["a1 q-axis [A]"][run],
        }
    return found


def _hobby(files: Mapping[str, Path]) -> dict[str, Signals]:
    """Roll-outs at 50 Hz, goal and position in half turns (src/sysid/env.py); every other one is held out."""
    (file,) = files.values()
    rolled = [
        one for one in decoded(_bytes(file))["data"] if len(one["sensor_data"]) >= 100 and None not in one["actions"]
    ]
    found = {}
    for use, first in (("fit", 0), ("held", 1)):
        chosen = rolled[first::2]
        samples = [len(one["sensor_data"]) for one in chosen]
        found[f"hobby_{use}"] = {
            "time_s": np.concatenate([_HOBBY_S * np.arange(n) for n in samples]),
            "segment": np.repeat(np.arange(len(chosen), dtype=float), samples),
            "command_rad": np.pi * np.concatenate([np.asarray(one["actions"], dtype=float) for one in chosen]),
            "user_position_rad": np.pi * np.concatenate([np.asarray(one["sensor_data"]) for one in chosen]),
        }
    return found


_CONTROLS = 3.0  # modes of the moteus controller from which on the motor is driven
_HOBBY_S = 0.02  # sampling period
_CONVERTERS: dict[str, Callable[[Mapping[str, Path]], dict[str, Signals]]] = {
    "xl330": _xl330,
    "emps": _emps,
    "ur10e": _ur10e,
    "dynamometer": _dynamometer,
    "hobby": _hobby,
}


def _halves(name: str, whole: Signals) -> dict[str, Signals]:
    half = whole["time_s"].size // 2
    return {
        f"{name}_fit": {signal: values[:half] for signal, values in whole.items()},
        f"{name}_held": {signal: values[half:] for signal, values in whole.items()},
    }


def _bytes(path: Path) -> bytes:
    with open_user_file(path, "a file of the data set", _MOST_BYTES) as file:
        return file.read()
