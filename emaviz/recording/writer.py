"""Writes a recording: its file, signals, iterations, text, results."""

from __future__ import annotations

import json
import os
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import ArrayLike, NDArray
from rerun.chunk import Chunk, RrdReader
from rerun.error_utils import catch_and_log_exceptions

from ema_model.files.written import whole_file
from ema_model.identification.run import algorithm_title
from ema_model.text import Block, Facts, Lines, Note, Remarks
from emaviz.recording import blueprint, entry
from emaviz.recording.blueprint import Algorithm, Chart, Contents, build, send
from emaviz.recording.entry import (
    ANSWER,
    APPLICATION,
    ITERATION,
    K_NAMES,
    MIN_FREE_BYTES,
    Colour,
    RecordingError,
    algorithm_path,
    claim,
    free_bytes,
    part_of,
)

# --- one .rrd file while it is written: its stream, its lock, its failures and its end --------------------------------

_FLUSH_TIMEOUT_S = 5.0
_PROPERTIES = "/__properties"  # rerun's own: the recording's name and when it began
_LARGEST_TO_ORDER = 100_000_000  # bytes, which are all in memory then


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
        stream = _new_stream(str(uuid.uuid4()))
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

    def close(self, last: Callable[[], rrb.Blueprint], timeout_s: float) -> None:
        """Does `last`, then finishes the file, with the layout it gives and what that shows first at the beginning.

        Never raises, and returns within `timeout_s`, about.

        On a full disk rerun may wait for ever: then the part stays, locked until this process ends.
        """
        finisher = threading.Thread(target=self._finish, args=(last,), name="recording-close", daemon=True)
        finisher.start()
        finisher.join(timeout_s if self._sound else min(timeout_s, 2.0))
        if finisher.is_alive():
            self._fail(f"not finished within {timeout_s:g} s")
            rr.unregister_shutdown()  # it would wait as well, and the interpreter could not end

    def _finish(self, last: Callable[[], rrb.Blueprint]) -> None:
        with self.lock:
            if self._closed:
                return
            layouts: list[rrb.Blueprint] = []
            self.do(lambda _: layouts.append(last()))
            self._closed = True
            try:
                self._stream.disconnect()
                if self._sound and layouts:
                    self._put_in_order(layouts[0])
                if self._sound:
                    os.replace(self.part, self.path)
            except Exception as error:
                self._fail(f"not finished: {_one_line(error)}")
            del self._stream
            self._owner.release()
        # Each stream leaves two threads behind until this is called.
        rerun_bindings.flush_and_cleanup_orphaned_recordings()

    def _put_in_order(self, layout: rrb.Blueprint) -> None:
        """Rewrites the part in the order in which it is looked at; where that is not possible, it stays as it is.

        A viewer shows what it has read so far: in the order of writing, the answer and the layout would come last.
        """
        size = self.part.stat().st_size
        if size > _LARGEST_TO_ORDER or free_bytes(self.path.parent) < size + self._min_free_bytes // 10:
            return
        # Rerun has many errors, and the part is whole.
        with suppress(Exception), whole_file(self.part) as ordered, catch_and_log_exceptions(strict=True):
            reader = RrdReader(self.part)
            chunks = sorted(reader.stream().to_chunks(), key=_place)
            stream = _new_stream(reader.recordings()[0].recording_id, send_properties=False)
            stream.save(ordered)
            send(stream, layout)
            stream.send_chunks(chunks)
            stream.flush(timeout_sec=_FLUSH_TIMEOUT_S)
            stream.disconnect()


def _place(chunk: Chunk) -> int:
    """Its name and the answer, the rest of what has no time, what goes over iterations, and signals over time."""
    if chunk.is_static:
        return 0 if chunk.entity_path.startswith((ANSWER, _PROPERTIES)) else 1
    return 2 if ITERATION in chunk.timeline_names else 3


def _new_stream(recording_id: str, *, send_properties: bool = True) -> rr.RecordingStream:
    stream = rr.RecordingStream(APPLICATION, recording_id=recording_id, send_properties=send_properties)
    # With its own two timelines off and no call to set_time, data has the times we give and no others.
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


# --- what a result says, and mappings, as Markdown --------------------------------------------------------------------

_SIGNS = str.maketrans({"|": r"\|", "\n": " ", "\r": " ", "`": "'", "<": "&lt;", "[": r"\[", "*": r"\*", "_": r"\_"})


def escaped(value: object) -> str:
    """Text that Markdown shows as it is, and that cannot break a table."""
    return str(value).translate(_SIGNS)


def written(title: str, blocks: Iterable[Block]) -> str:
    """A heading, and the blocks of a document below it."""
    return "\n\n".join([f"# {escaped(title)}", *map(_block, blocks)]) + "\n"


def _block(block: Block) -> str:
    if isinstance(block, Lines):
        return "\n\n".join([*_head(block.title), *map(escaped, block.lines)])
    if isinstance(block, Note):
        return f"- ⚠ {escaped(block.line)}"
    if isinstance(block, Remarks):
        return "\n".join(f"- **{escaped(one.head)}**: {escaped(one.line)}" for one in block.remarks)
    if isinstance(block, Facts):
        rows = _rows(["", ""], list(block.facts.items()))
        return "\n\n".join([*_head(block.title), rows, *map(escaped, block.lines)])
    remarks = block.remarks or [""] * len(block.rows)
    beside = [block.unit] if block.unit or any(remarks) else []
    rows = [[*row, *([remark] if beside else [])] for row, remark in zip(block.rows, remarks)]
    return _rows([block.title, *block.head, *beside], rows)


def _head(title: str) -> list[str]:
    return [f"## {escaped(title)}"] if title else []


def _rows(head: Sequence[object], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, *rows]
    written = [f"| {' | '.join(escaped(cell) for cell in line)} |" for line in lines]
    return "\n".join([written[0], "|---" * len(head) + "|", *written[1:]])


def table(title: str, values: Mapping[str, Any]) -> str:
    """A heading and a table of two columns; a cell's line breaks and bars cannot break the table."""
    rows = "".join(f"| {_cell(name)} | {_cell(value)} |\n" for name, value in values.items())
    return f"# {_cell(title)}\n\n| quantity | value |\n|---|---|\n{rows}"


def _cell(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return " ".join(text.replace("|", "\\|").split())


# --- how each plotted entity is drawn: a static line or point style beside its values ---------------------------------

Style = rr.SeriesLines | rr.SeriesPoints


def signal_style(group: str, name: str) -> Style:
    """A signal's line: colour of its group, name with unit."""
    return line(entry.series_title(group, name), entry.signal_colour(group, name), entry.GROUP_WIDTHS[group])


def monitor_style(index: int) -> Style:
    """The monitor's current on an iteration: the later, the more the monitor's own colour."""
    return line(f"MM iteration {index} [A]", entry.iteration_colour(index), 1.2)


def iteration_style(path: str) -> Style:
    """The style of an entity over iterations, by its place under /identification/<algorithm>/."""
    _, _, algorithm, kind, *rest = path.split("/")
    colour, title = entry.algorithm_colour(algorithm), algorithm_title(algorithm)
    name = rest[0] if rest else ""
    if kind == "population":
        return rr.SeriesPoints(
            names=f"population {name}", colors=[entry.POPULATION_COLOUR], markers="circle", marker_sizes=[1.3]
        )
    if kind == "interval":
        return rr.SeriesPoints(names=f"90 % interval {name}", colors=[colour], markers="diamond", marker_sizes=[5.0])
    if kind == "best":
        return line(f"{title} best {name} [-]", colour, 2.5)
    if kind == "truth":
        return line(f"true {name} [-]", entry.TRUTH_COLOUR, 2.0)
    # Series of one name share an entry of the legend; the logarithm's plot says in its title what they are.
    which = "corrected" if kind == "corrected_error" else "uncorrected"
    if kind == "log10_rmse":
        title = f"{title}, uncorrected"
    return line(title if kind.startswith("log10") else f"{title}, {which} error of the best [A]", colour, 2.0)


def line(name: str, colour: Colour, width: float) -> Style:
    # The default aggregation averages, which hides the chopping ripple's peaks.
    return rr.SeriesLines(names=name, colors=[colour], widths=[width], aggregation_policy="MinMax")


# --- iterations of an identification, gathered so that they are sent a column at a time and not a row -----------------

Array = NDArray[np.float64]
Column = tuple[str, list[rr.TimeColumn], Any]


class IterationBuffer:
    """Rows of one algorithm that are not yet sent.  Not thread safe."""

    def __init__(self, algorithm: str, widest: int = 0) -> None:
        """widest: of the populations that were sent before."""
        self.widest = widest
        self._path = algorithm_path(algorithm)
        self._index: list[int] = []
        self._rmse: list[float] = []
        self._best: list[Array] = []
        self._population: list[tuple[int, Array]] = []
        self._population_rmse: list[tuple[int, Array]] = []

    def __len__(self) -> int:
        return len(self._index)

    def add(
        self,
        index: int,
        rmse: float,
        best: ArrayLike,
        population: ArrayLike | None,
        population_rmse: ArrayLike | None,
    ) -> None:
        """Keeps copies: best (8,), population (N, 8), population_rmse (N,).  ValueError on another shape."""
        best = np.array(best, dtype=float)
        if best.shape != (8,):
            raise ValueError(f"best k must have the shape (8,), not {best.shape}")
        row, error = int(index), float(rmse)
        if population is not None:
            individuals = np.array(population, dtype=float)
            if individuals.ndim != 2 or individuals.shape[1] != 8:
                raise ValueError(f"the population must have the shape (N, 8), not {individuals.shape}")
            self._population.append((row, individuals))
            self.widest = max(self.widest, len(individuals))
        if population_rmse is not None:
            self._population_rmse.append((row, np.array(population_rmse, dtype=float).reshape(-1)))
        self._index.append(row)
        self._rmse.append(error)
        self._best.append(best)

    def columns(self, truth: Array | None) -> Iterator[Column]:
        """Path, times and columns for `send_columns`: all rows of an entity at once.

        truth (8,) is repeated along the iterations, since a plot cannot draw what has no time.
        """
        index, rmse, best = self._index, np.array(self._rmse), np.array(self._best)
        time = _time(index)
        yield f"{self._path}/rmse", time, rr.Scalars.columns(scalars=rmse)
        yield f"{self._path}/log10_rmse", time, rr.Scalars.columns(scalars=log10(rmse))
        for j, k in enumerate(K_NAMES):
            yield f"{self._path}/best/{k}", time, rr.Scalars.columns(scalars=best[:, j])
            if truth is not None:
                yield f"{self._path}/truth/{k}", time, rr.Scalars.columns(scalars=np.full(len(index), truth[j]))
        if self._population:
            for j, k in enumerate(K_NAMES):
                rows = [(i, _padded(individuals[:, j], self.widest)) for i, individuals in self._population]
                yield f"{self._path}/population/{k}", *_ragged(rows)
        if self._population_rmse:
            yield f"{self._path}/population/rmse", *_ragged(self._population_rmse)


def log10(errors: Array) -> Array:
    """For plots, which have no logarithmic axis; NaN where there is none."""
    return np.log10(np.where(np.isfinite(errors) & (errors > 0.0), errors, np.nan))


def _time(index: list[int]) -> list[rr.TimeColumn]:
    return [rr.TimeColumn(ITERATION, sequence=np.array(index, dtype=np.int64))]


def _padded(values: Array, count: int) -> Array:
    """With no numbers behind: the viewer complains of a plot whose rows become shorter."""
    return np.pad(values, (0, count - len(values)), constant_values=np.nan)


def _ragged(rows: list[tuple[int, Array]]) -> tuple[list[rr.TimeColumn], Any]:
    """One row per iteration, of as many values as the population then had."""
    values = np.concatenate([values for _, values in rows])
    lengths = [len(values) for _, values in rows]
    return _time([i for i, _ in rows]), rr.Scalars.columns(scalars=values).partition(lengths)


# --- writes one recording: signals, identifications, configuration, and the layout in which it opens ------------------

_ROWS_PER_CHUNK = 25
_FLUSH_EVERY_S = 0.25
_MODEL = entry.GROUP_COLOURS["monitor"]


class RecordingWriter:
    """One .rrd file.  Grows as NAME.rrd.part and becomes NAME.rrd when closed; an older NAME.rrd stays until then.

    Methods may be called from any thread.  A failure to write turns the writer off: `failed` then says why in one
    line, later calls do nothing, and nothing is raised into the work being recorded; what was written stays in the
    part, for `recover`.  A wrong shape or name is the caller's mistake and raises ValueError.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        name: str | None = None,
        min_free_bytes: int = MIN_FREE_BYTES,
        close_timeout_s: float = 10.0,
    ) -> None:
        """name: what the viewer calls the recording, else the file's name.

        Raises RecordingError if it cannot start: no such folder, disk full, being recorded already.
        """
        self.path = Path(path)
        self._file = RrdFile(self.path, name or self.path.stem, min_free_bytes)
        self._close_timeout_s = close_timeout_s
        self._contents = Contents()
        self._expected: Contents | None = None  # as far as the file is arranged for it already
        self._styled: set[str] = set()
        self._truth: NDArray[np.float64] | None = None
        # Iterations come fast: they only go through this gate, and a thread of their own sends them.
        self._gate = threading.Lock()
        self._buffers: dict[str, IterationBuffer] = {}
        self._widest: dict[str, int] = {}  # populations by algorithm
        self._last_algorithm: str | None = None
        self._wake = threading.Event()
        self._ending = False
        self._flusher: threading.Thread | None = None

    @property
    def failed(self) -> str | None:
        """None, or one line that says why nothing more is written."""
        return self._file.failed

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def config(self, text_markdown: str) -> None:
        """The configuration, shown as text."""
        with self._file.lock:
            self._contents.config = True
            self._text("/config", text_markdown)

    def properties(self, values: Mapping[str, Any]) -> None:
        """Facts about the recording by name: whatever JSON can hold, and arrays."""
        # As text, because rerun holds a name to the type that it had first in this process.
        bundle = rr.AnyValues()
        for name, value in values.items():
            bundle.with_component_from_data(str(name), json.dumps(value, default=_for_json))
        self._file.do(lambda stream: stream.send_property(entry.PROPERTIES, bundle))

    def signals(self, group: str, time_s: ArrayLike, signals: Mapping[str, ArrayLike]) -> None:
        """Signals (n,) by canonical name at time_s (n,), of reference, monitor, measurement or residual."""
        if group not in entry.GROUPS:
            raise ValueError(f"no group {group!r}; groups are {', '.join(entry.GROUPS)}")
        time, count = _durations(time_s)
        arrays = {entry.plain(name): _column(name, values, count) for name, values in signals.items()}
        with self._file.lock:
            names = self._contents.signals.setdefault(group, [])
            for name, values in arrays.items():
                if name not in names:
                    names.append(name)
                self._send(f"/{group}/{name}", signal_style(group, name), time, values)
            self.flush()

    def gap(self, group: str, name: str, time_s: float) -> None:
        """Ends a signal's line there, so that none is drawn to the value that follows."""
        time, _ = _durations([time_s])
        clear = rr.Clear.columns(is_recursive=[False])
        self._file.do(lambda stream: stream.send_columns(f"/{group}/{name}", time, clear))

    def truth(self, k: ArrayLike) -> None:
        """The true k (8,), if known: static values, and a line beside every identified k from now on."""
        truth = _column("k", k, len(entry.K_NAMES))
        with self._file.lock:
            self._truth, self._contents.truth = truth, True
            for name, value in zip(entry.K_NAMES, truth, strict=True):
                scalar = rr.Scalars(value)
                self._file.do(lambda stream, n=name, s=scalar: stream.log(f"/truth/{n}", s, static=True))

    def iteration(
        self,
        algorithm: str,
        index: int,
        rmse: float,
        best_k: ArrayLike,
        population_k: ArrayLike | None = None,
        population_rmse: ArrayLike | None = None,
    ) -> None:
        """One iteration: the best rmse (A) and k (8,) so far, the population's k (N, 8) and rmse (N,).

        Gathered, and written in chunks within about a quarter of a second.
        """
        if not self._file.writing:
            return
        with self._gate:
            buffer = self._buffers.get(algorithm) or IterationBuffer(algorithm, self._widest.get(algorithm, 0))
            buffer.add(index, rmse, best_k, population_k, population_rmse)
            self._buffers[algorithm], self._widest[algorithm] = buffer, buffer.widest
            self._last_algorithm = algorithm
            if len(buffer) >= _ROWS_PER_CHUNK:
                self._wake.set()
            if self._flusher is None:
                self._flusher = threading.Thread(target=self._flush_regularly, name="recording-flush", daemon=True)
                self._flusher.start()

    def corrected(self, algorithm: str, errors_A: ArrayLike) -> None:
        """The corrected error of the best after each iteration (n,), from 0 on, once it is known.

        In the plot it takes the place of the uncorrected one, which a static value hides there.
        """
        errors = np.asarray(errors_A, dtype=float)
        time = [rr.TimeColumn(entry.ITERATION, sequence=np.arange(len(errors)))]
        root = entry.algorithm_path(algorithm)
        with self._file.lock:
            self._file.do(lambda stream: stream.log(f"{root}/log10_rmse", rr.Scalars([]), static=True))
            for kind, values in (("corrected_error", errors), ("log10_corrected_error", log10(errors))):
                self._send(f"{root}/{kind}", iteration_style(f"{root}/{kind}"), time, values)

    def monitor_iteration(self, algorithm: str, index: int, time_s: ArrayLike, current_A: ArrayLike) -> None:
        """The best individual's current (n,) at time_s (n,) on this iteration."""
        time, count = _durations(time_s)
        current = _column("current_A", current_A, count)
        with self._file.lock:
            self._algorithm(algorithm).monitor = True
            self._send(entry.monitor_iteration_path(algorithm, index), monitor_style(index), time, current)

    def fit(self, signal: str, time_s: ArrayLike, measured: ArrayLike, algorithms: Sequence[str]) -> None:
        """The measured curve (n,) of a signal that `fit_iteration` draws a model beside, and its axes."""
        chart = Chart.of(signal, time_s, measured)
        drawn = blueprint.measured(chart.strip(time_s, measured))
        with self._file.lock:
            self._contents.charts[entry.plain(signal)] = chart
            self._file.do(lambda stream: chart.log_axes(stream, blueprint.axes_path(signal)))
            for path in [blueprint.fit_path(name, signal, "measured") for name in algorithms]:
                self._file.do(lambda stream, path=path: stream.log(path, drawn, static=True))

    def fit_iteration(self, algorithm: str, index: int, signal: str, time_s: ArrayLike, values: ArrayLike) -> None:
        """The best individual's curve (n,) on this iteration; `fit` has given the signal its axes."""
        colour = entry.algorithm_colour(algorithm)
        columns = blueprint.model_columns(self._contents.charts[signal].strip(time_s, values), colour)
        path, time = blueprint.fit_path(algorithm, signal, "model"), [rr.TimeColumn(entry.ITERATION, sequence=[index])]
        self._file.do(lambda stream: stream.send_columns(path, time, columns))

    def curve(self, signal: str, which: str, time_s: ArrayLike, values: ArrayLike) -> None:
        """A signal over time as a static curve, "measured" or "model"; the first of a signal gives it its axes."""
        with self._file.lock:
            chart = self._contents.curves.get(signal)
            if chart is None:
                chart = self._contents.curves[entry.plain(signal)] = Chart.of(signal, time_s, values)
                self._file.do(lambda stream: chart.log_axes(stream, f"{blueprint.CURVES}/{signal}"))
            points = chart.strip(time_s, values)
            drawn = blueprint.measured(points) if which == "measured" else blueprint.model(points, _MODEL)
            self._file.do(lambda stream: stream.log(f"{blueprint.CURVES}/{signal}/{which}", drawn, static=True))

    def answer(self, markdown: str) -> None:
        """The answer in words, on the dashboard."""
        with self._file.lock:
            self._contents.answer = True
            self._text(entry.ANSWER, markdown)

    def finding(self, name: str, markdown: str) -> None:
        """What a comparison found, in words: a document at /comparison/NAME, shown where it fails."""
        with self._file.lock:
            if entry.plain(name) not in self._contents.findings:
                self._contents.findings.append(name)
            self._text(f"{entry.COMPARISON}/{name}", markdown)

    def interval(self, algorithm: str, index: int, ends: ArrayLike) -> None:
        """The interval (8, 2) of each k at the last iteration."""
        ends = np.asarray(ends, dtype=float)
        time = [rr.TimeColumn(entry.ITERATION, sequence=[index])]
        for row, k in enumerate(entry.K_NAMES):
            path = f"{entry.algorithm_path(algorithm)}/interval/{k}"
            columns = rr.Scalars.columns(scalars=ends[row]).partition([2])
            self._send_columns(path, iteration_style(path), time, columns)

    def result(self, values: Mapping[str, Any], algorithm: str | None = None) -> None:
        """The answer, as a table; `algorithm` can be left out if its iterations came before."""
        with self._file.lock:
            algorithm = algorithm or self._last_algorithm
            if algorithm is None:
                raise ValueError("a result needs its algorithm's name when no iteration came before it")
            self._algorithm(algorithm).result = True
            self._text(
                f"{entry.algorithm_path(algorithm)}/result",
                table(f"Result of {algorithm_title(algorithm)}", values),
            )

    def expect(self, signals: Mapping[str, Sequence[str]], algorithms: Sequence[str]) -> None:
        """Arranges the file now for what will come, so that a viewer that follows it is arranged from the start.

        signals: names by group, in the order in which they will come.
        """
        with self._file.lock:
            self._expected = Contents(
                signals={group: list(names) for group, names in signals.items()},
                algorithms={name: Algorithm(iterations=True, result=True) for name in algorithms},
                config=self._contents.config,
                charts=dict(self._contents.charts),
                curves=dict(self._contents.charts | self._contents.curves),
                answer=True,
                truth=self._contents.truth,
            )
            self._file.do(lambda stream: send(stream, build(self._expected or Contents())))

    def flush(self) -> None:
        """Brings everything so far to the file."""
        self._file.do(lambda _: self._send_iterations())
        self._file.flush()

    def close(self) -> None:
        """Finishes the file under its own name; never hangs, never raises, and a second call does nothing."""
        self._ending = True
        self._wake.set()
        self._file.close(self._last, self._close_timeout_s)

    def _last(self) -> rrb.Blueprint:
        self.flush()
        layout = self._layout()
        # Only now is it known what to arrange; the viewer would stumble through several layouts in one file.
        if self._contents != self._expected:
            self._file.do(lambda stream: send(stream, layout))
        return layout

    def _layout(self) -> rrb.Blueprint:
        """How what is in the file opens."""
        return build(self._contents)

    def _flush_regularly(self) -> None:
        while not self._ending:
            self._wake.wait(_FLUSH_EVERY_S)
            self._wake.clear()
            if self._buffers:
                self.flush()

    def _send_iterations(self) -> None:
        with self._gate:
            taken, self._buffers = self._buffers, {}
        for algorithm, buffer in taken.items():
            self._algorithm(algorithm).iterations = True
            for path, time, columns in buffer.columns(self._truth):
                self._send_columns(path, iteration_style(path), time, columns)

    def _algorithm(self, name: str) -> Algorithm:
        return self._contents.algorithms.setdefault(entry.plain(name), Algorithm())

    def _text(self, path: str, markdown: str) -> None:
        document = rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN)
        self._file.do(lambda stream: stream.log(path, document, static=True))
        self.flush()

    def _send(self, path: str, drawn: Style, time: list[rr.TimeColumn], values: NDArray[np.float64]) -> None:
        self._send_columns(path, drawn, time, rr.Scalars.columns(scalars=values))

    def _send_columns(self, path: str, drawn: Style, time: list[rr.TimeColumn], columns: Any) -> None:
        """Values, and the first time how to draw them."""
        if path not in self._styled:
            self._styled.add(path)
            self._file.do(lambda stream: stream.log(path, drawn, static=True))
        self._file.do(lambda stream: stream.send_columns(path, time, columns))


def _durations(time_s: ArrayLike) -> tuple[list[rr.TimeColumn], int]:
    """The column of sim_time and its length; rounded to ns, as rerun itself would cut off."""
    seconds = np.asarray(time_s, dtype=float)
    if seconds.ndim != 1 or not np.isfinite(seconds).all():
        raise ValueError(f"times must be finite and of the shape (n,), not {seconds.shape}")
    nanoseconds = np.rint(seconds * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(entry.SIM_TIME, duration=nanoseconds)], len(seconds)


def _column(name: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
    array = np.array(values, dtype=float)
    if array.shape != (count,):
        raise ValueError(f"{name} must have the shape ({count},), not {array.shape}")
    return array


def _for_json(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
