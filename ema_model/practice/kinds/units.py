"""Several units of one type, some of which differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.fleet.result import UnitsCompared
from ema_model.practice.kinds.kind import Kind, Progress, Revealed, Truth
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import write_measurement
from ema_model.simulated_fleets import RUNS, UNSEEN, Fleet, draw, recorded
from ema_model.text import InWords


class Units(Kind):
    """The truth has a seed, the number of units, and what differs: unit (from 1), parameter, tolerances."""

    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """A folder for each unit."""
        fleet = fleet_of(truth, actuator)
        for number, name in enumerate(fleet.names):
            tell(f"recording {name}", number / len(fleet.names))
            (folder / name).mkdir()
            for run, one in recorded(fleet.unit(number), fleet.seed, number, (*RUNS, *UNSEEN)).items():
                write_measurement(one, folder / name / f"{run}.parquet")

    def reveal(self, truth: Truth, actuator: Actuator, found: InWords | None) -> Revealed:
        """Each difference, and whether exactly those were found."""
        fleet = fleet_of(truth, actuator)
        lines, hidden = [], []
        for one in truth["differences"]:
            name, path = fleet.names[one["unit"] - 1], str(one["parameter"])
            sigma = actuator.tolerances[path].sigma
            own = fleet.x[one["unit"] - 1, fleet.parameters.index(path)]
            usual = actuator.value(path) + sigma * (own - one["tolerances"])
            title = in_sentence(on_axes(path, actuator.axes).title)
            lines.append(f"{name}: {title} {100.0 * sigma * one['tolerances'] / usual:+.3g} %".replace("-", "−"))
            hidden.append((name, path))
        if not isinstance(found, UnitsCompared):
            return Revealed(tuple(lines))
        told = [(one.unit, one.together) for one in found.differences]
        seen = all(any(unit == name and path in together for unit, together in told) for name, path in hidden)
        true = all(any(unit == name and path in together for name, path in hidden) for unit, together in told)
        return Revealed(tuple(lines), seen and true)

    def command(self, folder: str, thresholds: Mapping[str, float]) -> str:
        """`emaviz compare`, by unit."""
        return f"emaviz compare {folder} --by unit --holdout '*unseen*'"


def fleet_of(truth: Truth, actuator: Actuator) -> Fleet:
    """All that its seed draws, and what the truth adds."""
    fleet = draw(actuator, int(truth["seed"]), units=int(truth["units"]), differing=0)
    x = fleet.x.copy()
    for one in truth["differences"]:
        x[int(one["unit"]) - 1, fleet.parameters.index(str(one["parameter"]))] += float(one["tolerances"])
    return replace(fleet, x=x)


KIND = Units()
