"""Comparing without a screen: files, columns, options, and the comparison."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ema_model.actuator import Actuator, load_actuator
from ema_model.challenges import challenges
from ema_model.comparison.result import Comparison
from ema_model.errors import InputError, quoted
from ema_model.files.opened import refusal, shown
from ema_model.quantities import in_sentence
from ema_model.recordings import SIGNALS, ColumnMapping, Measurement, change_side_file, prepared, read
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.side_file import SideFile
from emaviz.session import files
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.files import Opened, all_measured, guesses, measured, read_opened, side_file_of, side_with
from emaviz.session.jobs import Job, Signal, Tell, Worker, report
from emaviz.session.session_file import Inputs, Provenance, Whole, digest, listed, version_of, version_with_side
from emaviz.session.settings import number

# --- what the screen listens to of Compare ----------------------------------------------------------------------------

OPEN, MAP, LAY_OUT, SAVE = "open", "map", "lay out", "save"  # what is done with files


@dataclass
class CompareEvents:
    """What the screen listens to, besides the job; called on the threads that work, so listeners only hand over."""

    opened: Signal[[Opened]] = field(default_factory=Signal)  # also when mapped or laid out anew
    refused: Signal[[]] = field(default_factory=Signal)  # a layout that does not fit: all is as it was
    failed: Signal[[str, str, str]] = field(default_factory=Signal)  # which of those above, name, why; "": done
    removed: Signal[[]] = field(default_factory=Signal)
    held: Signal[[]] = field(default_factory=Signal)  # other recordings are held out, or proposed to be
    missing: Signal[[str, bool]] = field(default_factory=Signal)  # for a comparison, "": it began; asked for by hand
    compared: Signal[[Comparison]] = field(default_factory=Signal)
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report or a recording is written


# --- a comparison that is asked for is made ---------------------------------------------------------------------------
# A comparison that is asked for is made: once the files on their way are read, and no other long run goes on.


class Asking:
    """What is asked for while it cannot begin waits for its turn, and says for what; what is missing is told."""

    def __init__(
        self,
        job: Job,
        title: Callable[[], str],
        begin: Callable[[], bool],
        chosen: Callable[[], Hashable],
        refused: Callable[[str, bool], object],
        is_known: Callable[[], bool] = lambda: False,
    ) -> None:
        """begin(): False while another long run goes on, InputError for what is missing; chosen(): what it would take.

        refused(why, by_hand): what is missing, or "" once it has begun.  is_known(): whether its answer is there, so
        that only a person has it computed again.
        """
        self._job, self._title, self._begin, self._chosen, self._refused = job, title, begin, chosen, refused
        self._is_known = is_known
        self._reading: set[str] = set()
        self._by_hand = False
        self._running: Hashable = None  # what the run that goes on, or did last, was of
        self._lock = threading.RLock()  # a button and the end of a file are on threads of their own

    @property
    def reading(self) -> list[str]:
        """Names of the files that are being read."""
        with self._lock:
            return sorted(self._reading)

    def reads(self, name: str) -> None:
        """A file is on its way: what is asked for waits for it."""
        with self._lock:
            self._reading.add(name)

    def has_read(self, name: str) -> None:
        """It is read, or refused."""
        with self._lock:
            self._reading.discard(name)

    def ask(self, by_hand: bool) -> None:
        """Compares what is chosen once it can; nothing new while a run of the same goes on.

        by_hand: a person has pressed for it, and did not only add a file.
        """
        with self._lock:
            self._by_hand = by_hand or (self._job.waiting and self._by_hand)
            if not self._same() and (self._waits_for() or not self._try()):
                self._job.begin_in_turn(self._title(), self._try, self._waits_for)

    def _same(self) -> bool:
        return self._job.running and self._chosen() == self._running

    def _try(self) -> bool:
        """Whether there is no more to wait for: it has begun, or cannot."""
        with self._lock:
            if self._same():
                return True
            chosen, by_hand = self._chosen(), self._by_hand
            try:
                begun, why = (self._is_known() and not by_hand) or self._begin(), ""
            except InputError as error:
                begun, why = True, str(error)
            if begun and not why:
                self._running = chosen
        if begun:
            self._refused(why, by_hand)
        return begun

    def _waits_for(self) -> str:
        reading = self.reading
        if not reading:
            return ""
        more = f" and {len(reading) - 1} more" if len(reading) > 1 else ""
        return f"{reading[0]}{more} to be read"


# --- what is done with files on a thread of its own -------------------------------------------------------------------
# What is done with files on a thread of its own: a large one takes seconds, in which the other tabs shall answer.

_CANNOT = {
    OPEN: "The file cannot be read",
    MAP: "These columns cannot be used",
    LAY_OUT: "The text cannot be read like this",
    SAVE: "It cannot be saved",
}


class FileJobs:
    """One after another; what is wrong is told where it was asked for, and to all."""

    def __init__(self, folder: DataFolder, failed: Signal[[str, str, str]], told: Signal[[str, str]]) -> None:
        """failed(what, name, why): "" once it is done; told(title, line): to all."""
        self._folder, self._failed, self._told = folder, failed, told
        self._worker = Worker("emaviz-files", self.on_error)

    def close(self) -> None:
        """Ends the thread."""
        self._worker.close()

    def post(self, what: str, name: str, job: Callable[[], object], ended: Callable[[], object] = lambda: None) -> None:
        """Does one of `_CANNOT` with a file soon; the same of the same file that still waits is dropped."""

        def done() -> None:
            try:
                self._try(what, name, job)
            finally:
                ended()

        self._worker.post(f"{what} {name}", done)

    def on_error(self, error: BaseException) -> None:
        """Of a thread that goes on."""
        report(error, self._told, _CANNOT[SAVE])

    def _try(self, what: str, name: str, job: Callable[[], object]) -> None:
        try:
            job()
        except InputError as error:
            line = self._folder.named_in(str(error))
            self._failed(what, name, line)
            self._told(_CANNOT[what], line)
            return
        self._failed(what, name, "")


# --- recordings that are not fitted, by which a model is judged: which say so themselves, and which suggests itself ---

_SAYS_SO = re.compile(r"(?<![a-z])(unseen|hold[ _-]?out|held([ _-]?out)?|test|validation)(?![a-z])")
_SEVERAL = 3  # recordings, of which one can be spared
_ALIKE = 1e-3  # of a command's span, that a repeated one may differ by


@dataclass(frozen=True)
class HoldOut:
    """A recording that suggests itself."""

    name: str
    why: str  # 'it repeats the command of sine.csv'


def called_held_out(names: Sequence[str]) -> list[str]:
    """Those whose own names say that they are not to be fitted; none where all of them do."""
    found = [name for name in names if _SAYS_SO.search(Path(name).stem.lower())]
    return found if len(found) < len(names) else []


def proposed(measurements: Mapping[str, Measurement]) -> HoldOut | None:
    """Of several by their names: the last one that repeats another's command, else the last; None of few."""
    if len(measurements) < _SEVERAL:
        return None
    names = list(measurements)
    for at in range(len(names) - 1, 0, -1):
        for other in names[:at]:
            if _same_command(measurements[names[at]], measurements[other]):
                return HoldOut(names[at], f"it repeats the command of {Path(other).name}")
    return HoldOut(names[-1], f"it is the last of {len(names)}")


def _same_command(one: Measurement, other: Measurement) -> bool:
    if "command_rad" not in one or "command_rad" not in other or one.samples != other.samples:
        return False
    own, its = one["command_rad"], other["command_rad"]
    return bool(np.max(np.abs(own - its)) <= _ALIKE * np.ptp(own))


# --- the session's part of Compare: files in, their mapping, and comparisons on the compute thread --------------------

MOST_RECORDINGS = 20
EXAMPLE = "after_the_overhaul"  # a challenge
# By their names on a rotary axis.  The speed is mostly the position's difference, so it is not fitted unless asked for.
COMPARABLE = ("current_A", "motor_position_rad", "user_position_rad", "motor_speed_rad_s")
USUAL = {name: 1.0 for name in COMPARABLE[:3]}
_MOST_WEIGHT = 1e3


class Comparing:
    """The chosen recordings, what is asked of the comparison, and the last one."""

    def __init__(self, session: Session, folder: DataFolder) -> None:
        self.session = session
        self.folder = folder
        self.events = CompareEvents()
        self.opened: dict[str, Opened] = {}
        self.comparison: Comparison | None = None
        self.actuator_name = ""
        self.actuator: Actuator = session.actuator
        self.calibrate = True
        self.free: set[str] = set()
        self.weights: dict[str, float] = dict(USUAL)  # of the signals to fit
        self.window_s: tuple[float, float] | None = None
        self.held_out: set[str] = set()  # recordings that are not fitted, by name
        self._decided: set[str] = set()  # those of which somebody has said it
        advice = "check the actuator's file and the measurement's units"
        self.job = Job(session.worker, on_divergence=advice)
        self._files = FileJobs(folder, self.events.failed, session.events.told)
        self.on_error = self._files.on_error
        self.asking = Asking(
            self.job,
            lambda: self._title,
            self.compare,
            self._chosen,
            self.events.missing,
            lambda: self.finished is not None,
        )
        self._use(session.actuator)
        self.provenance = Provenance(
            "the comparison", "Compare", self.inputs, self.job, soon=lambda: self.asking.reading
        )
        self.provenance.whole = Whole(
            lambda: None if self.comparison is None else self.comparison.stored(), self._take_comparison
        )

    def close(self) -> None:
        """Ends the threads."""
        self.job.stop()
        self._files.close()

    @property
    def running(self) -> bool:
        """Whether a comparison goes on."""
        return self.job.running

    @property
    def sample_rate_Hz(self) -> float | None:
        """Of the slowest recording that is open; None without one."""
        found = [one.measurement.sample_period_s for one in self.opened.values() if one.measurement is not None]
        periods = [period for period in found if period > 0.0]  # a static map has none
        return 1.0 / max(periods) if periods else None

    # --- files ------------------------------------------------------------------------------------------------------

    def add(self, name: str) -> None:
        """Opens a file of the data folder soon; what is wrong with it is told."""
        self._read(OPEN, name, lambda: self._open(name))

    def open_example(self) -> None:
        """Opens the recordings of a shipped challenge, with its actuator; what it holds out is held out."""
        example = next(one for one in challenges() if one.name == EXAMPLE)
        actuator = load_actuator(example.actuator).name
        if self.actuator.name != actuator:
            self.choose_actuator(actuator)
        for file in (*example.training, *example.holdout):
            self.add(self.folder.name_of(self.folder.take_in(file)))

    def measurement(self, name: str, actuator: Actuator | None = None) -> Measurement:
        """A file of the data folder for an actuator, the app's without one; as Compare has it, if it is open here."""
        actuator, opened = actuator or self.session.actuator, self.opened.get(name)
        if opened is not None and opened.recorded is not None:
            return prepared(opened.recorded, actuator)
        path = self.folder.measurement(name)
        try:
            measurement = read(path, actuator, side=side_file_of(path, self.folder) or SideFile())
        except InputError as error:
            raise InputError(self.folder.named_in(str(error))) from None
        if measurement.reading.told:
            self.session.events.told("Columns were guessed", f"{path.name}: {measurement.reading.told}")
        return measurement

    def remove(self, name: str) -> None:
        """Takes a recording off the list; its file stays."""
        self.opened.pop(name, None)
        self.held_out.discard(name)
        self._decided.discard(name)
        self.events.removed()

    def version(self, name: str) -> str:
        """By which a measurement of the data folder is known again, as it would be read now; '' where it is gone."""
        opened = self.opened.get(name)
        if opened is not None:
            return opened.version_on(version_of(opened.path))
        try:
            path = self.folder.measurement(name)
        except InputError:
            return ""
        return version_with_side(path)

    def use_mapping(self, name: str, mapping: ColumnMapping) -> None:
        """Reads the file with this mapping soon, and remembers it in the side file."""
        self._read(MAP, name, lambda: self._map(name, mapping))

    def use_layout(self, name: str, hints: Hints) -> None:
        """Reads the text anew, as somebody says that it is laid out, soon, and remembers it in the side file."""
        self._read(LAY_OUT, name, lambda: self._lay_out(name, hints))

    def _read(self, what: str, name: str, job: Callable[[], object]) -> None:
        self.asking.reads(name)
        self._files.post(what, name, job, lambda: self.asking.has_read(name))

    def _open(self, name: str) -> None:
        path = self.folder.measurement(name)
        if name not in self.opened and len(self.opened) >= MOST_RECORDINGS:
            raise InputError(f"{MOST_RECORDINGS} measurements are the most to compare at once; remove one first")
        side = side_file_of(path, self.folder)
        refused = self._take_actuator(side) if side is not None else None
        self._opened(read_opened(name, path, self.actuator, side or SideFile()))
        if refused is not None:
            raise refused  # told once the recording is there all the same

    def _map(self, name: str, mapping: ColumnMapping) -> None:
        opened = self.opened.get(name)
        if opened is None:
            return
        side = side_with(opened, self.folder, mapping=mapping)
        found = measured(replace(opened, mapping=mapping), self.actuator, side)  # first: nothing wrong is remembered
        self._remember(found, side, mapping=mapping)

    def _lay_out(self, name: str, hints: Hints) -> None:
        opened = self.opened.get(name)
        if opened is None or hints == opened.hints:
            return
        try:
            # Another header makes other columns, of which the mapping says nothing; another rate makes none.
            of_text = replace(hints, rate_Hz=None) != replace(opened.hints, rate_Hz=None)
            more = {"mapping": None} if of_text else {}
            side = side_with(opened, self.folder, text=hints, **more)
            found = read_opened(name, opened.path, self.actuator, side)
            if found.problem:
                raise refusal(name, found.problem)
        except InputError:
            self.events.refused()
            raise
        self._remember(found, side, text=hints, **more)

    def _remember(self, found: Opened, side: SideFile, **said: Any) -> None:
        """Puts what was said into the side file, and tells; where it cannot be written, it holds all the same."""
        try:
            change_side_file(self.folder.beside(found.path), side, **said)
        finally:
            self._opened(found)

    def _opened(self, opened: Opened) -> None:
        self.opened[opened.name] = opened
        if self._decided.isdisjoint(self.opened):  # what says by its name that it is not to be fitted is not
            self.held_out = set(called_held_out(list(self.opened)))
        self.asking.has_read(opened.name)
        self.events.opened(opened)

    def _take_actuator(self, side: SideFile) -> InputError | None:
        """Takes the actuator that a side file names, if the data folder holds it; else why not."""
        if side.actuator_path is None:
            return None
        try:
            if not self.folder.holds(Path(side.actuator_path)):
                named = shown(side.actuator, 100)
                raise InputError(f"{named}: the side file names an actuator outside the data folder; upload it")
            self.choose_actuator(f"{files.UPLOADED}{self.folder.name_of(Path(side.actuator_path))}")
        except InputError as error:
            return error
        return None

    # --- what is asked ----------------------------------------------------------------------------------------------

    def actuators(self) -> list[str]:
        """The actuator that the app was started with, those that come with it, and the uploaded ones."""
        return list(dict.fromkeys([self.session.actuator.name, *files.names(self.folder)]))

    def choose_actuator(self, name: Any) -> None:
        """One of `actuators`; InputError for another, or a file that is no actuator."""
        own = self.session.actuator
        chosen = own if name == own.name else files.named(str(name), self.folder)
        self._use(chosen)
        self.actuator_name = str(name)
        for opened in list(self.opened.values()):
            if opened.recorded is not None:
                self.opened[opened.name] = replace(opened, measurement=prepared(opened.recorded, chosen))
            elif opened.columns and not guesses(opened, chosen):
                self.add(opened.name)  # this actuator's file knows their columns

    def _use(self, actuator: Actuator) -> None:
        self.actuator = actuator
        self.actuator_name = actuator.name
        self.free = _freed(actuator)

    def set_free(self, path: str, free: bool) -> None:
        """Whether a calibration may move a parameter of the actuator."""
        if path not in self.actuator.tolerances:
            raise InputError(
                f"{quoted(path, 60)}: the actuator's file gives it no tolerance, so it cannot be calibrated"
            )
        self.free = self.free | {path} if free else self.free - {path}

    def set_weight(self, name: str, weight: Any) -> None:
        """How much a signal counts in the calibration, 1 as its floor says; 0 leaves it out."""
        if name not in COMPARABLE:
            raise InputError(f"{quoted(name, 60)} is not compared; choose of {', '.join(COMPARABLE)}")
        value = number(weight, f"the weight of the {in_sentence(SIGNALS[name].title)}")
        if not 0.0 <= value <= _MOST_WEIGHT:
            raise InputError(f"the weight of a signal must lie between 0 and {_MOST_WEIGHT:g}, not {value:g}")
        others = {other: w for other, w in self.weights.items() if other != name}
        self.weights = others | {name: value} if value else others

    def set_window(self, start: Any, stop: Any) -> None:
        """The time to compare, s; InputError unless it starts before it ends."""
        first, last = number(start, "the window's start"), number(stop, "the window's end")
        if not first < last:
            raise InputError(f"the window must start before it ends: from {first:g} s to {last:g} s is none")
        self.window_s = (first, last)

    def hold_out(self, name: str, held: bool) -> None:
        """Whether a recording is kept from the fit, to judge by."""
        self._decided.add(name)
        self.held_out = self.held_out | {name} if held else self.held_out - {name}
        self.events.held()

    def take_held_out(self, names: Collection[str], of: Collection[str] = ()) -> None:
        """These and no others, as somebody has said before; of: recordings that are still to be opened."""
        self.held_out = set(names)
        self._decided = {*names, *of, *self.opened}
        self.events.held()

    @property
    def proposal(self) -> HoldOut | None:
        """What suggests itself to be held out, while nothing is and nobody has said otherwise."""
        known = {name: one.measurement for name, one in self.opened.items() if one.measurement is not None}
        if self._decided or self.held_out or len(known) < len(self.opened):
            return None
        return proposed(known)

    def signals_available(self) -> list[str]:
        """Those of `COMPARABLE` that every recording has, or can be given."""
        measurements = [o.measurement for o in list(self.opened.values()) if o.measurement is not None]
        return [name for name in COMPARABLE if measurements and all(name in m for m in measurements)]

    # --- comparison -------------------------------------------------------------------------------------------------

    def inputs(self, as_read: bool = False) -> Inputs:
        """What a comparison takes; as_read: of the files as they were read, else as they are on the disk."""
        opened = list(self.opened.values())
        names = [one.name.rpartition("/")[2] for one in opened if one.name not in self.held_out]
        return Inputs(
            listed(names),
            files={one.name: one.version_on("" if as_read else version_of(one.path)) for one in opened},
            options={
                "the actuator": f"{self.actuator_name} {digest(self.actuator)}",
                "the calibration": listed(sorted(self.free)) if self.calibrate else "off",
                "the window of time": str(self.window_s or ""),
                "what is held out": listed([name for name in self.opened if name in self.held_out]),
                **{
                    f"the weight of the {in_sentence(SIGNALS[name].title)}": str(weight)
                    for name, weight in self.weights.items()
                },
            },
        )

    def ask(self) -> None:
        """Compares what is chosen, as a person asks; a file that has changed on the disk is read again before."""
        for one in list(self.opened.values()):
            if version_of(one.path) not in ("", one.version):
                self.add(one.name)
        self.asking.ask(by_hand=True)

    def compare(self) -> bool:
        """Begins a comparison of what is chosen; False while another long run goes on.

        Raises InputError when something is missing.
        """
        measurements = all_measured(list(self.opened.values()))
        if not self.weights:
            wanted = ", ".join(in_sentence(SIGNALS[name].title) for name in COMPARABLE)
            raise InputError(f"no signal to fit is chosen; choose one or more of {wanted}")
        if self.calibrate and not self.free:
            raise InputError("calibration is on, but no parameter may move; free one, or turn it off")
        if self.window_s is not None:
            measurements = [m.selected(self.window_s) for m in measurements]
        by_name = dict(zip(self.opened, measurements))
        held = [one for name, one in by_name.items() if name in self.held_out]
        fitted = [one for name, one in by_name.items() if name not in self.held_out]
        if not fitted:
            raise InputError("all measurements are held out; leave one to be fitted")
        asked, of, elapsed_s = self._asked(), self.inputs(as_read=True), 0.0

        def work(tell: Tell) -> None:
            from ema_model.comparison import compare  # here, since it brings all of scipy's optimisers

            nonlocal elapsed_s
            began = time.perf_counter()
            self.comparison = compare(fitted, **asked, holdout=held, on_progress=tell)
            self.provenance.take(of)
            elapsed_s = time.perf_counter() - began

        def done() -> str:
            found = self.comparison
            assert found is not None, "it came to its end"
            self.events.compared(found)
            fitted = "" if found.calibration is None else f", calibrated in {found.calibration.evaluations} steps"
            return f"Compared in {elapsed_s:.1f} s{fitted}."

        return self.provenance.begin(lambda: self.job.begin(self._title, work, done), of)

    def _take_comparison(self, stored: Any) -> None:
        """One of a session's file, as it was."""
        self.comparison = found = Comparison.restored(stored)
        self.events.compared(found)

    @property
    def finished(self) -> Comparison | None:
        """The last comparison, if it is of what is chosen now."""
        of = self.provenance.of
        return self.comparison if of is not None and not of.changed(self.inputs()) else None

    @property
    def _title(self) -> str:
        return "Calibrating and comparing" if self.calibrate else "Comparing"

    def _chosen(self) -> Hashable:
        """What a comparison would take now."""
        weights = frozenset(self.weights.items())
        asked = self.calibrate, frozenset(self.free), weights, self.window_s
        return tuple(self.opened.values()), frozenset(self.held_out), id(self.actuator), *asked

    def _asked(self) -> dict[str, Any]:
        """What `compare` is asked beside the recordings; None stands for what the actuator's file says."""
        chosen = {self.actuator.axes.signal(name): w for name, w in self.weights.items()}
        return {
            "actuator": self.actuator,
            "calibrate": self.calibrate,
            "free": None if self.free == _freed(self.actuator) else sorted(self.free),
            "signals": None if self.weights == USUAL else chosen,
        }

    # --- what stays -------------------------------------------------------------------------------------------------

    def save(self, suffix: str) -> None:
        """Writes the last comparison as a report (.html) or for Rerun (.rrd) into the data folder, soon."""
        self._files.post(SAVE, suffix, lambda: self._save(suffix))

    def _save(self, suffix: str) -> None:
        if self.comparison is None:
            raise InputError("nothing is compared yet; press Compare first")
        from emaviz.views.report import export  # rerun and the report's figures take half a second of the app's start

        path = self.folder.fresh(self.folder.recordings, "compare", suffix)
        export(self.comparison, path)
        self.events.kept(path)


def _freed(actuator: Actuator) -> set[str]:
    return {path for path, tolerance in actuator.tolerances.items() if tolerance.free}
