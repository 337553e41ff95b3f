"""A recording read back into arrays, also one that was cut off."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ema_model.child_processes import start_program
from ema_model.errors import InputError
from ema_model.files.opened import check_user_file, open_user_file
from ema_model.files.written import FileLock, lock_path, whole_file
from emaviz.recording.entry import (
    APPLICATION,
    GROUPS,
    ITERATION,
    K_NAMES,
    PROPERTIES,
    SIM_TIME,
    RecordingError,
    free_name,
)

# --- reads a recording back into arrays -------------------------------------------------------------------------------

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


Array = NDArray[np.float64]
_MAGIC = b"RRF"
_REPAIR_TIMEOUT_S = 120.0


class Series(NamedTuple):
    """A signal: values (n,) at time_s (n,)."""

    time_s: Array
    values: Array


@dataclass
class IdentificationTrace:
    """The iterations of one algorithm, in order."""

    iteration: NDArray[np.int64]  # (n,)
    rmse: Array  # (n,), A, uncorrected
    best: Array  # (n, 8)
    population: Array | None  # (m, N, 8) on the m iterations that have one; NaN where it was smaller than N
    population_rmse: Array | None  # (m, N), A
    monitor: dict[int, Series]  # current, A, of the best individual by iteration
    result: str | None  # Markdown
    corrected: Array | None = None  # (m,), A, of the same iterations; of a search that has ended


@dataclass
class Recording:
    """What a recording holds."""

    path: Path
    signals: dict[str, dict[str, Series]] = field(default_factory=dict)
    identification: dict[str, IdentificationTrace] = field(default_factory=dict)
    truth: Array | None = None  # (8,)
    config: str | None = None  # Markdown
    properties: dict[str, Any] = field(default_factory=dict)
    name: str | None = None
    complete: bool = True  # False: damaged, and read up to the damage

    @property
    def groups(self) -> list[str]:
        """The groups of signals that are in the file."""
        return list(self.signals)


def check(path: str | Path) -> Path:
    """The path, if there is a file that starts like a recording; RecordingError with one line otherwise."""
    path = Path(path)
    try:
        with open_user_file(path, "a .rrd file") as file:
            start = file.read(4)
    except InputError as error:
        raise RecordingError(str(error)) from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    if not start.startswith(_MAGIC):
        raise RecordingError(f"{path}: is {'empty' if not start else 'no Rerun recording'}; a .rrd file is needed")
    return path


def read(path: str | Path) -> Recording:
    """Everything in the file.

    A file without its end (its writer was killed) is read as far as it goes; one that is damaged is first repaired
    in a copy, the file itself is left alone.  RecordingError: missing, no recording, or past repair.
    """
    path = check(path)
    try:
        return _Chunks(path).recording(path)
    except Exception as error:  # the reader raises whatever its native part makes of the damage
        first = error
    with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
        copy = Path(folder, "repaired.rrd")
        try:
            repair(path, copy)
            recording = _Chunks(copy).recording(path)
        except Exception:
            why = " ".join(str(first).split())
            raise RecordingError(f"{path}: is damaged and cannot be repaired: {why}") from first
    recording.complete = False
    return recording


def properties(path: str | Path) -> dict[str, Any]:
    """What `RecordingWriter.properties` has written, without reading the rest; RecordingError as in `read`."""
    path = check(path)
    found: dict[str, Any] = {}
    try:
        for chunk in sound_chunks(path, f"/__properties/{PROPERTIES}"):
            batch = chunk.to_record_batch()
            for name in batch.schema.names[1:]:
                for value in filter(None, batch.column(name).to_pylist()):
                    found[name] = json.loads(value[0])
    except Exception as error:  # whatever the native part makes of damage
        raise RecordingError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    return found


def repair(source: Path, target: Path, layout: Path | None = None) -> None:
    """Writes what can be read of `source` to `target` as a whole file.  RecordingError if that is nothing.

    layout: a file of a blueprint (.rbl) to go with it.
    """
    from rerun.chunk import RrdReader

    sources = [str(path) for path in (source, layout) if path is not None]
    run("rrd", "optimize", *sources, "-o", str(target), timeout_s=_REPAIR_TIMEOUT_S)
    if not target.is_file() or not RrdReader(target).recordings():
        raise RecordingError(f"{source}: nothing in it can be read")


class _Chunks:
    """All columns of a file by entity path, put together from its chunks."""

    def __init__(self, path: Path) -> None:
        self.static: dict[str, dict[str, list]] = defaultdict(dict)
        self._rows: dict[str, list[tuple[NDArray, NDArray[np.int64], Array]]] = defaultdict(list)
        newest: dict[tuple[str, str], bytes] = {}
        for chunk in sound_chunks(path):
            batch = chunk.to_record_batch()
            if not chunk.is_static:
                self._add(str(chunk.entity_path), batch)
                continue
            for name in batch.schema.names[1:]:
                for row, value in zip(batch.column(0).to_pylist(), batch.column(name).to_pylist(), strict=True):
                    key = str(chunk.entity_path), name
                    if value is not None and row >= newest.get(key, b""):  # row ids grow with time
                        newest[key] = row
                        self.static[key[0]][name] = value

    def _add(self, path: str, batch: pa.RecordBatch) -> None:
        timeline = next((t for t in (SIM_TIME, ITERATION) if t in batch.schema.names), None)
        if timeline is None or "Scalars:scalars" not in batch.schema.names:
            return
        lists = batch.column("Scalars:scalars")
        times = np.asarray(batch.column(timeline).cast(pa.int64()))
        lengths = np.asarray(lists.value_lengths().fill_null(0), dtype=np.int64)
        self._rows[path].append((times, lengths, np.asarray(lists.flatten(), dtype=float)))

    @property
    def paths(self) -> list[str]:
        """Entities with values over time."""
        return list(self._rows)

    def rows(self, path: str) -> tuple[NDArray[np.int64], Array]:
        """Times (n,) in order, and values (n, widest row), NaN where a row is shorter."""
        parts = self._rows.get(path, [])
        if not parts:
            return np.empty(0, np.int64), np.empty((0, 0))
        times = np.concatenate([part[0] for part in parts])
        lengths = np.concatenate([part[1] for part in parts])
        flat = np.concatenate([part[2] for part in parts])
        values = np.full((len(times), int(lengths.max(initial=0))), np.nan)
        values[np.arange(values.shape[1]) < lengths[:, None]] = flat
        order = np.argsort(times, kind="stable")
        return times[order], values[order]

    def series(self, path: str) -> Series:
        """One value a row, at seconds."""
        times, values = self.rows(path)
        return Series(times / 1e9, values[:, 0])

    def text(self, path: str) -> str | None:
        """A text document."""
        value = self.static.get(path, {}).get("TextDocument:text")
        return value[0] if value else None

    def recording(self, path: Path) -> Recording:
        """All of it, by what it means."""
        found = Recording(path, config=self.text("/config"))
        for group in GROUPS:
            prefix = f"/{group}/"
            signals = {p.removeprefix(prefix): self.series(p) for p in self.paths if p.startswith(prefix)}
            if signals:
                found.signals[group] = signals
        algorithms = dict.fromkeys(p.split("/")[2] for p in self.paths if p.startswith("/identification/"))
        found.identification = {name: self._trace(f"/identification/{name}") for name in algorithms}
        truth = [self.static.get(f"/truth/{k}", {}).get("Scalars:scalars") for k in K_NAMES]
        if all(truth):
            found.truth = np.array([value[0] for value in truth if value], dtype=float)
        properties = self.static.get(f"/__properties/{PROPERTIES}", {})
        found.properties = {name: json.loads(value[0]) for name, value in properties.items()}
        name = self.static.get("/__properties", {}).get("RecordingInfo:name")
        found.name = name[0] if name else None
        return found

    def _trace(self, root: str) -> IdentificationTrace:
        iteration, rmse = self.rows(f"{root}/rmse")
        best = [self.rows(f"{root}/best/{k}")[1] for k in K_NAMES]
        population = [self.rows(f"{root}/population/{k}")[1] for k in K_NAMES]
        population_rmse = self.rows(f"{root}/population/rmse")[1]
        corrected = self.rows(f"{root}/corrected_error")[1]
        prefix = f"{root}/monitor/iteration_"
        monitor = {int(p.removeprefix(prefix).split("/")[0]): p for p in self.paths if p.startswith(prefix)}
        # A file cut short can end between the entities of one chunk: keep what all of them have.
        count = min([len(iteration), *map(len, best)])
        return IdentificationTrace(
            iteration=iteration[:count],
            rmse=rmse[:count].reshape(-1),
            best=np.hstack([values[:count] for values in best]) if count else np.empty((0, 8)),
            population=_stacked(population),
            population_rmse=population_rmse if len(population_rmse) else None,
            monitor={index: self.series(p) for index, p in sorted(monitor.items())},
            result=self.text(f"{root}/result"),
            corrected=corrected.reshape(-1) if len(corrected) else None,
        )


def _stacked(columns: list[Array]) -> Array | None:
    count = min(map(len, columns))
    return np.stack([values[:count] for values in columns], axis=-1) if count else None


# --- repairs recordings that runs left behind when they were killed ---------------------------------------------------

_ENDING = ".rrd.part"


@dataclass(frozen=True)
class Recovered:
    """What became of one part; `path` is the recording, the damaged rest, or None if there was nothing in it."""

    part: Path
    path: Path | None
    message: str  # one line, for the user

    @property
    def ok(self) -> bool:
        """Whether there is a recording now."""
        return self.path is not None and self.path.suffix == ".rrd"

    def __str__(self) -> str:
        return self.message


def recover(folder: str | Path) -> list[Recovered]:
    """Repairs every .rrd.part in the folder whose writer is dead; one entry each, in order of name.

    An existing recording is never overwritten, and a part goes only after its repaired copy was read.  No error is
    raised for a part: it says so in its entry.  RecordingError if there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder")
    found = []
    for part in sorted(path for path in folder.glob(f"*{_ENDING}") if path.is_file()):
        try:
            lock = FileLock.acquire(lock_path(part))
        except OSError as error:
            found.append(Recovered(part, part, f"{part.name}: cannot be recovered: {error.strerror}"))
            continue
        if lock is None:  # still being written
            continue
        try:
            if part.exists():  # its writer may have finished it in the meantime
                found.append(_recover(part))
        except OSError as error:
            found.append(Recovered(part, part, f"{part.name}: cannot be recovered: {error}"))
        finally:
            lock.release()
    return found


def recover_part(part: Path, target: Path, *, replace: bool = False) -> None:
    """Makes the whole recording `target` of one that was cut off, which then goes.

    RecordingError, and all stays as it was: the part is still being written, nothing in it can be read, the target
    exists (unless `replace`) or cannot be written.
    """
    _check_part(part)
    if target.suffix != ".rrd":
        raise RecordingError(f"{target}: the name of a recording must end in .rrd")
    if target.exists() and not replace:
        raise RecordingError(f"{target}: exists already; name another file with --out, or replace it with --force")
    try:
        lock = FileLock.acquire(lock_path(part))
        if lock is None:
            raise RecordingError(f"{part}: is still being written; end what writes it first")
        try:
            with whole_file(target) as draft:
                write_whole(part, draft)
            part.unlink()
        finally:
            lock.release()
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{target}: cannot be written ({error.strerror}); check the folder") from None


def write_whole(part: Path, copy: Path) -> None:
    """Writes what a part holds so far to `copy`, with a layout; RecordingError if that is nothing."""
    _check_part(part)
    try:
        repair(part, copy)
        # The layout comes last in a file, so a run that was killed has none.
        with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
            layout = Path(folder, "layout.rbl")
            _blueprint(read(copy)).save(APPLICATION, layout)
            repair(part, copy, layout)
        read(copy)
    except RecordingError as error:
        raise RecordingError(f"{part}: cannot be repaired: {error}") from None


def _check_part(part: Path) -> None:
    try:
        status = check_user_file(part, "a recording that was cut off (.part)")
    except InputError as error:
        raise RecordingError(str(error)) from None
    if status.st_size == 0:
        raise RecordingError(f"{part}: is empty; there is nothing to recover")


def _recover(part: Path) -> Recovered:
    stem = part.name.removesuffix(_ENDING)
    if part.stat().st_size == 0:
        part.unlink()
        return Recovered(part, None, f"{part.name}: was empty and is removed")
    copy = part.with_name(f"{part.name}.repaired")
    try:
        write_whole(part, copy)
    except RecordingError as error:
        copy.unlink(missing_ok=True)
        damaged = free_name(part.parent, stem, ".rrd.damaged")
        part.rename(damaged)
        return Recovered(part, damaged, f"{error}; kept as {damaged.name}")
    path = _publish(copy, part.with_name(f"{stem}.rrd"))
    part.unlink()
    return Recovered(part, path, f"{path.name}: recovered from a run that was interrupted")


def _blueprint(recording: Recording) -> Any:
    from emaviz.recording.blueprint import Algorithm, Contents, build  # rerun takes a second to import

    contents = Contents(
        signals={group: list(signals) for group, signals in recording.signals.items()},
        algorithms={
            name: Algorithm(bool(len(trace.iteration)), bool(trace.monitor), trace.result is not None)
            for name, trace in recording.identification.items()
        },
        config=recording.config is not None,
    )
    return build(contents)


def _publish(copy: Path, target: Path) -> Path:
    """Gives the copy its name, or the next free one."""
    if target.exists():
        target = free_name(target.parent, f"{target.stem}-recovered", ".rrd")
    os.rename(copy, target)
    return target
