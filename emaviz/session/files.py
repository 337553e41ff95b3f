"""Files of the data folder as the session opens them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator, save_actuator
from ema_model.actuator.describe import DRIVES, asked, described, entry_of, gear_of, implausible, missing, unanswered
from ema_model.actuator.parameters import facts_of, on_axes
from ema_model.actuator.reference import usual_tolerance
from ema_model.analyses import analyses
from ema_model.challenges import Challenge
from ema_model.discovery.words import effect_title
from ema_model.errors import InputError, quoted
from ema_model.files.opened import PAGE_BYTES, shipped_folder, shown
from ema_model.practice import Revealed, challenge_in, make, reveal, shipped
from ema_model.quantities import Axes, in_sentence, number
from ema_model.recordings import ColumnMapping, Measurement, hints_of, prepared, read_columns, read_head, read_side_file
from ema_model.recordings.formats.text_layout import Head, Hints
from ema_model.recordings.health import Health, health_of
from ema_model.recordings.read import how_to_read, recorded
from ema_model.recordings.side_file import SideFile, find_side_file
from ema_model.text import InWords
from emaviz.recording.entry import Entry
from emaviz.session.data_folder import ACTUATOR_SUFFIX, DataFolder, sanitised
from emaviz.session.jobs import Job, Run, Signal
from emaviz.session.session_file import digest, version_of

if TYPE_CHECKING:
    from emaviz.recording.read import Recording


# --- a recording that is chosen for Compare: its table, its mapping, and what was measured ----------------------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Opened:
    """A chosen file: as a table until its columns are mapped, then also as a measurement."""

    name: str  # relative to the data folder
    path: Path
    columns: dict[str, Array]  # as they stand in the file; none where its layout is not clear
    mapping: ColumnMapping  # in use, or guessed
    head: Head | None = None  # of a text
    hints: Hints = field(default_factory=Hints)  # what was said of its layout
    recorded: Measurement | None = None  # as files name the signals, for any actuator
    measurement: Measurement | None = None  # as the chosen actuator's model needs it
    health: Health | None = None
    problem: str = ""  # why there are no columns
    version: str = ""  # of the file, when it was read

    def version_on(self, disk: str) -> str:
        """What was read, and how, if the file is of that version."""
        return f"{disk or self.version} {digest((self.mapping, self.hints))}"


def all_measured(opened: Iterable[Opened]) -> list[Measurement]:
    """What was measured in each; InputError for one whose columns are not known yet, and where there is none."""
    found: list[Measurement] = []
    for one in opened:
        if one.measurement is None:
            todo = "columns are not mapped yet; check them and press Use"
            if one.problem:
                todo = "table was not found; say under Columns… where it begins, or remove the file"
            raise InputError(f"{quoted(one.name)}: its {todo}")
        found.append(one.measurement)
    if not found:
        raise InputError("no measurement is chosen; upload one, or choose one of the data folder")
    return found


def side_file_of(path: Path, folder: DataFolder) -> SideFile | None:
    """The side file of a recording, or of its folder; InputError where it leads out of the data folder."""
    beside, found = folder.beside(path), find_side_file(path)
    if found is None:
        return None
    if found != beside and not folder.holds(found):
        raise InputError(f"{found.name} leads out of the data folder; replace the link by the file")
    return read_side_file(found)


def side_with(opened: Opened, folder: DataFolder, **said: Any) -> SideFile:
    """The recording's side file with what somebody has said now, which is kept beside the recording itself."""
    known = side_file_of(opened.path, folder) or SideFile()
    return replace(known, **said, path=str(folder.beside(opened.path)))


def read_opened(name: str, path: Path, actuator: Actuator, side: SideFile) -> Opened:
    """A file as its side file says it is to be read; a table only, where somebody must say which columns are which.

    InputError for what is no table; but of a text there are the first lines, for somebody to find the table by.
    """
    hints, version = hints_of(str(path), side), version_of(path)
    try:
        head = read_head(path, max_bytes=PAGE_BYTES, hints=hints)
    except InputError:  # which reading the columns tells, where it is what was said
        head = read_head(path, max_bytes=PAGE_BYTES)
    try:
        columns = read_columns(path, max_bytes=PAGE_BYTES, hints=hints)
    except InputError as error:
        if head is None:
            raise
        problem = str(error).removeprefix(f"{shown(path, 300)}: ")
        return Opened(name, path, {}, ColumnMapping(), head, hints, problem=problem, version=version)
    reading = how_to_read(path, actuator, side=side, columns=columns)
    table = Opened(name, path, columns, reading.proposed(columns), head, hints, version=version)
    return table if reading.is_guess else measured(table, actuator, side)


def guesses(opened: Opened, actuator: Actuator) -> bool:
    """Whether there are columns of which this actuator's file does not say what they are."""
    return how_to_read(opened.path, actuator, side=SideFile(text=opened.hints), columns=opened.columns).is_guess


def measured(opened: Opened, actuator: Actuator, side: SideFile | None = None) -> Opened:
    """The same with what was measured and its health; `side` is the recording's side file, where it has one."""
    version = version_of(opened.path)
    found = recorded(opened.path, actuator, side=side or SideFile(), max_bytes=PAGE_BYTES)
    measurement = prepared(found, actuator)
    return replace(
        opened, recorded=found, measurement=measurement, health=health_of(measurement, actuator), version=version
    )


# --- the actuators that one may choose: those that come with the package, and those of the data folder ----------------

UPLOADED = "uploaded: "  # before the names of those of the data folder


def shipped_actuators() -> dict[str, Path]:
    """The actuator files that come with the package, by the names in them."""
    return {load_actuator(path).name: path for path in sorted(shipped_folder("actuators").glob("*.toml"))}


def names(folder: DataFolder) -> list[str]:
    """All of them."""
    return [*shipped_actuators(), *(UPLOADED + name for name in folder.actuator_files())]


def named(name: str, folder: DataFolder) -> Actuator:
    """One of `names`; InputError for another, or a file that is no actuator."""
    path = shipped_actuators().get(name)
    return load_actuator(folder.actuator(name.removeprefix(UPLOADED)) if path is None else path)


# --- an actuator's file from answers on the page, as `emaviz actuator new` writes it from options ---------------------

_GEAR = "transmission.gear_ratio"


@dataclass(frozen=True)
class Question:
    """One parameter to be asked for."""

    path: str  # "motor.inertia_kgm2", whatever the axes
    title: str
    unit: str
    meaning: str
    empty: str  # what no answer is taken for
    tolerance: str  # the usual one, of an answer that says none; "" where it counts as known
    other: str = ""  # how else it may be written


@dataclass
class Description:
    """What somebody says of an actuator."""

    name: str = ""
    axes: Axes = field(default_factory=Axes)
    controller: str = next(iter(DRIVES))
    drive: str = ""  # one of `drives`; another stands for the usual one
    answers: Mapping[str, str] = field(default_factory=dict)  # by path: '1e-4', '1e-4 ± 5%', '0 ± 0.02', ''
    sample_rate_Hz: float | None = None  # of the recordings that it is for

    @property
    def drives(self) -> tuple[str, ...]:
        """What its controller may act through, or an open loop put in; none where there is no choice."""
        return DRIVES[self.controller]

    @property
    def questions(self) -> Iterator[Question]:
        """Its parameters, the gear first."""
        for path in asked(self.controller, self._drive):
            named, facts = on_axes(path, self.axes), facts_of(path, self.axes)
            empty = unanswered(path, self.axes, self.controller)
            other = ("as the lead, 10 mm" if named.unit == "m/rad" else "500:1") if path == _GEAR else ""
            yield Question(path, named.title, named.unit, facts.meaning, empty, usual_tolerance(facts), other)

    @property
    def _drive(self) -> str:
        return self.drive if self.drive in self.drives else next(iter(self.drives), "current")

    def save(self, folder: DataFolder) -> tuple[str, list[str]]:
        """Writes the file, with comments, among the folder's actuators; its name there, and what to look at in it.

        Raises InputError for an answer that is none, and for what no actuator can have.
        """
        document: dict[str, Any] = {"name": self.name.strip() or "New actuator"}
        document["axes"] = {"motor": self.axes.motor, "user": self.axes.user}
        for one in self.questions:
            text = self.answers.get(one.path, "").strip()
            if text:
                entry = (gear_of if one.path == _GEAR else entry_of)(text, one.title)
                document.setdefault(one.path.partition(".")[0], {})[on_axes(one.path, self.axes).name] = entry
        actuator = described(document, self.controller, self._drive, document["name"], self.sample_rate_Hz)
        path = folder.place(document["name"] + ACTUATOR_SUFFIX)
        save_actuator(actuator, path, with_comments=True)
        return UPLOADED + folder.name_of(path), [*missing(actuator), *implausible(actuator)]


# --- challenges of one kind in the data folder: those that can be made there, and the one that a folder holds ---------


class Practice:
    """made: called with the folder's name once a challenge's recordings are there, by the thread that works."""

    def __init__(self, job: Job, folder: DataFolder, kind: str) -> None:
        """job: of what the recordings are for."""
        self._job, self._folder = job, folder
        self.shipped = shipped(kind)
        self.made: Signal[[str]] = Signal()

    def open(self, one: Challenge) -> bool:
        """Makes its recordings soon, unless they are there; False while another long run goes on."""
        where = self._folder.folder / one.name
        if self.held(one.name) == one:
            self.made(one.name)
            return True

        def work(run: Run) -> None:
            make(one, where, run)

        def done() -> str:
            self.made(one.name)
            return f"{one.title}: its recordings are in the data folder, {one.name}."

        return self._job.begin("Making the recordings", work, done)

    def held(self, name: str) -> Challenge | None:
        """The challenge that a folder of the data folder holds, by its name."""
        try:
            return challenge_in(self._folder.inner(name))
        except InputError:
            return None

    def reveal(self, name: str, found: InWords | None) -> Revealed:
        """The answer of the challenge in a folder; InputError where there is none."""
        one = self.held(name)
        if one is None:
            raise InputError("this folder is of no challenge, so that nothing is sealed in it")
        return reveal(one, found)


# --- what a recorded run is, in a line: its kind and what came of it, from what its file says of itself ---------------

UNKNOWN = "run"


def summary(said: Mapping[str, Any]) -> tuple[str, str]:
    """('discovery', 'cogging torque: 1.69 → 0.757 × floor'); ('run', '') of a file that says nothing."""
    for key, (kind, words) in _KINDS.items():
        if isinstance(said.get(key), Mapping):
            try:
                return kind, words(said[key])
            except (KeyError, TypeError, IndexError, ValueError):  # of another version
                return kind, ""
    return UNKNOWN, ""


def _identification(found: Mapping[str, Any]) -> str:
    names = sorted({name for one in found.values() for name in one.get("alarms", ())})
    return "not healthy: " + ", ".join(names) if names else "healthy" if _all(found, "healthy") else "no single k off"


def _all(found: Mapping[str, Any], name: str) -> bool:
    return all(one.get(name) for one in found.values())


def _discovery(found: Mapping[str, Any]) -> str:
    names = [in_sentence(effect_title(str(one["name"]))) for one in found["effects"]]
    errors = [found["ladder"][at]["rmse"] for at in (0, -1)]
    if None in errors:
        fell = ""
    elif len(found["ladder"]) > 1:
        fell = f"{number(errors[0])} → {number(errors[1])} × floor"
    else:
        fell = f"{number(errors[0])} × floor"
    what = ", ".join(names) or str(found["verdict"]).replace("_", " ")
    return f"{what}: {fell}" if fell else what


def _comparison(found: Mapping[str, Any]) -> str:
    return str(found["sentences"][0])


def _tracking(found: Mapping[str, Any]) -> str:
    trends = [name for name, one in found["faults"].items() if one.get("trend")]
    return f"trend of {', '.join(trends)}" if trends else "no trend"


_KINDS: dict[str, tuple[str, Callable[[Mapping[str, Any]], str]]] = {
    "found": ("identification", _identification),
    "discovery": ("discovery", _discovery),
    "comparison": ("comparison", _comparison),
    "track": ("tracking", _tracking),
    "reproduce": ("evaluation", lambda _: "the thesis's tables beside ours"),
    **{name: (in_sentence(one.title), lambda found: str(found["answer"][0])) for name, one in analyses().items()},
}

# --- past recordings: what the folder holds, with settings and results; renamed, deleted, read back -------------------

_ENDING = ".rrd"


class RecordedRuns:
    """The folder of recordings.  Raises InputError, one line, for what is refused.

    Only the names that the folder lists are taken; what a file says of itself is kept until the file changes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self._known: dict[str, tuple[tuple[int, int], Entry]] = {}

    def names(self) -> list[str]:
        """Names of the recordings, the newest first."""
        found = []
        for one in os.scandir(self.folder):
            if one.name.endswith(_ENDING) and not one.name.startswith(".") and one.is_file():
                found.append((-one.stat().st_mtime_ns, one.name))
        return [name for _, name in sorted(found)]

    def entry(self, name: str) -> Entry:
        """A recording with its settings and result, as far as it says them."""
        path = self.path(name)
        try:
            status = path.stat()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be read ({error.strerror})") from None
        version = status.st_mtime_ns, status.st_size
        known = self._known.get(name)
        if known is None or known[0] != version:
            said = _properties(path)
            at = datetime.fromtimestamp(status.st_mtime)
            known = version, Entry(name, at, status.st_size, **said)
            self._known[name] = known
        return known[1]

    def read(self, name: str) -> Recording:
        """Everything in it."""
        from emaviz.recording import read

        try:
            return read(self.path(name))
        except OSError as error:
            raise InputError(str(error)) from None

    def rename(self, name: str, wanted: Any) -> str:
        """Gives it another name, made safe, and returns that; a name that is taken is refused."""
        path = self.path(name)
        stem = str(wanted).strip().removesuffix(_ENDING)
        if not stem:
            raise InputError("a run needs a name; type one first")
        new = sanitised(stem + _ENDING)
        target = self.folder / new
        if new == name:
            return name
        if os.path.lexists(target):
            raise InputError(f"{shown(new)} exists already; choose another name")
        try:
            path.rename(target)
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be renamed ({error.strerror})") from None
        self._known.pop(name, None)
        return new

    def delete(self, name: str) -> None:
        """Removes the file."""
        try:
            self.path(name).unlink()
        except OSError as error:
            raise InputError(f"{shown(name)}: cannot be deleted ({error.strerror})") from None
        self._known.pop(name, None)

    def path(self, name: str) -> Path:
        """Where it is; refused unless the folder itself lists it."""
        path = self.folder / name
        try:
            listed = Path(name).name == name and name.endswith(_ENDING) and path.is_file() and not path.is_symlink()
        except OSError:  # longer than any name
            listed = False
        if not listed:
            raise InputError(f"{shown(name)}: no such run; choose one of the list")
        return path


def _properties(path: Path) -> dict[str, Any]:
    """What it is and came to; settings, answers and the best of an identification; nothing of damaged files."""
    try:
        from emaviz.recording.read import properties

        said = properties(path)
    except (OSError, ImportError):
        return {}
    kind, says = summary(said)
    settings, found, best = said.get("settings"), said.get("found"), said.get("best")
    if not (isinstance(settings, dict) and isinstance(found, dict) and isinstance(best, str)):
        return {"kind": kind, "says": says}
    return {"settings": settings, "found": found, "best": best, "kind": kind, "says": says}


def recovered(recordings: Path) -> list[str]:
    """What became of recordings of interrupted runs, a line each."""
    try:
        from emaviz.recording.read import recover

        return [f"Recovered a recording of an interrupted run: {found}" for found in recover(recordings)]
    except (OSError, ImportError) as error:
        return [f"Interrupted recordings cannot be recovered: {error}"]
