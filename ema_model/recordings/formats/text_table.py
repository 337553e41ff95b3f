"""The table in a text of an unusual layout: its columns, where they stand, and where its rows do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pyarrow as pa
import pyarrow.csv as csv

from ema_model.files.limits import LINE_BYTES, megabytes
from ema_model.files.refusal import refusal
from ema_model.quantities.signals import SIGNALS
from ema_model.quantities.units import find_unit
from ema_model.recordings.formats.channels import with_unit
from ema_model.recordings.formats.stamps import is_stamp
from ema_model.recordings.formats.text_clocks import is_time, own_clocks
from ema_model.recordings.formats.text_layout import Layout, lines_of, split
from ema_model.recordings.formats.utf8 import Utf8


@dataclass(frozen=True)
class TextTable:
    """A text and its layout, and the columns that it gives."""

    path: str
    layout: Layout
    names: list[str]  # of the columns, in order; that of a column without one is ""
    places: dict[str, int]  # by name: the column in the file
    stamps: frozenset[int]  # columns of date and time
    clocks: dict[int, int]  # by column: the column of its own time; empty where all share one
    skipped: int  # lines above the numbers

    @property
    def is_plain(self) -> bool:
        """Whether there is nothing in the layout's first lines but a header and plain numbers below."""
        one = self.layout
        usual = one.encoding == "utf-8" and not one.thousands and not one.units_line and one.separator != "|"
        return usual and not self.stamps and not self.clocks and tuple(self.names) == one.cells


def table_of(path: str, layout: Layout, hint: str | None = None) -> TextTable:
    """The columns of a text so laid out."""
    lines = lines_of(path, hint)[0]
    row = [cell.strip() for cell in split(lines[layout.data_line - 1], layout.separator)]
    stamps = frozenset(i for i, cell in enumerate(row[: len(layout.cells)]) if is_stamp(cell))
    names = []
    for i, (cell, unit) in enumerate(zip(layout.cells, layout.units)):
        own = SIGNALS[cell].unit if cell in SIGNALS else ""
        is_said = bool(own) and (found := find_unit(unit, own)) is not None and found.is_si
        name = cell if is_said else with_unit(cell, unit) if cell else ""
        if cell and i in stamps:
            name = with_unit(cell if is_time(cell) else f"{cell} time", "s")
        elif cell and i == 0 and find_unit(unit, "s") and not is_time(cell):
            name = with_unit(f"{cell} time", unit)
        names.append(name)
    clocks = own_clocks(names)
    times = set(clocks.values())
    kept = [i for i in range(len(names)) if i not in times or i == min(times)]
    if not clocks:
        kept = list(range(len(names)))
    return TextTable(
        path, layout, [names[i] for i in kept], {names[i]: i for i in kept}, stamps, clocks, layout.data_line - 1
    )


def parsed(
    table: TextTable, places: Sequence[int], kind: pa.DataType, options: csv.ParseOptions, threads: bool
) -> pa.Table:
    """The columns at those places, each cell of one kind; pyarrow's error where a cell is none, or a line is odd."""
    columns = [f"{i}" for i in range(len(table.layout.cells))]
    wanted = [f"{i}" for i in places]
    with Utf8(table.path, table.layout) as text:
        return csv.read_csv(
            text,
            csv.ReadOptions(column_names=columns, skip_rows=table.skipped, use_threads=threads),
            options,
            csv.ConvertOptions(
                column_types=dict.fromkeys(wanted, kind),
                include_columns=wanted,
                null_values=[""],
                strings_can_be_null=True,
                decimal_point=table.layout.decimal,
            ),
        )


def place_of(table: TextTable, row: int) -> str:
    """Where a row of numbers stands: "line 12"."""
    seen = -1
    for number, line in enumerate(_lines(table), 1):
        if number > table.skipped and line.strip(b"\r\n"):
            seen += 1
            if seen == row:
                return f"line {number}"
    return "the last line"


def _lines(table: TextTable) -> Iterator[bytes]:
    with Utf8(table.path, table.layout) as text:
        rest = b""
        while piece := text.read(1 << 20):
            block = rest + piece
            end = max(block.rfind(b"\n"), block.rfind(b"\r", 0, -1)) + 1
            yield from block[:end].splitlines(keepends=True)
            rest = block[end:]
            if len(rest) > LINE_BYTES:
                raise refusal(table.path, f"a line is over {megabytes(LINE_BYTES)} long; one row per line is expected")
        if rest:
            yield rest
