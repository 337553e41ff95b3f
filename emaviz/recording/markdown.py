"""What a result says, and mappings, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ema_model.text import Block, Facts, Lines, Note, Remarks

_SIGNS = str.maketrans({"|": r"\|", "\n": " ", "\r": " ", "`": "'", "<": "&lt;", "[": r"\[", "*": r"\*", "_": r"\_"})


def escaped(value: object) -> str:
    """Text that Markdown shows as it is, and that cannot break a table."""
    return str(value).translate(_SIGNS)


def written(title: str, blocks: Iterable[Block]) -> str:
    """A heading, and the blocks of a document below it."""
    return "\n\n".join([f"# {escaped(title)}", *map(_block, blocks)]) + "\n"


def _block(block: Block) -> str:
    if isinstance(block, Lines):
        return "\n\n".join([*_head(block.title), *map(escaped, block.lines)])
    if isinstance(block, Note):
        return f"- ⚠ {escaped(block.line)}"
    if isinstance(block, Remarks):
        return "\n".join(f"- **{escaped(one.head)}**: {escaped(one.line)}" for one in block.remarks)
    if isinstance(block, Facts):
        rows = _rows(["", ""], list(block.facts.items()))
        return "\n\n".join([*_head(block.title), rows, *map(escaped, block.lines)])
    remarks = block.remarks or [""] * len(block.rows)
    beside = [block.unit] if block.unit or any(remarks) else []
    rows = [[*row, *([remark] if beside else [])] for row, remark in zip(block.rows, remarks)]
    return _rows([block.title, *block.head, *beside], rows)


def _head(title: str) -> list[str]:
    return [f"## {escaped(title)}"] if title else []


def _rows(head: Sequence[object], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, *rows]
    written = [f"| {' | '.join(escaped(cell) for cell in line)} |" for line in lines]
    return "\n".join([written[0], "|---" * len(head) + "|", *written[1:]])


def table(title: str, values: Mapping[str, Any]) -> str:
    """A heading and a table of two columns; a cell's line breaks and bars cannot break the table."""
    rows = "".join(f"| {_cell(name)} | {_cell(value)} |\n" for name, value in values.items())
    return f"# {_cell(title)}\n\n| quantity | value |\n|---|---|\n{rows}"


def _cell(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return " ".join(text.replace("|", "\\|").split())
