"""Which physics several units of one type lack: all of them, or one alone; and what differs beside it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from msgspec import Meta

from ema_model.actuator import Actuator
from ema_model.discovery import Added, Discovery, discover
from ema_model.discovery.result import AddedInFile, effect_title, in_file
from ema_model.fleet.compare import check_units, compare_units
from ema_model.fleet.result import UnitsCompared, and_so_on, notes, rests_on
from ema_model.fleet.result import document_of as document_of_compared
from ema_model.fleet.result import sentences as of_differences
from ema_model.quantities import in_sentence, number
from ema_model.recordings import Measurement
from ema_model.result import Result, as_named
from ema_model.text import Block, Document, Lines, Note, Table

# --- looks for the physics that units lack: unit by unit, and in each again for what others lack ----------------------
# Each unit's parameters are its own in this, so that what units differ in is no effect that they lack.  An effect that
# at least half of the units lack is asked of the others by itself, since one rival less may tell it; what a unit lacks
# besides is looked for with that in its model.  Every claim of a unit is one of its own recordings, held-out ones too:
# evidence is not added up over units, so that an effect too weak for each of them is not found.

Progress = Callable[[str], None]
_Units = Mapping[str, Sequence[Measurement]]


def discover_units(
    units: _Units,
    actuator: Actuator,
    *,
    holdout: _Units | None = None,
    signals: Sequence[str] | None = None,
    most_effects: int = 100,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> UnitsDiscovered:
    """The recordings of several units of one type, by the units' names.

    holdout: recordings that are not fitted, by which each unit's effects are confirmed; most_effects: of a unit.
    Raises InputError for one unit only, and for recordings that cannot be compared.
    """
    tell = on_progress or (lambda text: None)
    held = holdout or {}
    check_units(units, held)

    def look(name: str, model: Actuator, most: int, candidates: Sequence[str] | None = None) -> Discovery:
        return discover(
            units[name],
            model,
            holdout=held.get(name, ()),
            signals=signals,
            candidates=candidates,
            most_effects=most,
            on_progress=lambda text: tell(f"{name}: {text}"),
        )

    last = {name: look(name, actuator, most_effects) for name in units}
    added: dict[str, list[Added]] = {name: [*one.effects] for name, one in last.items()}
    for effect in _often(added):
        for name in units:
            if any(_is_it(one, effect) for one in added[name]):
                continue
            alone = look(name, actuator, 1, [effect])
            if alone.effects:
                rest = look(name, alone.actuator, max(0, most_effects - 1))
                last[name], added[name] = rest, [*alone.effects, *rest.effects]
    lacks = _lacks(added)
    common = [one for one in lacks if len(one.by_unit) == len(units)]
    model = _with(actuator, common, last)
    compared = compare_units(units, model, holdout=held, seed=seed, on_progress=tell)
    return UnitsDiscovered(
        tuple(units), tuple(lacks), last, compared, model, frozenset(name for name in units if held.get(name))
    )


def _is_it(one: Added, effect: str) -> bool:
    return one.name == effect or effect in one.same_as


def _often(added: Mapping[str, Sequence[Added]]) -> list[str]:
    """Effects that half of the units lack, or more, the most frequent first."""
    names = dict.fromkeys(one.name for of_unit in added.values() for one in of_unit)
    counts = {name: sum(any(_is_it(one, name) for one in of_unit) for of_unit in added.values()) for name in names}
    return sorted((name for name in names if 2 * counts[name] >= len(added)), key=lambda name: -counts[name])


def _lacks(added: Mapping[str, Sequence[Added]]) -> list[Lack]:
    """By effect, those that most units lack first; a unit's rival of another unit's effect is that effect."""
    left = {name: [*of_unit] for name, of_unit in added.items()}
    found = []
    while any(left.values()):
        names = dict.fromkeys(one.name for of_unit in left.values() for one in of_unit)
        of_it = {
            effect: {
                name: next(one for one in of_unit if _is_it(one, effect))
                for name, of_unit in left.items()
                if any(_is_it(one, effect) for one in of_unit)
            }
            for effect in names
        }
        effect = max(names, key=lambda name: len(of_it[name]))
        by_unit = of_it[effect]
        rivals = set.intersection(*({one.name, *one.same_as} for one in by_unit.values())) - {effect}
        found.append(Lack(effect, by_unit, tuple(sorted(rivals))))
        left = {name: [one for one in of_unit if one is not by_unit.get(name)] for name, of_unit in left.items()}
    return found


def _with(actuator: Actuator, common: Sequence[Lack], last: Mapping[str, Discovery]) -> Actuator:
    """The actuator with effects as one unit has them, free to differ: the unit that holds all under their own names."""
    for lack in common:
        unit, one = next(((u, one) for u, one in lack.by_unit.items() if one.name == lack.effect))
        improved = last[unit].actuator
        prefix = f"effects.{one.key}."
        tolerances = {path: tolerance for path, tolerance in improved.tolerances.items() if path.startswith(prefix)}
        actuator = replace(
            actuator,
            effects={**actuator.effects, one.key: improved.effects[one.key]},
            tolerances={**actuator.tolerances, **tolerances},
        )
    return actuator


# --- what was found in looking for the physics that units lack --------------------------------------------------------


@dataclass(frozen=True)
class Lack:
    """An effect that some units lack, each by its own recordings, fitted and held out."""

    effect: str
    by_unit: Mapping[str, Added]  # of those that lack it
    same_as: tuple[str, ...]  # effects that no unit's recordings tell from it

    @property
    def units(self) -> tuple[str, ...]:
        """Those that lack it."""
        return tuple(self.by_unit)


@dataclass(frozen=True)
class LackInFile:
    """An effect that units lack."""

    name: Annotated[str, Meta(description="as `emaviz effects` lists it")]
    same_as: Annotated[tuple[str, ...], Meta(description="effects that no unit's recordings tell from it")]
    all_units: Annotated[bool, Meta(description="whether all units lack it")]
    units: Annotated[dict[str, AddedInFile], Meta(description="those that lack it, by name, as their recordings tell")]


@dataclass(frozen=True, repr=False, eq=False)
class UnitsDiscovered(Result):
    """Which physical effects the model of a type lacks (with --by or --unit)."""

    units: tuple[str, ...]
    lacks: tuple[Lack, ...]  # those that all units lack first
    discoveries: Annotated[Mapping[str, Discovery], Meta(description="of each unit, by its name")]  # the last one
    compared: Annotated[UnitsCompared, Meta(description="what differs, with what all units lack in the model")]
    actuator: Actuator  # the file's, with what all units lack
    held_out: frozenset[str]  # units with recordings that were not fitted

    @property
    def answer(self) -> Annotated[list[str], as_named("sentences", "the answer in words, the first one first")]:
        """What is lacking, and what differs beside it."""
        return sentences(self)

    @property
    def lacking(
        self,
    ) -> Annotated[list[LackInFile], as_named("effects", "what is missing, that of most units first")]:
        """What units lack, by the names in files."""
        axes = self.actuator.axes
        return [
            LackInFile(
                lack.effect,
                lack.same_as,
                self.is_of_all(lack),
                {unit: in_file(one, axes) for unit, one in lack.by_unit.items()},
            )
            for lack in self.lacks
        ]

    def is_of_all(self, one: Lack) -> bool:
        """Whether all units lack it."""
        return len(one.by_unit) == len(self.units)

    @property
    def unexplained(
        self,
    ) -> Annotated[tuple[str, ...], Meta(description="units of which something is left that no effect explains")]:
        """Units of which more than the floor is left, that no effect explains."""
        return tuple(
            name
            for name, one in self.discoveries.items()
            if one.verdict in ("unknown_effect", "partly_explained") and not one.at_floor
        )

    @property
    def undecided(
        self,
    ) -> Annotated[tuple[str, ...], Meta(description="units of which nothing can be said")]:
        """Units of which nothing can be said: not converged, not repeatable, or of recordings that tell nothing."""
        nothing = ("not_converged", "not_repeatable", "uninformative")
        return tuple(name for name, one in self.discoveries.items() if one.verdict in nothing)


# --- which physics units lack, in words: all of them, some, one alone; what differs beside it -------------------------


def sentences(result: UnitsDiscovered) -> list[str]:
    """'all 3 units lack cogging torque', 'right alone lacks …', and what differs beside it."""
    told = [_lack(result, one) for one in result.lacks]
    if not told:
        told = [f"no effect is found that any of the {len(result.units)} units lacks"]
    if result.unexplained:
        told.append(f"of {and_so_on(result.unexplained)} something is left that no effect explains")
    if result.undecided:
        told.append(
            f"of {and_so_on(result.undecided)} nothing can be said: the fit has not converged, or no run repeats"
        )
    first, *rest = of_differences(result.compared)
    return [*told, f"beside it, {first}" if result.lacks else first, *rest]


def headline(result: UnitsDiscovered) -> str:
    """All of them in one, to stand above all else; a unit's name stays as it is written."""
    told = "; ".join(sentences(result))
    return told if told.startswith(result.units) else told[:1].upper() + told[1:]


def document_of(result: UnitsDiscovered) -> Document:
    """All that the terminal and a notebook show."""
    blocks: list[Block] = [Lines([*sentences(result), rests_on(result.compared)])]
    blocks += map(Note, [*_unconfirmed(result), *notes(result.compared)])
    if result.lacks:
        blocks.append(_table(result))
    beside = document_of_compared(result.compared).blocks
    return Document([*blocks, *(one for one in beside if isinstance(one, Table) or getattr(one, "title", ""))])


def _lack(result: UnitsDiscovered, one: Lack) -> str:
    name = " or ".join(in_sentence(effect_title(effect)) for effect in (one.effect, *one.same_as))
    if one.same_as:
        name += ", which these recordings do not tell apart"
    if result.is_of_all(one):
        return f"all {len(result.units)} units lack {name}"
    others = [unit for unit in result.units if unit not in one.by_unit]
    untold = [unit for unit in others if unit in (*result.unexplained, *result.undecided)]
    without = [unit for unit in others if unit not in untold]
    rest = [f"{and_so_on(without)} {'do' if len(without) > 1 else 'does'} not show it"] if without else []
    rest += [f"whether {and_so_on(untold)} {'do' if len(untold) > 1 else 'does'} is not told"] if untold else []
    lacks = (
        f"{one.units[0]} {'' if untold else 'alone '}lacks" if len(one.by_unit) == 1 else f"{and_so_on(one.units)} lack"
    )
    return f"{lacks} {name}; {', and '.join(rest)}"


def _unconfirmed(result: UnitsDiscovered) -> Iterator[str]:
    without = [name for name in result.units if name not in result.held_out]
    if without and result.lacks:
        yield f"{and_so_on(without)}: no recording is held out, so that what is lacking there is not confirmed by one"


def _table(result: UnitsDiscovered) -> Table:
    rows: list[Sequence[str]] = []
    for lack in result.lacks:
        for unit, one in lack.by_unit.items():
            errors = (one.rmse_before, one.rmse_after, one.holdout_before, one.holdout_after)
            shown = ["–" if error is None else number(error, 3) for error in errors]
            rows.append([f"{unit}: {in_sentence(effect_title(one.name))}", *shown])
    head = ("fitted, before", "after", "held out, before", "after")
    return Table(head, rows, "what is lacking", unit="error, × floor")


# --- which physics several units of one type lack: all of them, or one alone; and what differs beside it --------------

__all__ = ["Lack", "UnitsDiscovered", "discover_units"]
