"""How a file was read: which columns are which signals, what of it was guessed, and what was made from others."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

from ema_model.files.refusal import shown
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.columns.mapping import ColumnMapping, MappedColumn, unit_in_name
from ema_model.recordings.formats.clocks import Clocks


@dataclass(frozen=True)
class Reading:
    """The page, the command line and side files tell and keep the same of it."""

    mapping: ColumnMapping = field(default_factory=ColumnMapping)  # in use; canonical names need no entry
    guessed: tuple[MappedColumn, ...] = ()  # those of the mapping that nobody has said
    doubts: tuple[tuple[MappedColumn, str], ...] = ()  # guesses that are not used, and why
    made: tuple[str, ...] = ()  # signals made from others
    clocks: Clocks | None = None  # of the signals, by their names in files, where they had several
    layout: str = ""  # what was found out of how the file is laid out: "header in line 4, units in line 5"

    @property
    def is_guess(self) -> bool:
        """Whether there were columns of which nobody has said what they are."""
        return bool(self.guessed or self.doubts or self.mapping.unmapped)

    @property
    def assumed(self) -> str:
        """'motor_speed_rad_s from Motordrehzahl [rpm], current_A from iq [mA]'; "" where nothing was guessed."""
        used = ", ".join(f"{entry.signal} from {_with_unit(entry)}" for entry in self.guessed)
        aside = ", ".join(f"{shown(entry.column)} ({why})" for entry, why in self.doubts)
        return "; left aside: ".join(filter(None, (used, aside))) if used else aside and f"left aside: {aside}"

    @property
    def told(self) -> str:
        """What was found out by itself, of the layout and the columns, in one line; "" where there was no question."""
        return "; ".join(filter(None, (self.layout, self.assumed)))

    def proposed(self, columns: Iterable[str]) -> ColumnMapping:
        """Everything that somebody should look at: what is used, canonical names too, and what is in doubt."""
        entries = {entry.signal: entry for entry, _ in self.doubts}
        entries |= {name: MappedColumn(name, name) for name in columns if name in SIGNALS}
        entries |= {entry.signal: entry for entry in self.mapping.entries}
        return ColumnMapping(tuple(entries[name] for name in SIGNALS if name in entries), self.mapping.unmapped)


def without_unit(columns: Collection[str]) -> list[str]:
    """The columns as a message lists them: those in whose names no unit is found say so."""
    return [
        name if name in SIGNALS or any(unit_in_name(name, signal) for signal in SIGNALS) else f"{name} (no unit)"
        for name in columns
    ]


def _with_unit(entry: MappedColumn) -> str:
    unit = f" [{entry.unit}]" if entry.unit and not unit_in_name(entry.column, entry.signal) else ""
    return f"{shown(entry.column)}{unit}"
