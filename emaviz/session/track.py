"""Tracking without a screen: flights that are followed, and what is saved of them."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from ema_model import faults
from ema_model.actuator.file import as_toml
from ema_model.errors import InputError, quoted
from ema_model.files.opened import LOOK_S, Watched
from ema_model.identification.run import Progress
from ema_model.recordings import read
from ema_model.recordings.recording_set import recordings_in
from ema_model.recordings.side_file import SideFile
from ema_model.result import restored, stored
from ema_model.tracking.flights import Flight, check_enough, check_order, flights_in, identified, in_order
from ema_model.tracking.track import History, Tracked, check_thresholds
from ema_model.tracking.trends import LEAST_FLIGHTS
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.files import Practice, side_file_of
from emaviz.session.jobs import RESTED, Job, Run, Signal, Stopped, Worker
from emaviz.session.session_file import Inputs, Provenance, Room, version_with_side
from emaviz.session.settings import number, taken

# --- what a session's file holds of Track -----------------------------------------------------------------------------
# What a session's file holds of Track: thresholds, the identified flights and what was known after each.

_PART = "part of Track"


class SavedFlight(msgspec.Struct, frozen=True):
    """The file that a flight was identified from, as it was then."""

    file: str = ""  # its name in the folder
    version: str = ""

    def is_of(self, path: Path) -> bool:
        """Whether a file is still the one."""
        return bool(self.version) and self.version == version_with_side(path)


class SavedTrack(msgspec.Struct, frozen=True):
    """What is chosen, and the flights in order of time."""

    folder: str
    thresholds: dict[str, float]
    actuator: str = ""  # as a file, by which they were identified
    flights: tuple[SavedFlight, ...] = ()

    def __post_init__(self) -> None:
        check_thresholds(self.thresholds)


@dataclass(frozen=True, eq=False)
class StoredFlights:
    """The flights as they were identified, and what was known after each, if there were enough of them."""

    flights: list[Flight]
    history: History | None

    @classmethod
    def of(cls, given: Any) -> StoredFlights:
        """What was stored; InputError for what is damaged."""
        try:
            return restored(given, cls, StoredFlights._check)
        except InputError:
            raise InputError(f"the session's {_PART} is damaged (its flights make no sense); save it anew") from None

    def _check(self) -> None:
        """Whatever is raised says that parts do not fit each other."""
        good = all(map(_makes_sense, self.flights))
        if (history := self.history) is not None:
            good = good and [*map(id, history.flights)] == [*map(id, self.flights)]
            _ = history.last and (str(history.last.document), history.last.to_dict())
        if not good:
            raise ValueError("parts that do not fit each other")


def _makes_sense(one: Flight) -> bool:
    """Whether its numbers are a flight's."""
    count = len(faults.NAMES)
    shaped = one.k.shape == (count,) and one.own.shape == (count, count) and one.common.shape[:-1] == (count,)
    finite = shaped and all(bool(np.all(np.isfinite(part))) for part in (one.k, one.own, one.common))
    return finite and np.allclose(one.own, one.own.T) and bool(np.all(np.linalg.eigvalsh(one.own) >= 0.0))


# --- the flights of a folder: identified one after another, followed, and taken up as they arrive ---------------------

_SHOWN_EVERY_S = 0.5  # at least, between two pictures of flights so far
_FOLLOWING = 0.02  # share of the bar that following takes, after flights were identified


@dataclass
class TrackEvents:
    """What the screen listens to, besides the job; called on the threads that work, so listeners only hand over."""

    followed: Signal[[History]] = field(default_factory=Signal)  # also so far, while flights are identified
    began: Signal[[list[Flight], int]] = field(default_factory=Signal)  # too few so far to follow, of how many in all
    left_out: Signal[[]] = field(default_factory=Signal)  # what cannot be used has changed
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report or a recording is written


class Following:
    """The chosen folder, the thresholds, the flights that are identified, and what was known after each."""

    def __init__(self, session: Session, folder: DataFolder, files: Worker) -> None:
        """files: writes what stays."""
        self.session, self.folder, self._files = session, folder, files
        self.events = TrackEvents()
        self.job = Job(session.worker, on_divergence="check the recordings' units")
        self.practice = Practice(self.job, folder, "life")
        self.chosen = ""  # the folder's name in the data folder
        self.watching = True
        self.thresholds: dict[str, float] = {}
        self._brought: dict[str, float] = {}  # by a challenge
        self.left_out: dict[str, str] = {}  # why a file is, by its name
        self.history: History | None = None  # as it was followed last
        self._growing: History | None = None
        self._path: Path | None = folder.folder  # None: a session's, which is not there
        self._flights: dict[Path, Flight] = {}
        self._versions: dict[Path, str] = {}  # of the recordings that were read
        self._shown_at = -math.inf  # when flights so far were
        self._looks_on = False  # at what arrives, since flights of this folder were asked for
        self._brought_flights: list[Flight] = []  # by a session, until they are followed
        self._watched = Watched()
        self._closed = threading.Event()
        self._looks: threading.Thread | None = None
        self.provenance = Provenance("the life", "Track", self.inputs, self.job)

    def close(self) -> None:
        """Ends the threads."""
        self._closed.set()
        self.job.stop()

    # --- what is asked ----------------------------------------------------------------------------------------------

    def choose(self, name: Any) -> None:
        """A folder by its name; what was known of another one is forgotten.  InputError where there is none."""
        path = self.folder.inner(str(name))
        if self.job.running:
            raise InputError("flights are being identified; stop that first")
        if name != self.chosen or self._path != path:
            self.chosen, self.history, self._growing, self.left_out = str(name), None, None, {}
            self._path, self._flights, self._brought_flights, self._watched = path, {}, [], Watched()
            self._versions, self._looks_on = {}, False
            self.provenance.clear()
            challenge = self.practice.held(self.chosen)
            own = dict(self.thresholds.items() - self._brought.items())
            self._brought = {} if challenge is None else challenge.thresholds
            self.thresholds = own | self._brought

    def inputs(self) -> Inputs:
        """What would be followed now; of a folder that is watched, what arrives is taken up by itself."""
        files, path = None, self._path
        if path is not None:
            with suppress(OSError):
                files = {one: version_with_side(one) for one in recordings_in(path)}
                if self.watching and self._looks_on:
                    files = {one: self._versions[one] for one in files if one in self._versions}
        return self._inputs(files)

    def _inputs(self, files: Mapping[Path, str] | None) -> Inputs:
        named = None if files is None else {f"{self.chosen}/{path.name}": version for path, version in files.items()}
        options = {f"the threshold of {name}": str(at) for name, at in self.thresholds.items()}
        return Inputs(self.chosen, self.chosen, named, options)

    def set_threshold(self, name: str, value: Any) -> None:
        """Where the life ends by a k; None for nowhere.  InputError for a value that is no threshold."""
        others = {other: at for other, at in self.thresholds.items() if other != name}
        if value is not None:
            others[name] = number(value, f"the threshold of {name}")
            check_thresholds(others)
        self.thresholds = others

    @property
    def is_elsewhere(self) -> bool:
        """Whether the folder is one of a session, and not here."""
        return self._path is None

    @property
    def last(self) -> Tracked | None:
        """What is known after the last flight."""
        return None if self.history is None else self.history.last

    def file_of(self, flight: Flight) -> str:
        """The name in the data folder of a flight's recording; InputError where it is not there any more."""
        path = next((path for path, one in self._flights.items() if one is flight), None)
        if path is None:
            raise InputError(f"{quoted(flight.name)}: its recording is not in the data folder, or is another by now")
        return self.folder.name_of(path)

    # --- the run ----------------------------------------------------------------------------------------------------

    def begin(self) -> bool:
        """Identifies the flights that are not yet, and follows all; False while another long run goes on.

        InputError for a folder without flights, out of which no order can be made, or of several units; and for too
        few of them, unless more are waited for.
        """
        if not self.chosen:
            raise InputError("no folder of flights is chosen; put one into the data folder, and choose it")
        self._path = self._path or self.folder.inner(self.chosen)  # it may have come since
        paths = self._paths(self._path)
        self.left_out = {}  # it may have been mended
        self._forget_all_but([path for path in paths if self._versions.get(path) == version_with_side(path)])
        self._watched.arrived(paths)
        started = self.provenance.begin(lambda: self._start(paths, "Identifying flights"))
        if started:
            self._watched.take(paths)
            self._watch()
        return started

    def _paths(self, folder: Path) -> list[Path]:
        """In order of time; the data folder itself has folders of the app beside its flights."""
        try:
            paths = in_order(recordings_in(folder)) if self.chosen == "." else flights_in(folder)
            check_order(paths)
        except InputError as error:
            raise InputError(self.folder.named_in(str(error))) from None
        if not self.watching:
            check_enough(paths, self.chosen)
        return paths

    def _start(self, paths: list[Path], title: str) -> bool:
        todo = [path for path in paths if path not in self._flights and path.name not in self.left_out]
        told: list[str] = []

        def work(run: Run) -> None:
            if todo and self.history is None:
                self.events.began([], len(paths))
            try:
                for place, path in enumerate(todo):
                    self._take(path, place, len(todo), run)
                    self._show_so_far(path, len(paths))
            except Stopped:
                told.append(f"Stopped after {len(self._flights)} of {len(paths)} flights; Track goes on from there.")
            self._follow(run, _FOLLOWING if todo else 1.0)

        def done() -> str | None:
            if self.history is not None and self.last is not None:
                self.events.followed(self.history)
            elif not told:
                told.append(f"{len(self._flights)} of the {LEAST_FLIGHTS} flights that a trend needs.")
            return " ".join(told) or None

        return self.job.begin(title if todo else "Following k", work, done)

    def _take(self, path: Path, place: int, count: int, run: Run) -> None:
        """Identifies one; what cannot be used is left out, and said."""
        text = f"flight {place + 1} of {count}"

        def told(at: Progress) -> None:
            done = place + at.iteration / max(at.iterations, 1)
            run(text, (1.0 - _FOLLOWING) * done / count)

        run(text, (1.0 - _FOLLOWING) * place / count)
        self._versions[path] = version_with_side(path)
        try:
            side = side_file_of(path, self.folder) or SideFile()
            recording = read(path, self.session.actuator, side=side)
            if recording.reading.told and not self._flights:
                self.session.events.told("Columns were guessed", f"{path.name}: {recording.reading.told}")
            flight = identified(recording, path.stem, self.session.actuator, on_iteration=told)
        except InputError as error:
            self.left_out[path.name] = self.folder.named_in(str(error))
            self.events.left_out()
            return
        self._flights[path] = flight

    def _show_so_far(self, path: Path, count: int) -> None:
        """What is known after this flight, unless later ones were identified before; count: flights in all."""
        known = in_order(self._flights)
        if path not in known[-1:]:
            return
        flights = [self._flights[one] for one in known]
        growing = self._unit_so_far()
        for _ in growing.follow(flights):
            pass
        if growing.last is None:
            self.events.began(flights, count)
            return
        if time.monotonic() - self._shown_at > _SHOWN_EVERY_S:
            self._shown_at, self.history = time.monotonic(), growing.copy()
            self.events.followed(self.history)

    def _follow(self, run: Run, share: float) -> None:
        """Looks after each flight, of all that are identified; share: of the bar."""
        self._grow([self._flights[path] for path in in_order(self._flights)], run, share)

    def _forget_all_but(self, paths: Collection[Path]) -> None:
        """Flights whose recordings were removed, or are others by now, are followed no more."""
        self._flights = {path: flight for path, flight in self._flights.items() if path in paths}
        self._versions = {path: version for path, version in self._versions.items() if path in paths}

    @property
    def complaints(self) -> list[str]:
        """Why files are left out, of those that are still there."""
        path, left_out = self._path, dict(self.left_out)
        return [why for name, why in left_out.items() if path is None or (path / name).exists()]

    def _grow(self, flights: list[Flight], run: Run, share: float) -> None:
        growing = self._unit_so_far()
        for done in growing.follow(flights):
            run.say(f"after flight {done}", 1.0 - share * (1.0 - done / len(flights)))
        self.history = growing.copy()
        if self.last is not None:
            self.provenance.take(self._inputs(None if self._path is None else dict(self._versions)))

    def _unit_so_far(self) -> History:
        if self._growing is None or self._growing.thresholds != self.thresholds:
            self._growing = History(self.thresholds)
        return self._growing

    # --- what arrives -----------------------------------------------------------------------------------------------

    def _watch(self) -> None:
        self._looks_on = True
        if self._looks is None:
            self._looks = threading.Thread(target=self._look_on, name="emaviz-flights", daemon=True)
            self._looks.start()

    def _look_on(self) -> None:
        while not self._closed.wait(LOOK_S):
            path = self._path
            if self.watching and self._looks_on and self.chosen and path is not None and not self.session.worker.busy:
                try:
                    self.take_up(self._watched.arrived(recordings_in(path)))
                except (InputError, OSError) as error:
                    self.session.events.told("The folder cannot be watched", str(error))
                    self.watching = False

    def take_up(self, new: list[Path]) -> None:
        """Files that have arrived, or were replaced; each that cannot be put among the others is left out, and said."""
        if not new:
            return
        self._forget_all_but([path for path in {**self._flights, **self._versions} if path.exists()])
        for path in new:
            self._flights.pop(path, None)
            self.left_out.pop(path.name, None)
        good = list(self._flights)
        for path in new:
            try:
                check_order(in_order([*good, path]))
                good.append(path)
            except InputError as error:
                self.left_out[path.name] = str(error)
                self.events.left_out()
        if len(good) > len(self._flights) and not self._start(in_order(good), "Taking up flights"):
            self._watched.forget(new)  # something else has just begun: at the next look

    # --- what a session's file holds --------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """The flights as they were identified, what was known after each, and what is asked of them."""
        flights, by_flight = self._known(), {id(one): path for path, one in self._flights.items()}
        files = tuple(self._saved(by_flight.get(id(one))) for one in flights)
        told = SavedTrack(self.chosen, dict(self.thresholds), as_toml(self.session.actuator), files)
        history = self.history
        if history is not None and [*map(id, history.flights)] != [*map(id, flights)]:
            history = None  # flights came since
        whole, room = None, Room()
        for one in (history, None):  # the flights alone, where there is no room for more
            with suppress(InputError):
                whole = whole or room.take(stored(StoredFlights(flights, one)))
        return {**msgspec.to_builtins(told), "whole": whole}

    def _saved(self, path: Path | None) -> SavedFlight:
        return SavedFlight() if path is None else SavedFlight(path.name, self._versions.get(path, ""))

    def _known(self) -> list[Flight]:
        """The flights that are identified, in order, also before there are enough of them to be followed."""
        history = [] if self.history is None else self.history.flights
        identified = [self._flights[path] for path in in_order(dict(self._flights))]
        return max(self._brought_flights if self.history is None else [], history, identified, key=len)

    def restore(self, saved: Any) -> None:
        """Takes what `saved` gave: its flights are shown as they were, and none is identified, be it there or not.

        Where what was known after each flight is not in the file, it is found soon.
        InputError, and nothing changes, for what makes no sense or is of another actuator, and while flights are
        identified.
        """
        told: SavedTrack = taken(SavedTrack, saved, _PART)
        whole = saved.get("whole")
        found = StoredFlights([], None) if whole is None else StoredFlights.of(whole)
        flights = found.flights
        if flights and told.actuator != as_toml(self.session.actuator):
            raise InputError("the session's flights are of another actuator; start the app with that one")
        if len({one.common.shape for one in flights if not one.excluded}) > 1:
            raise InputError("the session's flights are of several actuators; save it anew")
        if self.job.running:
            raise InputError("flights are being identified; stop that first")
        try:
            self._path = self.folder.inner(told.folder) if told.folder else self.folder.folder
        except InputError:
            self._path = None
        self.chosen, self.thresholds, self._brought = told.folder, told.thresholds, {}
        self.history, self._growing, self.left_out, self._watched = None, None, {}, Watched()
        path = self._path
        files = [None if path is None or not one.file else path / Path(one.file).name for one in told.flights]
        here = [(file, one, flight) for file, one, flight in zip(files, told.flights, flights) if file is not None]
        self._flights = {file: flight for file, one, flight in here if one.is_of(file)}
        self._versions = {file: one.version if file in self._flights else "" for file, one, _ in here}
        self._watched.arrived(self._flights)
        self._watched.take(self._flights)
        self._looks_on = False  # flights that came since are long work, which is asked for
        self._brought_flights = flights
        self.provenance.clear()
        if (history := found.history) is not None and history.last is not None:
            self.history, self._growing = history, history.copy()
            self.provenance.restored()
            self.events.followed(history)
        elif flights:
            self._follow_brought(flights)

    def _follow_brought(self, flights: list[Flight]) -> None:
        """Looks after each flight of a session's, once nothing else runs."""

        def work(run: Run) -> None:
            if self._brought_flights is flights:  # nothing else was chosen while it waited
                self._grow(flights, run, 1.0)
            if self.history is not None and self.last is not None:
                self.events.followed(self.history)

        title = "Following k"

        def begin() -> bool:
            return self.provenance.begin(lambda: self.job.begin(title, work))

        self.job.begin_in_turn(title, begin, rests=RESTED)

    # --- what stays -------------------------------------------------------------------------------------------------

    def save(self, suffix: str) -> None:
        """Writes the last answer as a report (.html) or for Rerun (.rrd), soon; InputError before there is one."""
        found = self.last
        if found is None:
            raise InputError("nothing is followed yet; press Track first")
        path = self.folder.fresh(self.folder.recordings, "track", suffix)

        def keep() -> None:
            from emaviz.views.report import export  # plotly takes half a second to import

            export(replace(found, actuator=self.session.actuator.name), path)
            self.events.kept(path)

        self._files.post(f"track {suffix}", keep)
