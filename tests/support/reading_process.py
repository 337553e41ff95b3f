"""Reads files in a process of its own, which a file may fill or crash, and says what came of each.

As a program: a line with a reader and a file in, a line with the outcome out.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from support.foreign_files import FILES

_MOST_MEMORY = 10 << 30  # of address space, so that the machine survives
_PATIENCE_S = 120.0


@dataclass(frozen=True)
class Outcome:
    """What a reader made of a file."""

    kind: str  # "read", "refused", "uncaught", "crashed" or "hung"
    line: str = ""  # the refusal, or the error that nobody caught
    seconds: float = 0.0  # of computing, which is what it takes on a machine that does nothing else
    grown_bytes: float = 0.0  # by which the process has grown at its peak


class ReadingProcess:
    """The process; a new one starts after a crash."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None

    def read(self, reader: str, path: Path, most_bytes: int) -> Outcome:
        """What `READERS[reader]` makes of the file."""
        process = self._process = self._process or self._started()
        assert process.stdin and process.stdout
        process.stdin.write(json.dumps([reader, str(path), most_bytes]) + "\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], _PATIENCE_S)[0]:
            self.close()
            return Outcome("hung", seconds=_PATIENCE_S)
        answer = process.stdout.readline()
        if not answer:
            code = process.wait()
            self._process = None
            return Outcome("crashed", f"the process ended with {code}")
        return Outcome(**json.loads(answer))

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _started(self) -> subprocess.Popen[str]:
        pipe, nowhere = subprocess.PIPE, subprocess.DEVNULL
        same = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}  # the packages that are tested
        command = [sys.executable, __file__]
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=nowhere, text=True, env=same)


def _measurement(path: Path, most_bytes: int) -> None:
    import emaviz  # noqa: F401  which adds formats
    from ema_model.errors import InputError
    from ema_model.files.opened import PAGE_BYTES
    from ema_model.recordings import read_columns
    from ema_model.recordings.health import health
    from ema_model.recordings.read import read_measurement

    refused = None
    try:
        measurement = read_measurement(path, max_bytes=most_bytes)
        if measurement.samples < 100_000:  # its own time is no matter here
            assert health(measurement).findings
        del measurement
    except InputError as error:
        refused = error
    if most_bytes <= PAGE_BYTES:  # the command line shows no table
        try:
            read_columns(path, max_bytes=most_bytes)
        except InputError as error:
            _checked(str(error))
    if refused is not None:
        raise refused


def _servo_log(path: Path, most_bytes: int) -> None:
    from ema_model.actuator import parse_actuator, shipped
    from ema_model.recordings import read

    read(path, parse_actuator(shipped("xl330.toml"), "xl330.toml"), max_bytes=most_bytes)


def _robot_dataset(path: Path, most_bytes: int) -> None:
    """path: a dataset's description, put into one that is whole otherwise."""
    from ema_model.recordings.read import read_header, read_measurement
    from ema_model.recordings.recording_set import episodes_of, files_of

    root = path.parent / "dataset"
    shutil.copy(path, root / "meta" / "info.json")
    (file,) = files_of(str(root))
    names = read_header(file, most_bytes)
    time = next(name for name in names if name.startswith("timestamp"))
    episode = next(name for name in names if name.startswith("episode_index"))
    mapping = [f"time_s={time}[s]", f"segment={episode}", f"current_A={names[1]}[A]"]
    assert episodes_of(read_measurement(file, mapping, max_bytes=most_bytes), file)


def _side_file(path: Path, _: int) -> None:
    from ema_model.recordings import read_side_file

    read_side_file(path)


def _actuator(path: Path, _: int) -> None:
    from ema_model.actuator import load_actuator

    load_actuator(path)


def _session(path: Path, _: int) -> None:
    from emaviz.session import session_file
    from emaviz.session.data_folder import DataFolder
    from emaviz.session.session_file import Part
    from emaviz.session.settings import Settings

    with tempfile.TemporaryDirectory() as folder:
        settings = Part(dict, lambda saved, _: Settings().restore(saved))
        session_file.read_session(path, {"settings": settings}, DataFolder(Path(folder)))


def _challenge(path: Path, _: int) -> None:
    from ema_model.actuator import load_actuator
    from ema_model.challenges import opened, sealed_challenge
    from ema_model.challenges.truth import unseal
    from ema_model.files.opened import CHALLENGE_RECORDING_BYTES
    from ema_model.recordings import read

    with opened(sealed_challenge(path)) as one:
        actuator = load_actuator(one.actuator)
        for file in (*one.training, *one.holdout):
            read(file, actuator, max_bytes=CHALLENGE_RECORDING_BYTES)
    unseal(path)


def _recording(path: Path, _: int) -> None:
    from emaviz.recording import read

    read(path)


def _listed(path: Path, _: int) -> None:
    from emaviz.recording.read import properties

    properties(path)


READERS: dict[str, Callable[[Path, int], Any]] = {
    **dict.fromkeys(("csv", "parquet", "npz", "mat", "packed mat", *FILES), _measurement),
    "servo log": _servo_log,
    "robot dataset": _robot_dataset,
    "side file": _side_file,
    "actuator": _actuator,
    "user effects": _actuator,
    "session": _session,
    "challenge": _challenge,
    "rrd": _recording,
    "listed rrd": _listed,
}


def _checked(line: str) -> str:
    assert line.isprintable(), f"the refusal is not one line: {line!r}"
    assert len(line) < 1_000, f"the refusal is {len(line)} characters long: {line[:200]!r}…"
    return line


def _outcome(reader: str, path: Path, most_bytes: int) -> Outcome:
    from ema_model.errors import InputError
    from ema_model.files import sandbox
    from emaviz.recording.entry import RecordingError

    before = _memory("VmRSS", reset=True)
    reader_apart = sandbox.process_id()
    before_apart = _memory("VmRSS", reset=True, process=reader_apart) if reader_apart else 0.0
    began = time.process_time()
    try:
        try:
            READERS[reader](path, most_bytes)
            kind, line = "read", ""
        except (InputError, RecordingError) as error:
            kind, line = "refused", _checked(str(error))
    except BaseException as error:  # a panic of native code is no Exception
        kind, line = "uncaught", f"{type(error).__name__}: {error}"[:300]
    seconds = time.process_time() - began
    grown = max(_memory("VmHWM") - before, 0.0)
    if reader_apart and reader_apart == sandbox.process_id():
        grown += max(_memory("VmHWM", process=reader_apart) - before_apart, 0.0)
    return Outcome(kind, line, seconds, grown)


def _memory(which: str, reset: bool = False, process: int | str = "self") -> float:
    """Memory of a process now (VmRSS), or at its peak since the last reset (VmHWM), bytes; 0 if it has gone."""
    if reset:
        import pyarrow as pa

        pa.default_memory_pool().release_unused()
        Path(f"/proc/{process}/clear_refs").write_text("5")
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next((1024.0 * int(line.split()[1]) for line in lines if line.startswith(which)), 0.0)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY, _MOST_MEMORY))
    for module in (
        "ema_model.challenges.challenge",
        "ema_model.effects",
        "emaviz.session.session_file",
        "emaviz.session.settings",
    ):
        importlib.import_module(module)  # the first file shall not pay for these

    answers = sys.stdout
    sys.stdout = sys.stderr
    for asked in sys.stdin:
        reader, path, most_bytes = json.loads(asked)
        print(json.dumps(vars(_outcome(reader, Path(path), most_bytes))), file=answers, flush=True)
