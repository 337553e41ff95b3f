"""Guesses which column is which signal, and in which unit, from the names and, where given, the numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.files.refusal import listed, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.columns.by_name import Context, Guess, guesses
from ema_model.recordings.columns.mapping import ColumnMapping, MappedColumn

_LEAST = 0.3  # confidence below which a column is left aside
_SURE = 0.6  # and from which on a guess is used without asking; tried on the headers of tests/recordings/test_mapping
_AS_LIKELY = 0.04  # less than this apart, two guesses are as likely; "iq" is surer than "current" by more
_NOTHING = ColumnMapping()


def guess_mapping(
    columns: Mapping[str, ArrayLike] | Iterable[str],
    *,
    known: ColumnMapping = _NOTHING,
    counts_per_turn: int | None = None,
) -> ColumnMapping:
    """The likely mapping of a file's columns; every entry says how sure it is and why.

    `columns` are the names, or names with their numbers ((n,) each), which then help with units that the
    names leave open.  `known` is what is mapped already and stays.  `counts_per_turn` is the encoder's, for
    columns in counts.  Nothing is raised for strange names: what is not understood is in `unmapped`, with the
    reason.
    """
    tables = columns if isinstance(columns, Mapping) else {}
    settled = {entry.column for entry in known.entries}
    names = [name for name in map(str, columns) if name not in settled]
    shares = Context([*names, *settled], known)
    ranked: list[tuple[float, int, str, Guess]] = []
    reasons = {name: "its name says nothing known" for name in names}
    for order, name in enumerate(names):
        found = guesses(name, shares, counts_per_turn)
        if isinstance(found, str):
            reasons[name] = found
            continue
        for guess in found:
            guess = _checked(guess, tables.get(name))
            if guess.confidence >= _LEAST:
                ranked.append((-guess.confidence, order, name, guess))
    entries = {entry.signal: entry for entry in known.entries}
    used: set[str] = set()
    for _, _, name, guess in sorted(ranked, key=lambda item: item[:2]):
        if name in used or not name:
            continue
        if guess.signal in entries:
            reasons[name] = f"{guess.signal} is taken by {shown(entries[guess.signal].column)!r}"
            continue
        entries[guess.signal] = MappedColumn(
            guess.signal, name, guess.unit, confidence=round(guess.confidence, 2), reason=guess.reason
        )
        used.add(name)
    guessed_as = {entry.column: entry for entry in entries.values()}
    for signal, entry in entries.items():
        if entry.column not in settled:
            entries[signal] = replace(entry, rivals=_rivals(entry, ranked, guessed_as))
    ordered = tuple(entries[name] for name in SIGNALS if name in entries)
    return ColumnMapping(ordered, tuple((name, reasons[name]) for name in names if name not in used))


def doubt(entry: MappedColumn) -> str:
    """Why a guess must not be used before somebody has said so, in plain words; "" for one that is sure."""
    if entry.rivals:
        return f"{listed(map(repr, map(shown, entry.rivals)))} may be it as well"
    if entry.signal != "time_s" and not entry.unit and entry.column != entry.signal and SIGNALS[entry.signal].unit:
        return "it has no unit"  # the unit of time shows in its steps
    return entry.reason if entry.confidence < _SURE else ""


def _rivals(
    entry: MappedColumn, ranked: list[tuple[float, int, str, Guess]], chosen: Mapping[str, MappedColumn]
) -> tuple[str, ...]:
    """The columns that are as likely to be the signal, and are not used for what they are likelier to be."""
    found = []
    for _, _, column, guess in ranked:
        near = guess.signal == entry.signal and guess.confidence > entry.confidence - _AS_LIKELY
        elsewhere = chosen.get(column)
        better = elsewhere is not None and elsewhere.confidence >= guess.confidence + _AS_LIKELY
        if near and column != entry.column and not better:
            found.append(column)
    return tuple(found)


def _checked(guess: Guess, values: ArrayLike | None) -> Guess:
    """The guess, its unit and confidence improved by the numbers."""
    if values is None:
        return guess
    numbers: NDArray[np.float64] = np.asarray(values, np.float64).ravel()
    numbers = numbers[np.isfinite(numbers)]
    if numbers.size < 2:
        return guess
    if guess.signal == "time_s":
        steps = np.diff(numbers)
        if np.mean(steps > 0.0) < 0.9:
            return replace(guess, confidence=guess.confidence - 0.5, reason=f"{guess.reason}, but it does not increase")
        if not guess.unit and guess.confidence < 1.0 and "unit" not in guess.reason:
            return _time_unit(guess, float(np.median(steps)))
        return guess
    largest = float(np.max(np.abs(numbers)))
    if guess.unit or guess.confidence == 1.0:
        return guess
    if guess.signal == "duty" and 1.5 < largest <= 100.5:
        return replace(guess, unit="%", reason=f"{guess.reason}; up to {largest:.3g}, so in percent")
    if guess.signal == "temperature_C" and largest > 200.0:
        return replace(guess, unit="K", reason=f"{guess.reason}; up to {largest:.3g}, so in kelvin")
    return guess


def _time_unit(guess: Guess, step: float) -> Guess:
    """The unit of time from the step, which is 20 µs to 0.5 s in any recording worth fitting."""
    for unit, least in (("", 0.0), ("ms", 0.5), ("us", 50.0), ("ns", 50_000.0)):
        if step >= least:
            chosen = unit
    if not chosen:
        return guess
    reason = f"{guess.reason}; steps of {step:.4g}, so in {chosen}"
    return replace(guess, unit=chosen, confidence=guess.confidence - 0.1, reason=reason)
