"""Campaigns on the page: folders with rows, and a row computed again as a run, with its recording."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import msgspec

from ema_model.campaign.kinds import KINDS
from ema_model.campaign.plan_axes import TaskInputs, inputs_of
from ema_model.campaign.store import Store
from ema_model.campaign.task import Task
from ema_model.comparison import compare
from ema_model.discovery import discover
from ema_model.errors import InputError
from ema_model.files.opened import shown
from ema_model.identification.run import Progress, identify
from ema_model.identification.search import Objective
from ema_model.recordings import Measurement
from emaviz.session.data_folder import DataFolder
from emaviz.session.explore import Session
from emaviz.session.inputs import Inputs, digest, version_of
from emaviz.session.jobs import Job, Signal, Tell

_HEADER = "campaign.json"
_DEPTHS = ("*", "*/*")  # below the data folder


class Campaigns:
    """The campaigns below the data folder, and those that the command line has named.  InputError as `Store`."""

    def __init__(self, session: Session, data: DataFolder, given: Sequence[Path] = ()) -> None:
        self.job = Job(session.worker)
        self.opened: Signal[[Path, Measurement]] = Signal()  # a row's recording, and its run
        self._recorded: tuple[Path, Measurement, str] | None = None
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

    def inputs(self, name: str) -> Inputs:
        """What a campaign's tables are made from now."""
        folder = self._folders().get(name)
        rows = "" if folder is None else " ".join(sorted(version_of(one) for one in folder.rglob("*.parquet")))
        return Inputs(name, name, options={"the set of its rows": digest(rows)})

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
    from emaviz.recording.comparison import write_comparison

    own = msgspec.convert(task.settings, KINDS["compare"].settings)
    found = compare(it.fitted, it.actuator, calibrate=own.calibrate, holdout=it.held, on_progress=tell)
    write_comparison(found, path, _configuration(task))


def _discovered(task: Task, it: TaskInputs, path: Path, tell: Tell) -> None:
    from emaviz.recording.discovery import write_discovery

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
    write_discovery(found, path, _configuration(task))


_RECORDED = {"identify": _identified, "compare": _compared, "discover": _discovered}
