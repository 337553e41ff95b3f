"""What units differ in, in words: sentences first, then what differs, the type, which model suits which, what lacks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ema_model.actuator.naming import on_axes
from ema_model.quantities.numbers import amount, number, with_uncertainty
from ema_model.quantities.shown import of_signal
from ema_model.quantities.titles import in_sentence
from ema_model.text import Document, Lines, Note, Table
from ema_model.text.document import Block
from ema_model.units.result import Difference, OfRecording, UnitsCompared

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
    return [*result.warnings, *map(_of_recording, result.of_recordings), *taken_back]


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


def _of_recording(one: OfRecording) -> str:
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
