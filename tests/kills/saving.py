"""What can be saved, over and over until the process is killed, and how it is read back."""

from __future__ import annotations

import itertools
import json
from argparse import Namespace
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from ema_model.actuator import load_actuator, save_actuator
from ema_model.recordings import Measurement, write_measurement
from ema_model.recordings.read import read_measurement
from emaviz.cli.output import write_json
from emaviz.recording import RecordingWriter, read
from emaviz.session import session_file
from emaviz.session.data_folder import DataFolder

SIZE = 20_000
ACTUATOR = load_actuator()


def _measurement(number: int) -> Measurement:
    return Measurement({"time_s": np.arange(SIZE) / 1e4, "current_A": np.full(SIZE, float(number))})


def _save_session(path: Path, number: int) -> None:
    part = session_file.Part(lambda: [number] * SIZE, lambda saved, names: None)
    session_file.write_session(path, {"numbers": part}, DataFolder(path.parent / "data"), [])


def _read_session(path: Path) -> list[int]:
    found: list[int] = []
    part = session_file.Part(list, lambda saved, names: found.extend(saved))
    session_file.read_session(path, {"numbers": part}, DataFolder(path.parent / "data"))
    return found


def _save_rrd(path: Path, number: int) -> None:
    with RecordingWriter(path, min_free_bytes=0) as writer:
        one = _measurement(number)
        writer.signals("measurement", one.time_s, {"current_A": one["current_A"]})


def _read_rrd(path: Path) -> np.ndarray:
    recording = read(path)
    assert recording.complete
    return recording.signals["measurement"]["current_A"].values


# By the file's name: saves a number, as often as it goes in; reads them back, all of them.
KINDS: dict[str, tuple[Callable[[Path, int], None], Callable[[Path], object]]] = {
    "a.json": (
        lambda path, n: write_json(Namespace(json=str(path)), {"numbers": [n] * SIZE}),
        lambda path: json.loads(path.read_text())["numbers"],
    ),
    "a.csv": (
        lambda path, n: write_measurement(_measurement(n), path),
        lambda path: read_measurement(path)["current_A"],
    ),
    "a.toml": (
        lambda path, n: save_actuator(replace(ACTUATOR, name=str(n), description=" ".join([str(n)] * SIZE)), path),
        lambda path: [int(number) for number in load_actuator(path).description.split()],
    ),
    "a.emaviz": (_save_session, _read_session),
    "a.rrd": (_save_rrd, _read_rrd),
}


def save_over_and_over(target: Path, begun: Connection) -> None:
    """Says when the first one is there."""
    save, _ = KINDS[target.name]
    save(target, 0)
    begun.send(True)
    for number in itertools.count(1):
        save(target, number)
