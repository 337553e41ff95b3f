"""Which physics units lack, in words: all of them, some, one alone; what differs beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ema_model.discovery.words import effect_title
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.text import Block, Document, Lines, Note, Table
from ema_model.units.discovery.result import Lack, UnitsDiscovered
from ema_model.units.result import and_so_on, notes, rests_on
from ema_model.units.result import document_of as of_compared
from ema_model.units.result import sentences as of_differences


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
    beside = of_compared(result.compared).blocks
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
