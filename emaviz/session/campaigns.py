"""Campaigns on the page: begun from a plan, folders with rows, and a row computed again as a run."""

from __future__ import annotations

import os
import re
from collections.abc import Generator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import msgspec

from ema_model.actuator import load_actuator
from ema_model.campaign.kinds import KINDS
from ema_model.campaign.plan import Plan, load_plan, shipped_plans
from ema_model.campaign.run import Status, duration, estimate_s, run_plan, scheduler
from ema_model.campaign.store import Campaign, Packed, Store
from ema_model.campaign.task import Task, TaskInputs, inputs_of
from ema_model.comparison import compare
from ema_model.discovery import discover
from ema_model.errors import InputError
from ema_model.files.opened import shown
from ema_model.identification.run import Progress, identify
from ema_model.identification.search import Objective
from ema_model.recordings import Measurement
from ema_model.result import Result, restored, stored
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.jobs import Job, Run, Signal, Steps, Stopped, Tell, elsewhere
from emaviz.session.session_file import Inputs, Room, digest
from emaviz.session.settings import taken

_HEADER = "campaign.json"
_DEPTHS = ("*", "*/*")  # below the data folder
_OWN, _PLANS = "campaigns", "plans"  # folders of the data folder: of campaigns that begin here, of plans of one's own
REPORT = "report.html"
_THESIS = ("thesis_quick", "thesis")  # the plans of which a report and a recording are set beside the thesis
_MOST_ALIKE = 100  # campaigns of one name
_NAME = re.compile(r"\w[\w.() +-]{0,60}")
_LOOK_S = 0.1


@dataclass(frozen=True)
class Computing:
    """What a campaign begins with."""

    plan: str  # of `Campaigns.plans`
    name: str  # of its folder
    workers: int = 1

    @property
    def reproduces(self) -> bool:
        """Whether it is the thesis's evaluation."""
        return self.plan in _THESIS


class SavedCampaign(msgspec.Struct, frozen=True):
    """What a session's file says of the campaign that is shown; its folder stands beside."""

    name: str
    report: bool = False  # whether one was written


class Campaigns:
    """The campaigns below the data folder, and those that the command line has named.  InputError as `Store`."""

    def __init__(self, session: Session, data: DataFolder, given: Sequence[Path] = ()) -> None:
        self.job = Job(session.worker)
        self.computing = Job(session.worker, on_stop=lambda: "Stopped; all rows so far are kept, and it goes on there.")
        self.opened: Signal[[Path, Measurement]] = Signal()  # a row's recording, and its run
        self.grown: Signal[[str]] = Signal()  # name of a campaign that has begun, or has rows more
        self.written: Signal[[str, list[Path]]] = Signal()  # such a name, and its report, and a recording
        self._recorded: tuple[Path, Measurement, str] | None = None
        self._said: set[Path] = set()  # folders of which a session says that they had a report
        self._session, self._data = session, data
        self._given = [Store(path).folder for path in given]

    def names(self) -> list[str]:
        """By which they are opened: those of the command line, then those of the data folder."""
        return list(self._folders())

    def store(self, name: str) -> Store:
        """The campaign of that name."""
        folders = self._folders()
        if name not in folders:
            raise InputError(f"{shown(name)}: no such campaign; read the folder again")
        return Store(folders[name])

    def report(self, name: str) -> Path | None:
        """A campaign's report, by its campaign's name and its own, or None; of the data folder alone.

        One that a session said to be there is written now.
        """
        path = self._data.folder / name
        fits = path.name == REPORT and self._data.holds(path) and (path.parent / _HEADER).is_file()
        if fits and not path.is_file() and path.parent in self._said:
            with suppress(InputError):
                store = Store(path.parent)
                _result(store, any(store.plan == load_plan(one).text for one in _THESIS)).export(path)
        return path if fits and path.is_file() else None

    def has_report(self, name: str) -> bool:
        """Whether there is one, or a session said so."""
        folder = self._folders().get(name)
        return folder is not None and self._data.holds(folder) and ((folder / REPORT).is_file() or folder in self._said)

    def inputs(self, name: str) -> Inputs:
        """What a campaign's tables are made from now."""
        folder = self._folders().get(name)
        rows = [] if folder is None else sorted((str(one), _as_it_is(one)) for one in folder.rglob("*.parquet"))
        return Inputs(name, name, options={"the set of its rows": digest(rows)})

    # --- a session --------------------------------------------------------------------------------------------------

    def saved(self, name: str) -> dict[str, Any] | None:
        """The campaign of that name with its rows, for a session's file; its name alone where there is no room."""
        if name not in self._folders():
            return None
        told: dict[str, Any] = {"name": name, "campaign": None, "report": self.has_report(name)}
        with suppress(InputError):
            told["campaign"] = Room().take(stored(self.store(name).packed()))
        return told

    def restore(self, saved: Any) -> str:
        """Takes a session's into the data folder, unless it is there; its name.  InputError for what makes no sense."""
        told: SavedCampaign = taken(SavedCampaign, saved, "campaign")
        given = saved.get("campaign")
        if given is None:
            self.store(told.name)  # which says that it is not here
            return told.name
        packed, folders = restored(given, Packed), self._folders()
        if (known := folders.get(told.name)) is not None and _is_same(Store(known), packed):
            return told.name
        stem = Path(told.name).name
        stem = stem if _NAME.fullmatch(stem) else "campaign"
        for number in range(1, _MOST_ALIKE):
            name = f"{_OWN}/{stem}" + (f" ({number})" if number > 1 else "")
            if (folder := self._data.folder / name).exists():
                if name in folders and _is_same(Store(folders[name]), packed):
                    return name
                continue
            if not self._data.holds(folder):
                break
            Store.unpacked(folder, packed)
            if told.report:
                self._said.add(folder)
            return name
        raise InputError(f"{shown(stem, 60)}: too many campaigns have this name; remove some")

    # --- one that begins --------------------------------------------------------------------------------------------

    def plans(self) -> list[str]:
        """The thesis's evaluation, the shipped plans, and those of one's own in the data folder's `plans`."""
        own = sorted((self._data.folder / _PLANS).glob("*.toml"))
        named = [f"{_PLANS}/{path.name}" for path in own if self._data.holds(path)]
        return [*_THESIS, *named, *(name for name in shipped_plans() if name not in _THESIS)]

    @staticmethod
    def cores() -> int:
        """That this process may use, but for one, with which the page goes on."""
        return max(1, len(os.sched_getaffinity(0)) - 1 if hasattr(os, "sched_getaffinity") else 1)

    def about(self, asked: Computing) -> str:
        """What it would compute, and for how long, in a sentence."""
        plan, there, known = self._plan(asked.plan), set[str](), dict[str, float]()
        with suppress(InputError):  # nothing is there yet
            store = Store(self._folder(asked))
            there, known = store.names(errors=True), store.seconds()
        left = sum(task.name not in there for task in plan.tasks)
        if not left:
            return f"{plan.title}: all {len(plan.tasks)} tasks have a row in {_OWN}/{asked.name}."
        takes = duration(estimate_s(plan, there, asked.workers, known))
        begun = f", {len(plan.tasks) - left} of them are there" if left < len(plan.tasks) else ""
        return f"{plan.title}: {len(plan.tasks)} tasks{begun}. About {takes}."

    def begin(self, asked: Computing) -> bool:
        """Computes what the folder lacks, in processes of their own; False while another long run goes on."""
        plan, folder = self._plan(asked.plan), self._folder(asked)
        if asked.workers < 1:
            raise InputError("a campaign needs a process or more")
        name, count = f"{_OWN}/{asked.name}", 0

        def work(run: Run) -> Steps:
            nonlocal count
            run("beginning")
            for status in _computed(plan, folder, asked.workers, run):
                if status is not None and (rows := status.there + status.computed) != count:
                    count = rows
                    self.grown(name)
                yield
            self.grown(name)
            run("writing the report", 0.99)
            yield
            self.written(name, self._write(asked, Store(folder)))

        def done() -> str:
            errors = sum(one["errors"] for one in Store(folder).progress().values())
            return f"{plan.title}: {count} rows" + (f", {errors} of them an error." if errors else ".")

        return self.computing.begin(plan.title, work, done)

    def _plan(self, name: str) -> Plan:
        if name not in self.plans():
            raise InputError(f"{shown(name, 60)}: no such plan; choose one of the list")
        return load_plan(self._data.folder / name if name.startswith(f"{_PLANS}/") else name)

    def _folder(self, asked: Computing) -> Path:
        if not _NAME.fullmatch(asked.name):
            raise InputError(f"{shown(asked.name, 60)!r}: a campaign's name is of letters, digits and . ( ) + - _")
        path = self._data.folder / _OWN / asked.name
        if not self._data.holds(path):
            raise InputError(f"{shown(asked.name, 60)}: leads out of the data folder; give another name")
        return path

    def _write(self, asked: Computing, store: Store) -> list[Path]:
        """The report, in the campaign's folder; beside the thesis also a recording, where the viewer finds it."""
        path, found = store.folder / REPORT, _result(store, asked.reproduces)
        found.export(path)
        if not asked.reproduces:
            return [path]
        from emaviz.recording.entry import free_name  # rerun takes a second to import

        recording = free_name(self._session.folder, asked.name, ".rrd")
        found.export(recording)
        return [path, recording]

    # --- a row as a run ---------------------------------------------------------------------------------------------

    def open_row(self, campaign: str, row_name: str) -> bool:
        """Computes a row's task again and writes its recording; False while another long run goes on."""
        store = self.store(campaign)
        for kind in set(store.header.kinds.values()):
            for row in store.table(kind).to_pylist():
                if row["name"] == row_name:
                    return self._open(store.task(row))
        raise InputError(f"{shown(row_name)}: no such row; read the campaign again")

    def _open(self, task: Task) -> bool:
        return self.job.begin("Computing the row again", lambda tell: self._work(task, tell), self._done)

    def _folders(self) -> dict[str, Path]:
        found = {str(path): path for path in self._given}
        for depth in _DEPTHS:
            for header in sorted(self._data.folder.glob(f"{depth}/{_HEADER}")):
                if self._data.holds(header):
                    found.setdefault(str(header.parent.relative_to(self._data.folder)), header.parent)
        return found

    def _work(self, task: Task, tell: Tell) -> None:
        tell(f"{_named(task)}: making its recordings")
        it = inputs_of(task)
        path = self._path(task)
        _RECORDED[task.kind](task, it, path, tell)
        self._recorded = path, it.fitted[0], f"{path.name}: {_named(task)}"

    def _path(self, task: Task) -> Path:
        from emaviz.recording.entry import free_name  # rerun takes a second to import

        return free_name(self._session.folder, f"{datetime.now():%Y%m%d-%H%M%S}-{task.kind}-{task.name[:8]}", ".rrd")

    def _done(self) -> str:
        assert self._recorded is not None
        path, run, said = self._recorded
        self.opened(path, run)
        return said


def _result(store: Store, reproduces: bool) -> Result:
    """Of a campaign's rows: beside the thesis where they are its evaluation's."""
    if not reproduces:
        return Campaign(store)
    from ema_model.campaign.thesis import Evaluation, drawn

    return Evaluation(store, drawn(load_actuator()))


def _is_same(one: Store, other: Packed) -> bool:
    """Whether a folder's campaign is the one of a session, which may have fewer rows."""
    own = one.packed()
    return own.header == other.header and own.plan == other.plan and own.rows.keys() >= other.rows.keys()


def _as_it_is(path: Path) -> tuple[int, int]:
    """By which a file of rows is known again: thousands of them are not read for it."""
    with suppress(OSError):
        at = path.stat()
        return at.st_size, at.st_mtime_ns
    return 0, 0


def _computed(plan: Plan, folder: Path, workers: int, run: Run) -> Generator[Status | None, None, None]:
    """How far it is, several times a second, while processes compute; a stop ends them, and keeps their rows."""
    at: list[Status] = []

    def told(status: Status) -> None:
        at[:] = [status]
        if run.stopping:
            raise Stopped

    def compute() -> None:
        run_plan(plan, folder, scheduler(None, workers), on_progress=told)

    for _ in elsewhere(compute, "emaviz-campaign", _LOOK_S):
        if at:
            rows = at[0].there + at[0].computed
            errors = f", {at[0].errors} of them an error" if at[0].errors else ""
            run.say(f"{rows} of {at[0].total} rows{errors}", rows / max(at[0].total, 1))
        yield at[0] if at else None


def _named(task: Task) -> str:
    return f"{task.group}, {task.case or 'one case'}, seed {task.seed}"


def _configuration(task: Task) -> dict[str, Any]:
    """What the recording says of its task."""
    return {"group": task.group, "case": task.case, "seed": task.seed, "task": task.name, **task.settings}


def _identified(task: Task, it: TaskInputs, path: Path, tell: Tell) -> None:
    from emaviz.recording.identification import IdentificationStory

    own = msgspec.convert(task.settings, KINDS["identify"].settings)
    objective = Objective(it.fitted, it.actuator, circuit=own.circuit, fitness=own.fitness)
    source = "measurement" if it.truth is None else "reference"
    story = IdentificationStory(path, objective, it.fitted[0], source, it.truth, _configuration(task), [own.algorithm])

    def on_iteration(at: Progress) -> None:
        story.iteration(at)
        tell(f"{at.algorithm} {at.iteration} of {at.iterations}: rmse {at.rmse:.4f} A")

    try:
        answer = identify(
            objective,
            own.algorithm,
            population=own.population,
            iterations=own.iterations,
            seed=task.seed,
            truth=it.truth,
            parameters_known=own.parameters_known,
            polish=own.polish,
            on_iteration=on_iteration,
        )
        story.finish(answer)
    finally:
        story.close()
    if story.failed:
        raise InputError(story.failed)


def _compared(task: Task, it: TaskInputs, path: Path, tell: Tell) -> None:
    from emaviz.views.report import export

    own = msgspec.convert(task.settings, KINDS["compare"].settings)
    found = compare(it.fitted, it.actuator, calibrate=own.calibrate, holdout=it.held, on_progress=tell)
    export(found, path, _configuration(task))


def _discovered(task: Task, it: TaskInputs, path: Path, tell: Tell) -> None:
    from emaviz.views.report import export

    own = msgspec.convert(task.settings, KINDS["discover"].settings)
    signals = ["current_A"] if own.signals == "current" else None
    found = discover(
        it.fitted,
        it.actuator,
        holdout=it.held,
        signals=signals,
        most_effects=own.most_effects,
        on_progress=tell,
    )
    export(found, path, _configuration(task))


_RECORDED = {"identify": _identified, "compare": _compared, "discover": _discovered}
