"""Comparing the units of a fleet without a screen, and what is saved of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec

from ema_model.actuator import Actuator, save_actuator
from ema_model.errors import InputError, quoted
from ema_model.fleet.compare import check_same_type, units_in
from ema_model.fleet.result import UnitsCompared
from ema_model.recordings import Measurement, read
from ema_model.recordings.recording_set import long_enough
from ema_model.recordings.side_file import SideFile
from emaviz.session import files as session_files
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.files import Practice, side_file_of
from emaviz.session.jobs import Job, Run, Signal, Worker
from emaviz.session.session_file import Inputs, Provenance, Whole, digest, version_with_side
from emaviz.session.settings import taken


class SavedUnits(msgspec.Struct, frozen=True):
    """What a session's file holds of what is chosen; the answer stands beside."""

    folder: str
    rule: str
    actuator: str  # its name in the list


# --- the units of a folder: read, compared on the compute thread, and what is kept of the answer ----------------------

UNSEEN = "*unseen*"  # what recordings to hold out are often called
REPORT, TYPE = ".html", ".toml"


@dataclass
class UnitsEvents:
    """What the screen listens to, besides the job; called on the threads that work, so listeners only hand over."""

    compared: Signal[[UnitsCompared]] = field(default_factory=Signal)
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report or an actuator file is written


class ComparingUnits:
    """What is chosen, and the last answer."""

    def __init__(self, session: Session, folder: DataFolder, files: Worker) -> None:
        """files: writes what stays."""
        self.session, self.folder, self._files = session, folder, files
        self.events = UnitsEvents()
        self.job = Job(session.worker, on_divergence="check the actuator's file and the recordings' units")
        self.practice = Practice(self.job, folder, "units")
        self.chosen = ""  # the folder's name in the data folder
        self.rule = UNSEEN  # names of the recordings to hold out; "" for none
        self.actuator: Actuator = session.actuator
        self.actuator_name = session.actuator.name
        self.found: UnitsCompared | None = None
        self.provenance = Provenance("the comparison", "Compare units", self.inputs, self.job)
        self.provenance.whole = Whole(lambda: None if self.found is None else self.found.stored(), self._show)

    def inputs(self) -> Inputs:
        """What a comparison would take now."""
        try:
            folder = self.folder.inner(self.chosen)
        except InputError:
            files = None  # a session's, which is not there
        else:
            files = {
                f"{self.chosen}/{file.relative_to(folder).as_posix()}": version_with_side(file)
                for file in _recordings(self._units(folder))
            }
        options = {
            "the rule to hold out": self.rule.strip(),
            "the actuator": f"{self.actuator_name} {digest(self.actuator)}",
        }
        return Inputs(self.chosen, self.chosen, files, options)

    def _units(self, folder: Path) -> dict[str, list[Path]]:
        """The recordings of each; none where there is no unit."""
        try:
            units = units_in(folder)
        except InputError:
            return {}
        own = {one.name for one in self.folder.own} if folder == self.folder.folder else set()
        return {name: files for name, files in units.items() if name not in own}

    def fleets(self) -> dict[str, int]:
        """The folders of the data folder in which two folders or more hold recordings, and how many do."""
        own = {one.name for one in self.folder.own}
        found: dict[str, int] = {}
        for name in self.folder.folders():
            path = PurePosixPath(name)
            above = path.parent.as_posix()
            if name != "." and not (above == "." and path.name in own):
                found[above] = found.get(above, 0) + 1
        return {name: count for name, count in found.items() if count > 1 or name != "."}

    def actuators(self) -> list[str]:
        """The one that the app was started with, those that come with it, and the uploaded ones."""
        return list(dict.fromkeys([self.session.actuator.name, *session_files.names(self.folder)]))

    def choose(self, name: Any) -> None:
        """A folder by its name; InputError where there is none."""
        self.folder.inner(str(name))
        self.chosen, self.found = str(name), None
        self.provenance.clear()

    def choose_actuator(self, name: Any) -> None:
        """One of `actuators`; InputError for another, or a file that is no actuator."""
        own = self.session.actuator
        self.actuator = own if name == own.name else session_files.named(str(name), self.folder)
        self.actuator_name = str(name)

    def begin(self) -> bool:
        """Begins with what is chosen; False while another long run goes on.

        InputError for a folder without units, one unit only, several types, or a rule that leaves nothing to fit.
        """
        if not self.chosen:
            raise InputError("no folder of units is chosen; put one into the data folder, a folder in it for each unit")
        folder = self.folder.inner(self.chosen)
        units = self._units(folder) or units_in(folder)  # which says why there is none
        if len(units) == 1:
            raise InputError(f"one unit only ({quoted(next(iter(units)), 60)}): two or more are needed to compare")
        check_same_type(_recordings(units))
        fitted, held = _held_out(units, self.rule.strip())
        actuator = self.actuator

        found: UnitsCompared | None = None

        def work(run: Run) -> None:
            nonlocal found
            from ema_model.fleet.compare import compare_units  # here, since it brings all of scipy's optimisers

            told: list[str] = []
            given, unseen = (self._read_all(part, actuator, run, told) for part in (fitted, held))
            found = compare_units(given, actuator, holdout=unseen, on_progress=run)

        def done() -> None:
            assert found is not None, "it came to its end"
            self.found = found
            self.provenance.take()
            self.events.compared(found)

        return self.provenance.begin(lambda: self.job.begin("Comparing units", work, done))

    def _read_all(
        self, units: Mapping[str, Sequence[Path]], actuator: Actuator, run: Run, told: list[str]
    ) -> dict[str, list[Measurement]]:
        """The units' recordings; of several, those that are too short are left out, and told."""

        def left_out(line: str) -> None:
            self.session.events.told("A recording is left out", self.folder.named_in(line))

        found: dict[str, list[Measurement]] = {name: [] for name in units}
        every = [(name, file) for name, files in units.items() for file in files]
        for (name, _), one in long_enough(every, lambda of: self._read(of[1], actuator, run, told), left_out):
            found[name].append(one)
        return found

    def _read(self, file: Path, actuator: Actuator, run: Run, told: list[str]) -> Measurement:
        """One recording; the first guess at columns is told."""
        run(f"reading {file.parent.name}, {file.name}")
        one = read(file, actuator, side=side_file_of(file, self.folder) or SideFile())
        if one.reading.told and not told:
            told.append(one.reading.told)
            self.session.events.told("Columns were guessed", f"{file.name}: {one.reading.told}")
        return one

    def save(self, suffix: str) -> None:
        """Writes the last answer as a report, or the type as an actuator file, soon; InputError before there is one."""
        found = self.found
        if found is None:
            raise InputError("no units are compared yet; press Compare units first")
        self._files.post(f"units {suffix}", lambda: self._keep(found, suffix))

    def saved(self) -> dict[str, Any]:
        """What a session's file holds of what is chosen."""
        return msgspec.to_builtins(SavedUnits(self.chosen, self.rule, self.actuator_name))

    def _show(self, stored: Any) -> None:
        """An answer of a session's file; its recordings need not be there."""
        found = UnitsCompared.restored(stored)
        if not _fits(found):
            raise InputError("its parts do not fit each other")
        self.found = found
        self.events.compared(found)

    def restore(self, saved: Any, names: Mapping[str, str]) -> None:
        """Takes what `saved` gave; InputError, and nothing changes, for what makes no sense.

        names: the files' names of now by those of then.
        """
        if self.job.running:
            raise InputError("units are being compared; stop that first")
        told: SavedUnits = taken(SavedUnits, saved, "part of Units")
        actuator = told.actuator
        if actuator.startswith(session_files.UPLOADED):
            name = actuator.removeprefix(session_files.UPLOADED)
            actuator = session_files.UPLOADED + names.get(name, name)
        if actuator in self.actuators():
            self.choose_actuator(actuator)
        self.chosen, self.rule, self.found = told.folder, told.rule, None
        self.provenance.clear()

    def files(self) -> list[str]:
        """Names in the data folder of what a session needs for it."""
        uploaded = self.actuator_name.startswith(session_files.UPLOADED)
        return [self.actuator_name.removeprefix(session_files.UPLOADED)] if uploaded else []

    def _keep(self, found: UnitsCompared, suffix: str) -> None:
        if suffix == REPORT:
            from emaviz.views.report import export  # plotly takes half a second to import

            path = self.folder.fresh(self.folder.recordings, "units", suffix)
            export(found, path)
        else:
            path = self.folder.fresh(self.folder.actuators, "type", suffix)
            save_actuator(found.type_actuator, path)
        self.events.kept(path)


def _fits(found: UnitsCompared) -> bool:
    """Whether all that is told is of the same units and parameters."""
    count, told = len(found.units), [*found.differences, *found.dropped, *found.needs, *found.of_recordings]
    each = [
        found.errors,
        found.transfer.floor,
        *(part for one in found.alone.values() for part in (one.value, one.sigma)),
    ]
    return (
        count > 1
        and len(found.recordings) == len(found.held_out) == count
        and {*found.of_type} == {*found.alone} <= {*found.actuator.tolerances}
        and {one.unit for one in told} <= {*found.units}
        and all(one.shape == (count,) for one in each)
        and found.transfer.error.shape == found.transfer.floors.shape == (count, count)
    )


def _recordings(units: Mapping[str, Sequence[Path]]) -> list[Path]:
    return [file for files in units.values() for file in files]


def _held_out(units: dict[str, list[Path]], rule: str) -> tuple[dict[str, list[Path]], dict[str, list[Path]]]:
    """The files of each unit to fit and to hold out; a rule that names none holds none out, unless it was written."""
    fitted: dict[str, list[Path]] = {}
    held: dict[str, list[Path]] = {}
    for name, files in units.items():
        held[name] = [file for file in files if rule and fnmatchcase(file.stem, rule)]
        fitted[name] = [file for file in files if file not in held[name]]
        if not fitted[name]:
            raise InputError(f"unit {quoted(name, 60)}: no recording of it is left to fit; hold out fewer")
    if rule not in ("", UNSEEN) and not any(held.values()):
        raise InputError(f"hold out {quoted(rule, 60)}: no recording has such a name (there are {_stems(units)})")
    return fitted, held


def _stems(units: dict[str, list[Path]]) -> str:
    names: Sequence[str] = list(dict.fromkeys(file.stem for files in units.values() for file in files))
    return ", ".join(names[:6]) + (" …" if len(names) > 6 else "")
