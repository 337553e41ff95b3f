"""Recordings as files: names, errors, sound chunks of bytes, what stands at their start."""

from __future__ import annotations

import importlib.util
import itertools
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import IO, Any

import numpy as np
import rerun as rr
import rerun_bindings
from numpy.typing import NDArray
from rerun.error_utils import catch_and_log_exceptions

from ema_model.child_processes import start_program
from ema_model.files.written import FileLock, lock_path
from ema_model.identification.run import algorithm_title
from ema_model.quantities.numbers import amount, number
from ema_model.quantities.titles import in_sentence, parameter_title, unit_of
from ema_model.text import Facts
from emaviz.recording.layout import APPLICATION


class RecordingError(OSError):
    """A recording cannot be written, read, repaired or shown.  Its message is one line: what, where, what to do."""


# --- names of the files around a recording, and the checks before one is started --------------------------------------

MIN_FREE_BYTES = 200_000_000


def part_of(target: Path) -> Path:
    """NAME.rrd.part: where NAME.rrd grows until it is whole."""
    return target.with_name(target.name + ".part")


def free_name(folder: Path, stem: str, ending: str) -> Path:
    """folder/stem+ending, or stem-2, stem-3, … if that exists."""
    for count in itertools.count(1):
        path = folder / f"{stem}{'' if count == 1 else f'-{count}'}{ending}"
        if not path.exists():
            return path
    raise AssertionError("unreachable")


def free_bytes(folder: Path) -> int:
    """Bytes free for this user on the folder's disk."""
    return shutil.disk_usage(folder).free


def claim(target: Path, min_free_bytes: int) -> FileLock:
    """Checks that a recording can start at `target` and takes its lock.

    A part left there by a process that died is moved aside, for `recover` to find.
    Raises RecordingError: wrong name, no such folder, not writable, disk full, being recorded by another.
    """
    folder = target.parent
    if target.suffix != ".rrd":
        raise RecordingError(f"{target}: the name of a recording must end in .rrd")
    if target.is_dir():
        raise RecordingError(f"{target}: is a folder; a file name is needed")
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; create it or record elsewhere")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(f"{folder}: not writable; record elsewhere")
    free = free_bytes(folder)
    if free < min_free_bytes:
        raise RecordingError(
            f"{folder}: {free / 1e6:.0f} MB free, {min_free_bytes / 1e6:.0f} MB are needed to record; free some space"
        )
    part = part_of(target)
    try:
        lock = FileLock.acquire(lock_path(part))
    except OSError as error:
        raise RecordingError(f"{folder}: cannot record there: {error.strerror}") from error
    if lock is None:
        raise RecordingError(f"{target}: is being recorded already; choose another name")
    if part.exists():
        part.rename(free_name(folder, f"{target.stem}-interrupted", ".rrd.part"))
    return lock


# --- with what settings a recording was made, and where each of its measurements stands on sim_time -------------------


def configured(
    settings: Mapping[str, Any], names: Sequence[str], times: Sequence[NDArray[np.float64]], shifts: Sequence[float]
) -> Facts:
    """names, times, s, and what was added to them, s: of the measurements."""
    facts = {name: str(value) for name, value in settings.items() if value not in (None, [], "")}
    for i, (name, time, shift) in enumerate(zip(names, times, shifts), 1):
        moved = f", moved by {shift:.4g} s" if shift else ""
        facts[f"recording {i}"] = f"{name}: {time[0]:.4g} … {time[-1]:.4g} s{moved}"
    return Facts(facts)


# --- rerun's own command line program, run without its telemetry ------------------------------------------------------


def rerun_binary() -> Path:
    """The program in the installed package.  Its Python wrapper would leave it running when it is stopped itself."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is not None and spec.origin is not None:
        path = Path(spec.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
        if path.is_file():
            return path
    raise RecordingError("the program of rerun-sdk is missing; install rerun-sdk again")


@contextmanager
def started(*arguments: str, output: IO[bytes] | None = None) -> Iterator[subprocess.Popen[str]]:
    """The program running, its messages on `stderr`; stopped at the end if it has not ended by itself.

    output: as of `run`.
    """
    with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
        # Analytics are on unless a configuration says otherwise; this one is ours alone.
        settings = Path(folder, "rerun", "analytics.json")
        settings.parent.mkdir()
        settings.write_text(json.dumps({"analytics_enabled": False, "analytics_id": "none", "metadata": {}}))
        environment = os.environ | {"XDG_CONFIG_HOME": folder, "NO_COLOR": "1"}
        process = start_program(
            [str(rerun_binary()), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL if output is None else output,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=environment,
        )
        try:
            yield process
        finally:
            process.kill()
            process.communicate()


def run(*arguments: str, timeout_s: float, output: IO[bytes] | None = None) -> None:
    """Runs it to its end; RecordingError with its last message if it fails or takes longer.

    output: a file for what it prints.
    """
    with started(*arguments, output=output) as process:
        try:
            _, messages = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            raise RecordingError(f"rerun {' '.join(arguments[:2])} took more than {timeout_s:g} s") from None
    if process.returncode != 0:
        lines = messages.strip().splitlines() or [f"exit code {process.returncode}"]
        raise RecordingError(f"rerun {' '.join(arguments[:2])} failed: {lines[-1].strip()}")


# --- the chunks of a Rerun file whose damage would end this process, looked at by a program of its own first ----------

_TIMEOUT_S = 120.0
_NUL, _NUL_IN_A_TYPE = b"\0", b"\\0"  # as the program prints a name, and one within a type


def sound_chunks(path: Path, content: str | None = None) -> Iterator[Any]:
    """The chunks of a file (rerun.chunk.Chunk), of all entities or of one; RecordingError where they are no whole ones.

    Raises, too, whatever the native reader makes of damage that it survives.
    """
    try:
        run("rrd", "verify", str(path), timeout_s=_TIMEOUT_S)
        with tempfile.TemporaryFile() as described:
            run("rrd", "print", "-vv", str(path), timeout_s=_TIMEOUT_S, output=described)
            sound = not _has_nul(described)
    except RecordingError:  # its last line is about itself, or advice for its makers
        sound = False
    if not sound:
        raise RecordingError("its contents cannot be decoded")
    from rerun.chunk import RrdReader

    stream = RrdReader(path).stream()
    return iter(stream if content is None else stream.filter(content=content))


def _has_nul(described: IO[bytes]) -> bool:
    described.seek(0)
    return any(_NUL in line or (b" type: " in line and _NUL_IN_A_TYPE in line) for line in described)


# --- what a recording says of itself in a list: its settings and what was found ---------------------------------------


@dataclass(frozen=True)
class Entry:
    """One recording of the folder."""

    name: str
    at: datetime
    size_bytes: int
    settings: dict[str, Any] = field(default_factory=dict)  # of an identification; empty for others
    found: dict[str, dict[str, Any]] = field(default_factory=dict)  # its answers by algorithm
    best: str | None = None  # the algorithm to believe
    kind: str = "run"  # identification, discovery, comparison …
    says: str = ""  # what came of it, in a line

    @property
    def answer(self) -> dict[str, Any] | None:
        """The best answer: k, rmse_A, corrected_rmse_A (not in older files), error_percent, evaluations, elapsed_s,
        healthy, alarms, stopped.
        """
        return self.found.get(self.best or "")


def error_key(*answers: Mapping[str, Any] | None) -> str:
    """Of the error by which answers are compared: the corrected one where all of them have it."""
    have = all(answer.get("corrected_rmse_A") is not None for answer in answers if answer)
    return "corrected_rmse_A" if have else "rmse_A"


def error_said(answer: Mapping[str, Any], *others: Mapping[str, Any]) -> str:
    """An answer's error, by the key that it shares with others."""
    key = error_key(answer, *others)
    return f"{'corrected' if key == 'corrected_rmse_A' else 'uncorrected'} error {amount(answer[key], 'A')}"


def setting(name: str, value: Any) -> tuple[str, str]:
    """A setting as a person reads it: ('amplitude', '5.00 mrad') of ('amplitude_rad', '0.005')."""
    told = _told(value, unit_of(name))
    if name == "algorithms":
        told = ", ".join(algorithm_title(one) for one in told.split(", "))
    return in_sentence(parameter_title(name)), told


def _told(value: Any, unit: str) -> str:
    """A recording keeps its settings as text."""
    try:
        read = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return str(value)
    if isinstance(read, bool) or not isinstance(read, int | float):
        return ", ".join(map(str, read)) if isinstance(read, list) else str(value)
    if isinstance(read, int) and not unit:
        return str(read)
    return amount(read, unit) if unit else number(read)


# --- one .rrd file while it is written: its stream, its lock, its failures and its end --------------------------------

_FLUSH_TIMEOUT_S = 5.0


class RrdFile:
    """Grows as NAME.rrd.part, becomes NAME.rrd when closed; whatever had that name stays until then.

    `failed` is None, or one line that says why nothing more is written.
    """

    def __init__(self, path: Path, name: str, min_free_bytes: int) -> None:
        """Raises RecordingError if it cannot start."""
        self.path = path
        self.part = part_of(path)
        self.failed: str | None = None
        self.lock = threading.RLock()
        self._min_free_bytes = min_free_bytes
        self._closed = False
        self._sound = True  # whether what is in the part can be finished to a whole file
        self._owner = claim(path, min_free_bytes)
        try:
            self._stream = self._start(name)
        except Exception as error:
            self.part.unlink(missing_ok=True)
            self._owner.release()
            raise RecordingError(f"{path}: cannot be recorded: {_one_line(error)}") from error

    def _start(self, name: str) -> rr.RecordingStream:
        stream = rr.RecordingStream(APPLICATION, recording_id=str(uuid.uuid4()))
        # With its own two timelines off and no call to set_time, data has the times we give and no others.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        stream.save(self.part)
        if not self.part.exists():
            raise OSError("rerun is turned off; is RERUN=off set in the environment?")
        stream.send_recording_name(name)
        return stream

    @property
    def writing(self) -> bool:
        """Whether calls still have an effect."""
        return not self._closed and self.failed is None

    def do(self, action: Callable[[rr.RecordingStream], None]) -> None:
        """Runs what writes, one at a time; an error in it turns the file off instead of being raised."""
        with self.lock:
            if not self.writing:
                return
            try:
                with catch_and_log_exceptions(strict=True):  # without, rerun turns errors into warnings
                    action(self._stream)
            except Exception as error:
                self._sound = False
                self._fail(f"recording stopped: {_one_line(error)}")

    def flush(self) -> None:
        """To the disk, with all that was sent; stops in time, still whole, when the disk runs full."""
        self.do(self._flush)

    def _flush(self, stream: rr.RecordingStream) -> None:
        stream.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        free = free_bytes(self.path.parent)
        if free < self._min_free_bytes // 10:
            self.failed = f"{self.path}: recording stopped: only {free / 1e6:.0f} MB free; free some space"

    def _fail(self, why: str) -> None:
        """The first failure is the one to tell."""
        self.failed = self.failed or f"{self.path}: {why}; what there is: {self.part.name}"

    def close(self, last: Callable[[], None], timeout_s: float) -> None:
        """Does `last`, then finishes the file.  Never raises, and returns within `timeout_s`, about.

        On a full disk rerun may wait for ever: then the part stays, locked until this process ends.
        """
        finisher = threading.Thread(target=self._finish, args=(last,), name="recording-close", daemon=True)
        finisher.start()
        finisher.join(timeout_s if self._sound else min(timeout_s, 2.0))
        if finisher.is_alive():
            self._fail(f"not finished within {timeout_s:g} s")
            rr.unregister_shutdown()  # it would wait as well, and the interpreter could not end

    def _finish(self, last: Callable[[], None]) -> None:
        with self.lock:
            if self._closed:
                return
            self.do(lambda _: last())
            self._closed = True
            try:
                self._stream.disconnect()
                if self._sound:
                    os.replace(self.part, self.path)
            except Exception as error:
                self._fail(f"not finished: {_one_line(error)}")
            del self._stream
            self._owner.release()
        # Each stream leaves two threads behind until this is called.
        rerun_bindings.flush_and_cleanup_orphaned_recordings()


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
