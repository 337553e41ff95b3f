"""What units differ in, as a result, in words and JSON; and the numbers that decide it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.quantities import HALF_90, amount, in_sentence, number, of_signal, with_uncertainty
from ema_model.result import NAME, Result, as_named
from ema_model.text import Block, Document, Lines, Note, Table

# --- the numbers that decide what is said of units, each with its source ----------------------------------------------

# Probability, over all pairs of a unit and a parameter together, that equal units are said to differ: half of the 1 %
# that may be claimed falsely, since a scatter over all units is looked for as well.
FALSE = 0.005

# The same once units differ at all, that one more difference is said than there is.
FURTHER = 0.01

# Of −2 log likelihood, within which two parameters of a unit cannot be told apart: twenty to one (Kass and Raftery,
# Bayes factors, J. Am. Stat. Assoc. 90, 1995: "strong").
ALIKE = 6.0

# Of the same on recordings that were not fitted, by which they must speak against a difference before it is dropped:
# "very strong", and a share of what the fitted ones say for it, since the model's own error in another command counts
# with it and grows with the difference.  In 100 made fleets (seeds 76000 … 76315) none of the true differences stood
# below −2, which leaves room for models that miss more.
REFUSED, REFUSED_SHARE = 10.0, 0.05

# 1 σ of the size of a difference, of itself, that stays unknown however much data there are: the simplified model's
# derivative is not the actuator's.  Of 34 differences in made fleets (seeds 100 … 117) the 90 % intervals held 85 %
# without it, 91 % with it.
SLOPE = 0.04

# Fewest units that can be said to scatter: of less, each is named that differs.
SCATTER_UNITS = 4

# Share of the units up to which those that differ in a parameter are named, each with its difference: of more, the type
# has a scatter.
MINORITY = 1.0 / 3.0

# Of a tolerance that is left where a unit's recordings tell nothing of a parameter, and where they tell it.
UNTOLD, TOLD = 0.9, 0.5

# Times the floor, of what the models leave in a unit, from which on that is said.
MISFIT = 2.0


# --- what was found in comparing units --------------------------------------------------------------------------------
# What was found in comparing units: in what which of them differ, how they are of a type, which model suits which.

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Difference:
    """A parameter in which one unit is not as the others; every interval holds 90 %."""

    unit: Annotated[str, Meta(description="its name")]
    parameter: Annotated[str, Meta(description="section.name, as the actuator's file calls it", extra=NAME)]
    alike: Annotated[
        tuple[str, ...], as_named("same_as", "other parameters of the unit that would tell it as well", **NAME)
    ]
    change: Annotated[float, Meta(description="from what the others share, in the unit that ends the name")]
    change90: Annotated[Interval, as_named("interval90", "the ends of the 90 % interval about change")]
    share: Annotated[float | None, Meta(description="the change over what the others share; null: that is 0")]
    share90: Annotated[Interval | None, as_named("share_interval90", "the ends of the 90 % interval about share")]
    evidence: Annotated[float, Meta(description="of −2 log likelihood, by which a shared value is worse")]
    held_out: Annotated[
        float | None, as_named("held_out_evidence", "the same on what was not fitted; null: nothing was")
    ]

    @property
    def together(self) -> tuple[str, ...]:
        """The parameters that are known as one, that one first."""
        return (self.parameter, *self.alike)


@dataclass(frozen=True)
class OfType:
    """A parameter of the type, in its `unit`."""

    mean: Annotated[float, Meta(description="over the units")]
    mean90: Annotated[Interval, Meta(description="the ends of the 90 % interval about mean")]
    scatter: Annotated[float, Meta(description="1 σ over units; 0 where all share the value")]
    sigma: Annotated[float, Meta(description="1 σ of a further unit: scatter, and what is not known of the mean")]
    unit: Annotated[str, Meta(description="of measurement; empty for a ratio")]
    told: Annotated[bool, Meta(description="whether the recordings tell it; else it is as the file says")]


@dataclass(frozen=True)
class OfRecording:
    """In what one recording disagrees with the others of its unit: freed for it, and no difference between units."""

    unit: Annotated[str, Meta(description="the unit's name")]
    recording: Annotated[str, Meta(description="the recording's name")]
    quantity: Annotated[str, Meta(description="current_zero, current_delay or winding_temperature")]
    value: Annotated[float, Meta(description="by how much, in the unit that `in` says")]
    value90: Annotated[Interval, as_named("interval90", "the ends of the 90 % interval about value")]
    in_unit: Annotated[str, as_named("in", "the unit of measurement: A, s or K")]
    allowed_for: Annotated[
        bool, Meta(description="whether the fit allows for it; else the unit's differences are open")
    ]


@dataclass(frozen=True, eq=False)
class Alone:
    """A parameter of each unit as its own recordings tell it, the others' values aside."""

    value: Array  # (units,), in the parameter's unit
    sigma: Array  # (units,), 1 σ of it; the file's tolerance where nothing is told

    def interval90(self, unit: int) -> Interval:
        """Of one unit, by its place."""
        half = HALF_90 * float(self.sigma[unit])
        return float(self.value[unit]) - half, float(self.value[unit]) + half


@dataclass(frozen=True, eq=False)
class Transfer:
    """Each unit's own model on each unit's recordings; rows and columns are in the order of `units`."""

    signal: Annotated[str, Meta(description="that rmse and noise_floor are of, and whose unit they have", extra=NAME)]
    error: Annotated[Array, as_named("rmse", "rows: the model of, columns: the recordings of", dimensions=2)]
    floor: Annotated[Array, as_named("noise_floor", "rms that a perfect model would leave of the recordings of")]
    floors: Annotated[
        Array, Meta(description="the error of all signals in floors, as rmse is ordered", extra={"dimensions": 2})
    ]


@dataclass(frozen=True)
class Need:
    """A parameter that a unit's recordings do not tell."""

    unit: Annotated[str, Meta(description="the unit's name")]
    parameter: Annotated[str, Meta(description="section.name", extra=NAME)]
    recording: str  # of another unit, which tells it there; empty where no unit's recordings do

    @property
    def like(self) -> Annotated[str | None, Meta(description="a recording of another unit that tells it; null: none")]:
        """That recording."""
        return self.recording or None


@dataclass(frozen=True)
class UnitParameter:
    """A parameter of one unit, as its own recordings tell it."""

    value: Annotated[float, Meta(description="in `unit`")]
    interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about value")]
    unit: Annotated[str, Meta(description="of measurement; empty for a ratio")]


@dataclass(frozen=True)
class Unit:
    """One unit of the type."""

    name: Annotated[str, Meta(description="its folder, number or --unit name")]
    recordings: Annotated[tuple[str, ...], Meta(description="names of those that were fitted")]
    holdout: Annotated[tuple[str, ...], Meta(description="names of those that were not fitted")]
    error: Annotated[float, Meta(description="rms error of its own model pooled over signals, in floors")]
    parameters: Annotated[dict[str, UnitParameter], Meta(description="by section.name", extra=NAME)]


@dataclass(frozen=True, repr=False, eq=False)
class UnitsCompared(Result):
    """What units of one type differ in (with --by or --unit)."""

    actuator: Actuator  # as its file says
    units: tuple[str, ...]
    recordings: tuple[tuple[str, ...], ...]  # names, fitted, of each unit
    held_out: tuple[tuple[str, ...], ...]
    differences: Annotated[tuple[Difference, ...], Meta(description="in which units are not as the others")]
    dropped: Annotated[
        tuple[Difference, ...], as_named("contradicted", "differences that held-out recordings contradict")
    ]
    of_recordings: Annotated[tuple[OfRecording, ...], Meta(description="what is of one recording, and of no unit")]
    of_type: Annotated[dict[str, OfType], as_named("type", "what the units have in common, by section.name", **NAME)]
    alone: dict[str, Alone]  # by parameter, as `of_type`
    transfer: Annotated[Transfer, Meta(description="which model suits which unit")]
    needs: Annotated[tuple[Need, ...], as_named("needed", "what the recordings do not tell, and which would")]
    errors: Array  # (units,), of each unit's own model, in floors
    type_actuator: Actuator  # with the type's values and tolerances
    warnings: Annotated[tuple[str, ...], Meta(description="what the answer must be read with")]

    def name_in_files(self, name: str) -> str:
        """A signal's, or a parameter's path."""
        axes = self.actuator.axes
        return on_axes(name, axes).path if "." in name else axes.signal(name)

    @property
    def answer(self) -> Annotated[list[str], as_named("sentences", "the answer in words, the first one first")]:
        """What differs, and what scatters."""
        return sentences(self)

    @property
    def is_missed(self) -> bool:
        """Whether a unit's own model leaves far more than the floor."""
        return bool(np.any(self.errors > MISFIT))

    @property
    def scattering(
        self,
    ) -> Annotated[list[str], Meta(description="parameters that scatter over all units, section.name", extra=NAME)]:
        """By their paths."""
        return [path for path, one in self.of_type.items() if one.scatter > 0.0]

    @property
    def each(self) -> Annotated[list[Unit], as_named("units", "each as its own recordings tell it")]:
        """By unit, what stands elsewhere by what it is."""
        return [self._unit(place, name) for place, name in enumerate(self.units)]

    def _unit(self, place: int, name: str) -> Unit:
        parameters = {
            path: UnitParameter(float(one.value[place]), one.interval90(place), self.of_type[path].unit)
            for path, one in self.alone.items()
        }
        return Unit(name, self.recordings[place], self.held_out[place], float(self.errors[place]), parameters)


# --- what units differ in, in words -----------------------------------------------------------------------------------
# What units differ in, in words: sentences first, then what differs, the type, which model suits which, what lacks.

_WIDEST = 10  # units, up to which the matrix stands in a terminal
_MOST_NAMED = 6
_MISSED = "the models miss something, which may stand behind what seems to differ"


def sentences(result: UnitsCompared) -> list[str]:
    """'units a and b differ from the rest in viscous friction (+38 ± 6 %), nothing else', and what scatters."""
    told = [_differ(result, group) for group in _groups(result.differences)]
    for path in result.scattering:
        one = result.of_type[path]
        told.append(f"all units scatter in {_title(result, path)} (1 σ: {_amount(one.scatter, one.mean, one.unit)})")
    untold = [*dict.fromkeys(one.unit for one in result.of_recordings if not one.allowed_for)]
    if untold and len(result.units) - len(untold) < 2:
        return [
            f"in what the {len(result.units)} units differ is not told, as recordings of {and_so_on(untold)} disagree"
        ]
    if untold:  # what of the others is said, is not all
        rest = f"in what {and_so_on(untold)} may differ is not told, as recordings of one unit disagree"
        missed = [_MISSED] if told and result.is_missed else []
        return [*(told or ["nothing is found in which the others differ"]), rest, *missed]
    if not told:
        return [f"the {len(result.units)} units do not differ in anything that their recordings tell"]
    if result.is_missed:  # how sure that is, nobody knows who does not have the physics
        return [*told, _MISSED]
    return [*told[:-1], f"{told[-1]}, nothing else"]


def headline(result: UnitsCompared) -> str:
    """All of them in one, to stand above all else; a unit's name stays as it is written."""
    told = "; ".join(sentences(result))
    return told if told.startswith(result.units) else told[:1].upper() + told[1:]


def notes(result: UnitsCompared) -> list[str]:
    """What to mind: warnings, in what a unit's recordings disagree, and differences that were taken back."""
    taken_back = [_dropped(result, one) for one in result.dropped]
    return [*result.warnings, *map(_words_of_recording, result.of_recordings), *taken_back]


def rests_on(result: UnitsCompared) -> str:
    """'5 units, 15 recordings fitted, 5 held out'."""
    held = sum(map(len, result.held_out))
    aside = f", {held} held out" if held else ""
    return f"{len(result.units)} units, {sum(map(len, result.recordings))} recordings fitted{aside}"


def lacking(result: UnitsCompared) -> list[str]:
    """Which unit needs a recording of which kind, a sentence each."""
    return [*_needed(result)]


def document_of(result: UnitsCompared) -> Document:
    """All that the terminal and a notebook show."""
    blocks: list[Block] = [Lines([*sentences(result), rests_on(result)]), *map(Note, notes(result))]
    if result.differences:
        blocks.append(_differences(result))
    blocks += [_type(result), _transfer(result)]
    if lines := lacking(result):
        blocks.append(Lines(lines, "what the recordings do not tell"))
    return Document(blocks)


def _groups(differences: Sequence[Difference]) -> list[list[Difference]]:
    """Those that are one statement: of the same parameters, by amounts that may be the same."""
    groups: list[list[Difference]] = []
    for one in differences:
        for group in groups:
            same = {*group[0].together} == {*one.together}
            if same and all(
                one.change90[0] <= other.change90[1] and other.change90[0] <= one.change90[1] for other in group
            ):
                group.append(one)
                break
        else:
            groups.append([one])
    return groups


def _differ(result: UnitsCompared, group: Sequence[Difference]) -> str:
    half = np.array([0.5 * (one.change90[1] - one.change90[0]) for one in group])
    weight = half**-2 / np.sum(half**-2)
    first, change = group[0], float(sum(w * one.change for w, one in zip(weight, group)))
    known = float(np.sum(half**-2) ** -0.5)
    names = " or ".join(_title(result, path) for path in first.together)
    if len(first.together) > 1:
        names += ", which are only known together"
    of_type = result.of_type[first.parameter]
    shared = None if first.share is None else first.change / first.share
    size = _signed(change, 0.0 if result.is_missed else known, shared, of_type.unit)
    single, several = ("seems to differ", "seem to differ") if result.is_missed else ("differs", "differ")
    if len(result.units) == 2:
        return f"{' and '.join(result.units)} {several} in {names} ({first.unit} has {size})"
    units = [one.unit for one in group]
    verb = several if len(units) > 1 else single
    return f"{and_so_on(units)} {verb} from the rest in {names} ({size})"


def _differences(result: UnitsCompared) -> Table:
    rows, remarks = [], []
    for one in result.differences:
        half = 0.5 * (one.change90[1] - one.change90[0])
        of_type = result.of_type[one.parameter]
        held = "–" if one.held_out is None else ("agrees" if one.held_out > 0.0 else "says neither")
        share = "–" if one.share is None else f"{100.0 * one.share:+.3g} %"
        path = on_axes(one.parameter, result.actuator.axes).path
        sure = "–" if result.is_missed else number(half, 2)
        rows.append([f"{one.unit}: {path}", _plus(one.change), sure, share, held])
        also = [on_axes(other, result.actuator.axes).path for other in one.alike]
        remarks.append(of_type.unit + (f"  or {', '.join(also)}" if also else ""))
    return Table(("difference", "± (90 %)", "share", "held out"), rows, "what differs", remarks)


def _type(result: UnitsCompared) -> Table:
    rows, remarks = [], []
    for path, one in result.of_type.items():
        half = 0.5 * (one.mean90[1] - one.mean90[0])
        scatter = number(one.scatter, 2) if one.scatter else "–"
        rows.append([on_axes(path, result.actuator.axes).path, f"{one.mean:.5g}", number(half, 2), scatter])
        remarks.append(one.unit + ("" if one.told else "  not told: as the file says"))
    return Table(("mean", "± (90 %)", "scatter (1 σ)"), rows, "the type", remarks)


def _transfer(result: UnitsCompared) -> Table:
    """Of many units the typical and the worst, else all."""
    moved = result.transfer
    shown = of_signal(moved.signal, result.actuator.axes).scaled(float(np.max(moved.error)))
    own, other = np.diag(moved.floors), moved.floors[~np.eye(len(moved.floors), dtype=bool)]
    unit = f"{shown.unit} rms of {result.actuator.axes.signal(moved.signal)} (× floor)"
    if len(result.units) > _WIDEST:
        worst = moved.floors.max(axis=1)
        rows = [
            [name, number(own[i], 2), number(float(np.median(moved.floors[i])), 2), number(worst[i], 2)]
            for i, name in enumerate(result.units)
        ]
        return Table(("on its own", "median", "worst"), rows, "model of", unit="all signals' error, × floor")
    rows = [
        [
            name,
            *(f"{number(shown.factor * moved.error[i, j])} ({number(moved.floors[i, j], 2)})" for j in range(len(own))),
        ]
        for i, name in enumerate(result.units)
    ]
    rows.append(["the floor", *(number(shown.factor * value) for value in moved.floor)])
    title = "model of (down) on recordings of"
    return Table(result.units, rows, title, unit=unit) if len(other) else Table((), [])


def _needed(result: UnitsCompared) -> Iterator[str]:
    for path in dict.fromkeys(one.parameter for one in result.needs):
        of_it = [one for one in result.needs if one.parameter == path]
        names, title = [one.unit for one in of_it], _title(result, path)
        if of_it[0].recording:
            tell = "tell" if len(names) > 1 else "tells"
            yield f"{and_so_on(names)} {tell} nothing of {title}: a recording like {of_it[0].recording} would"
        else:
            yield f"no unit tells anything of {title}: it is as the file says, and may differ unseen"


def _dropped(result: UnitsCompared, one: Difference) -> str:
    names = " or ".join(_title(result, path) for path in one.together)
    return f"{one.unit} seemed to differ in {names}, but its held-out recordings contradict that: it is not said"


def _words_of_recording(one: OfRecording) -> str:
    factor, unit = (1e3, "ms") if one.in_unit == "s" else (1.0, one.in_unit)
    value = abs(one.value) if one.quantity == "winding_temperature" else one.value
    size = with_uncertainty(factor * value, factor * 0.5 * (one.value90[1] - one.value90[0]), unit)
    off = {
        "current_zero": f"the zero of its current is off by {size}",
        "current_delay": f"its current comes {size} later than its positions",
        "winding_temperature": f"its winding was {size} {'warmer' if one.value > 0.0 else 'colder'}",
    }[one.quantity]
    mend = "undo that delay" if one.quantity == "current_delay" else "leave that recording out"
    then = "this is allowed for" if one.allowed_for else f"{mend}; before, it is not told what the unit differs in"
    return f"{one.unit}: recording {one.recording} disagrees with the unit's others: {off}; {then}"


def _title(result: UnitsCompared, path: str) -> str:
    return in_sentence(on_axes(path, result.actuator.axes).title)


def _signed(change: float, half: float, shared: float | None, unit: str) -> str:
    """'+38 ± 6 %', or in the parameter's unit where there is nothing to count it by; half 0: nobody knows how sure."""
    if shared:
        sure = f" ± {number(100.0 * half / abs(shared), 2)}" if half else ""
        return f"{100.0 * change / abs(shared):+.3g}{sure} %".replace("-", "−")
    return ("+" if change > 0.0 else "") + (with_uncertainty(change, half, unit) if half else amount(change, unit))


def _amount(size: float, mean: float, unit: str) -> str:
    return f"{100.0 * size / abs(mean):.2g} %" if mean else amount(size, unit)


def _plus(value: float) -> str:
    return ("+" if value > 0.0 else "") + number(value)


def and_so_on(names: Sequence[str]) -> str:
    """'a, b and c', or the first and how many more."""
    if len(names) > _MOST_NAMED:
        return f"{', '.join(names[:_MOST_NAMED])} and {len(names) - _MOST_NAMED} more units"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
