"""An actuator's file from answers on the page, as `emaviz actuator new` writes it from options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from ema_model.actuator import save_actuator
from ema_model.actuator.describe import DRIVES, asked, described, entry_of, gear_of, unanswered
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import facts_of
from ema_model.actuator.plausible import implausible, missing
from ema_model.actuator.reference import usual_tolerance
from ema_model.quantities.axes import Axes
from emaviz.session.actuators import UPLOADED
from emaviz.session.data_folder import ACTUATOR_SUFFIX, DataFolder

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
        """What its controller may act through; none where the recording's current counts."""
        return DRIVES[self.controller]

    @property
    def questions(self) -> Iterator[Question]:
        """Its parameters, the gear first."""
        for path in asked(self.controller, self._drive):
            named, facts = on_axes(path, self.axes), facts_of(path, self.axes)
            empty = unanswered(path, self.axes)
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
