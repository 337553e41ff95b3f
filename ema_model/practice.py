"""Challenges whose recordings are made when they are first opened: several units, a unit's life.

Whoever wants to solve a challenge calls `make` only; `reveal` tells the answer.
"""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ema_model import faults, simulated_fleets, simulated_lives
from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.parameters import on_axes
from ema_model.challenges.challenge import EFFECTS, Challenge, challenges, folder
from ema_model.challenges.truth import read_toml
from ema_model.errors import InputError, quoted
from ema_model.files.opened import shown
from ema_model.fleet.result import UnitsCompared
from ema_model.quantities import in_sentence
from ema_model.recordings import write_measurement
from ema_model.simulated_fleets import RUNS, UNSEEN, Fleet, draw
from ema_model.simulated_lives import Life, worn_life
from ema_model.text import InWords
from ema_model.tracking.track import Tracked

# --- what a kind of challenge does with its truth ---------------------------------------------------------------------

Truth = Mapping[str, Any]
Progress = Callable[[str, float], object]  # what goes on, and how much of it is done, 0 … 1


@dataclass(frozen=True)
class Revealed:
    """The answer: sentences, and whether what was found agrees; None where nothing was found yet."""

    lines: tuple[str, ...]
    agrees: bool | None = None


class Kind(ABC):
    """KeyError, TypeError or ValueError from these tell a truth that makes no sense."""

    @abstractmethod
    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """Writes the recordings into an empty folder."""

    @abstractmethod
    def reveal(self, truth: Truth, actuator: Actuator, found: InWords | None) -> Revealed:
        """found: what was found in them, of the kind of result that the challenge is about."""

    @abstractmethod
    def command(self, folder: str, thresholds: Mapping[str, float]) -> str:
        """The command line that goes on."""


# --- several units of one type, some of which differ ------------------------------------------------------------------


class Units(Kind):
    """The truth has a seed, the number of units, and what differs: unit (from 1), parameter, tolerances."""

    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """A folder for each unit."""
        fleet = fleet_of(truth, actuator)
        for number, name in enumerate(fleet.names):
            tell(f"recording {name}", number / len(fleet.names))
            (folder / name).mkdir()
            for run, one in simulated_fleets.recorded(fleet.unit(number), fleet.seed, number, (*RUNS, *UNSEEN)).items():
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


# --- the first flights of a unit whose end is sealed ------------------------------------------------------------------


class OneLife(Kind):
    """The truth has a seed, a law and a fault of `ema_model.simulated_lives`, and how many flights are recorded."""

    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """A file for each flight."""
        count = int(truth["flights"])
        for number, (name, one) in enumerate(simulated_lives.recorded(_life(truth), actuator, range(count))):
            tell(f"recording {name}", number / count)
            write_measurement(one, folder / f"{name}.parquet")

    def reveal(self, truth: Truth, actuator: Actuator, found: InWords | None) -> Revealed:
        """When it ended, since when it wore, and whether the 90 % interval held it."""
        life, count = _life(truth), int(truth["flights"])
        left = life.flights - count
        name = f"{life.fault} {in_sentence(faults.BY_NAME[life.fault].title)}"
        lines = [
            f"{name} reached {life.threshold:.2g} in flight {life.flights}, {left} flights after the last one recorded"
        ]
        if life.law == "onset":
            lines.append(f"it did not wear before flight {life.onset + 1}")
        if life.repaired is not None:
            lines.append(f"the part was replaced before flight {life.repaired + 1}")
        k = life.k[: count + left, faults.NAMES.index(life.fault)]
        lines.append(f"in truth it was {k[0]:.3f} in the first flight and {k[count - 1]:.3f} in the last one recorded")
        if not isinstance(found, Tracked):
            return Revealed(tuple(lines))
        said = found.faults[life.fault].remaining_flights
        late = left - (len(found.flights) - count)  # as it was to be said after the last flight that was looked at
        return Revealed(tuple(lines), said is not None and bool(np.floor(said.p05) <= late <= np.ceil(said.p95)))

    def command(self, folder: str, thresholds: Mapping[str, float]) -> str:
        """`emaviz track`."""
        return " ".join([f"emaviz track {folder}", *(f"--threshold {k}={at:g}" for k, at in thresholds.items())])


def _life(truth: Truth) -> Life:
    return worn_life(str(truth["law"]), int(truth["seed"]), fault=str(truth["fault"]))


KINDS: dict[str, Kind] = {"units": Units(), "life": OneLife()}


# --- makes the recordings of a challenge, knows them again, and tells its answer --------------------------------------

STORY = "challenge.md"  # beside the recordings: by its first line a folder is known again


def shipped(kind: str | None = None) -> list[Challenge]:
    """Those that come with the package, of one kind or of all that are made."""
    return [one for one in challenges(kind=None) if one.kind != EFFECTS and kind in (None, one.kind)]


def make(one: Challenge, where: Path, tell: Progress = lambda text, share: None) -> None:
    """Makes the recordings into a folder that is not there yet, or is empty: whole, or not at all.

    tell(text, share): what goes on, which may raise to end it.  InputError where the folder cannot be made.
    """
    kind, truth = _known(one)
    draft = where.with_name(f".{where.name}.part")
    try:
        if where.exists() and (not where.is_dir() or any(where.iterdir())):
            raise InputError(f"{shown(where)}: exists already; name another folder")
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        with _sound(one):
            kind.make(truth, load_actuator(), draft, tell)
        (draft / STORY).write_text(f"{_first(one)}\n\n{one.story}\n", encoding="utf-8")
        if where.exists():
            where.rmdir()
        draft.rename(where)
    except OSError as error:
        raise InputError(f"{shown(where)}: cannot be made ({error.strerror}); name another folder") from None
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def challenge_in(where: Path) -> Challenge | None:
    """The challenge whose recordings a folder holds."""
    try:
        with (where / STORY).open(encoding="utf-8") as file:
            first = file.readline(1000).rstrip("\n")
    except (OSError, UnicodeDecodeError):
        return None
    return next((one for one in shipped() if _first(one) == first), None)


def reveal(one: Challenge, found: InWords | None = None) -> Revealed:
    """The answer, beside what was found."""
    kind, truth = _known(one)
    with _sound(one):
        return kind.reveal(truth, load_actuator(), found)


def command(one: Challenge, where: str) -> str:
    """The command line that goes on with the recordings in a folder."""
    return KINDS[one.kind].command(where, one.thresholds)


def _first(one: Challenge) -> str:
    return f"# {one.title} ({one.name})"


def _known(one: Challenge) -> tuple[Kind, Truth]:
    kind = KINDS.get(one.kind)
    if kind is None:
        raise InputError(f"challenge {quoted(one.name)}: no such kind as {quoted(one.kind)} ({', '.join(KINDS)})")
    return kind, read_toml(folder() / "truth" / f"{one.name}.toml")


@contextmanager
def _sound(one: Challenge) -> Iterator[None]:
    try:
        yield
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f"challenge {quoted(one.name)}: its truth makes no sense ({quoted(error)})") from None
