"""What the flights of a unit tell, in words: one sentence first, then a table, jumps, what was left out."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

from ema_model import faults
from ema_model.estimation.problem import ECCENTRICITY
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence
from ema_model.text import Document, Lines, Note, Table
from ema_model.tracking.evidence import AHEAD
from ema_model.tracking.history import Came
from ema_model.tracking.result import FaultTrack, Tracked

_MOST_NAMED = 5
_TRADES = 0.5  # correlation from which on two k are said to trade


def answer(result: Tracked) -> str:
    """The short one."""
    drifting = [one for one in result.faults.values() if one.trend]
    if not result.trusted:
        return "the model does not fit the last flights: no trend is trusted"
    if not drifting:
        return "no trend; remaining life not defined"
    return "; ".join(_sentence(one) for one in drifting)


def headline(result: Tracked) -> str:
    """The same to stand above all else; the name of a k stays small."""
    told = answer(result)
    return told if told[:2] in faults.BY_NAME else told[:1].upper() + told[1:]


def document_of(result: Tracked) -> Document:
    """All that the terminal and a notebook show."""
    usable = len(result.usable)
    counted = f"{len(result.flights)} flights, {usable} of them usable"
    blocks = [
        Lines([answer(result), counted]),
        *(Note(warning) for warning in result.warnings),
        _table(result),
    ]
    if ahead := _ahead(result):
        blocks.append(ahead)
    if lines := [*_jumps(result), *_trades(result), *_excluded(result)]:
        blocks.append(Lines(lines))
    return Document(blocks)


def hindsight(then: FaultTrack, came: Came) -> str:
    """What came of what was said of one k: whether it lay within the 90 % interval."""
    if then.threshold is None or not came.seen:
        return ""
    reached = f"{_called(then.name)} reached {then.threshold:g}"
    left = then.remaining_flights
    if came.crossed is None:
        since = "1 flight" if came.seen == 1 else f"{came.seen} flights"
        late = left is not None and came.seen > left.p95
        told = f", which is longer than the 90 % interval ({_flights(left.p95)})" if left and late else ""
        return f"what came: not so far, {since} later{told}"
    when = f"{came.crossed} flights later" if came.crossed != 1 else "1 flight later"
    if left is None:
        return f"what came: {reached}, {when}"
    inside = left.p05 - 0.5 <= came.crossed <= left.p95 + 0.5  # whole flights are counted
    side = "within" if inside else ("before" if came.crossed < left.p05 else "after")
    return f"what came: {reached}, {when}, {side} the 90 % interval"


def _sentence(one: FaultTrack) -> str:
    name = _called(one.name)
    told = f"{name} drifts by {number(one.drift)} a flight ({_interval(one.drift_interval90)})"
    if one.remaining_flights is None:
        return f"{told}: {one.reason}"
    left = one.remaining_flights
    if left.p95 < 0.5:
        return f"{told} and has reached {one.threshold:g}"
    return (
        f"{told} and reaches {one.threshold:g} in about {_flights(left.p50)} flights "
        f"(90 %: {_flights(left.p05)} … {_flights(left.p95)})"
    )


def _table(result: Tracked) -> Table:
    rows, remarks = [], []
    for one in result.faults.values():
        left = one.remaining_flights
        span = f"{_flights(left.p05)} … {_flights(left.p50)} … {_flights(left.p95)}" if left else "–"
        drift = f"{number(one.drift)}" if one.trend else "–"
        threshold = "–" if one.threshold is None else f"{one.threshold:g}"
        rows.append([_called(one.name), f"{one.level:.4f}", _interval(one.level_interval90), drift, threshold, span])
        remarks.append(
            one.reason or "" if not one.trend or one.threshold is not None else "a trend; no threshold was given"
        )
    return Table(("level", "90 % interval", "a flight", "threshold", "flights left 5, 50, 95 %"), rows, remarks=remarks)


def _ahead(result: Tracked) -> Table | None:
    rows = [
        [_called(one.name), *(_chance(soon.probability) for soon in one.crossing_probability)]
        for one in result.faults.values()
        if one.remaining_flights
    ]
    return Table([str(n) for n in AHEAD], rows, "crosses within the next flights, probability") if rows else None


def _jumps(result: Tracked) -> list[str]:
    return [
        f"{_called(one.name)} jumped from {jump.before:.3f} to {jump.after:.3f} before {jump.flight}"
        f"{', as after a part was replaced' if jump.replaced else ''}: it is judged anew from there"
        for one in result.faults.values()
        for jump in one.jumps
    ]


def _trades(result: Tracked) -> list[str]:
    found = []
    places = [i for i in range(len(faults.NAMES)) if i not in ECCENTRICITY]  # its direction has no name of its own
    for i, j in combinations(places, 2):
        share = result.correlation[i, j]
        if abs(share) > _TRADES:
            found.append(f"{faults.NAMES[i]} and {faults.NAMES[j]} ({share:+.2f})")
    return [f"errors of one flight trade between {', '.join(found)}"] if found else []


def _excluded(result: Tracked) -> list[str]:
    left_out = [one for one in result.flights if one.excluded]
    lines = []
    for reason, count in Counter(one.excluded for one in left_out).items():
        names = [one.name for one in left_out if one.excluded == reason]
        more = f" and {count - _MOST_NAMED} more" if count > _MOST_NAMED else ""
        lines.append(f"left out: {', '.join(names[:_MOST_NAMED])}{more} ({reason})")
    return lines


def _called(name: str) -> str:
    return f"{name} {in_sentence(faults.BY_NAME[name].title)}"


def _interval(ends: tuple[float, float]) -> str:
    return f"{number(ends[0])} … {number(ends[1])}"


def _flights(count: float) -> str:
    return f"{count:.0f}" if count < 1e4 else "over 10000"


def _chance(p: float) -> str:
    return f"{p:.3f}" if p >= 5e-4 else "< 0.001"
