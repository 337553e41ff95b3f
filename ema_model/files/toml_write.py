"""TOML is written: comments, order and spelling of an older text stay, where what they say stays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Null, Table

from ema_model.files.toml_text import MARK, toml_of

_FAILURES = (TOMLKitError, ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


def toml_text(document: Mapping[str, Any], over: str = "") -> str:
    """The document as TOML; over: an older text, which is changed only where it says something else.

    An older text that is no TOML counts for nothing.
    """
    over = over.removeprefix(MARK)
    if over.strip():
        try:
            toml_of(over)  # which knows what takes long
            head, tail = _cut(over)
            whole = tomlkit.parse(head)
            above = _comments_above(whole)
            _put(whole, document)
            for table, comments in above:
                table.trivia.indent = comments
            text = tomlkit.dumps(whole)
            text += ("" if not text or text.endswith("\n") else "\n") + tail
            if toml_of(text) == _plain(document):
                return text
        except _FAILURES:  # what is written counts more than how it was spelt
            pass
    return tomlkit.dumps(document)


def inline(value: Any) -> Any:
    """The value on one line: tables within tables and lists have no heads of their own."""
    if isinstance(value, Mapping):
        table = tomlkit.inline_table()
        for name, one in value.items():
            table[_writable(name)] = inline(one)
        return table
    if isinstance(value, list | tuple):
        found = tomlkit.array()
        for one in value:
            found.append(inline(one))
        return found
    return tomlkit.item(_writable(value) if isinstance(value, str) else value)


def _writable(text: str) -> str:
    """Lone surrogates have no place in UTF-8."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _cut(text: str) -> tuple[str, str]:
    """What is said, and the comments behind all of it."""
    lines = text.split("\n")
    while lines and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
        lines.pop()
    if not lines:
        return text, ""
    said = "\n".join([*lines, ""])
    return text[: len(said)], text[len(said) :]


def _put(old: Any, new: Mapping[str, Any]) -> None:
    for name in [name for name in old if name not in new]:
        del old[name]
    for name, value in new.items():
        if name not in old:
            old[name] = value
        elif _changes_inside(old[name], value):
            _put(old[name], value)
        elif isinstance(old[name], list) and isinstance(value, list) and _are_tables(old[name], value):
            for one, other in zip(old[name], value):
                _put(one, other)
        elif not _says_the_same(_plain(old[name]), _plain(value)):
            old[name] = value


def _changes_inside(old: Any, new: Any) -> bool:
    """Whether both are tables; one on a line is written anew where it has other entries."""
    if not isinstance(old, Mapping) or not isinstance(new, Mapping):
        return False
    return not isinstance(old, InlineTable) or set(old) == set(new)


def _says_the_same(old: Any, new: Any) -> bool:
    return old == new and isinstance(old, bool) == isinstance(new, bool)


def _are_tables(old: list[Any], new: list[Any]) -> bool:
    return len(old) == len(new) and all(isinstance(one, Mapping) for one in (*old, *new))


def _plain(value: Any) -> Any:
    """The value as `tomllib` reads it."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return value.unwrap() if hasattr(value, "unwrap") else value


def _comments_above(whole: tomlkit.TOMLDocument) -> list[tuple[Table, str]]:
    """What stands above each table's head, taken from the table before it, to which tomlkit counts it.

    So a new key follows the last one, and a table that goes takes no other's comments along.
    """
    found, before = [], whole
    for table in _tables(whole):
        body = before.body
        last = next((i for i in reversed(range(len(body))) if not isinstance(body[i][1], Table)), -1)
        first = last
        while first >= 0 and body[first][0] is None:
            first -= 1
        if before is not whole or first >= 0:  # else it is the file's own head
            text = "".join(item.as_string() for _, item in body[first + 1 : last + 1])
            found.append((table, text + table.trivia.indent))
            for i in range(first + 1, last + 1):
                body[i] = (None, Null())
        before = table.value
    return found


def _tables(container: Container) -> Iterator[Table]:
    """Those with a head of their own, in their order."""
    for _, item in container.body:
        if isinstance(item, Table) and not isinstance(item, InlineTable):
            if not item.is_super_table():
                yield item
            yield from _tables(item.value)
