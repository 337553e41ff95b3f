"""A plan's text: read over that of the plan that it is like, its entries checked, and written as one file."""

from __future__ import annotations

from collections.abc import Mapping
from glob import escape
from pathlib import Path
from typing import Any

from ema_model.errors import InputError, quoted
from ema_model.files.limits import TEXT_BYTES
from ema_model.files.toml_text import toml_of
from ema_model.files.toml_write import inline, toml_text
from ema_model.files.user_file import open_user_file

_DEEPEST = 5  # plans that are like others


def document_of(path: Path, depth: int) -> dict[str, Any]:
    """The file's content over that of the plan that it is like."""
    try:
        with open_user_file(path, "a plan (.toml)", TEXT_BYTES) as file:
            document = toml_of(file.read().decode("utf-8"))
    except UnicodeDecodeError:
        raise InputError(f"{quoted(path)}: cannot be read as text (not UTF-8)") from None
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"{quoted(path)}: not valid TOML: {quoted(error)}") from None
    like = document.pop("like", None)
    if like is None:
        return document
    if not isinstance(like, str) or depth >= _DEEPEST:
        raise InputError(f"{quoted(path)}: like is the name of another plan's file, which is not like this one in turn")
    other = document_of(path.parent / like, depth + 1)
    return _over(document, other)


def _over(above: dict[str, Any], below: dict[str, Any], depth: int = 0) -> dict[str, Any]:
    """Entries of `above` go before those of `below`, down to the entries of groups and runs."""
    whole = dict(below)
    for name, entry in above.items():
        both = isinstance(entry, dict) and isinstance(below.get(name), dict) and depth < 2
        whole[name] = _over(entry, below[name], depth + 1) if both else entry
    return whole


def plan_text(document: Mapping[str, Any], file: Path) -> str:
    """The whole plan as one file, with whole paths of what it names."""
    groups = {}
    for name, table in document["groups"].items():
        table = dict(table)
        if Path(table.get("actuator", "thesis")).suffix:
            table["actuator"] = str((file.parent / table["actuator"]).resolve())
        if "recordings" in table:
            table["recordings"] = _whole_paths(table["recordings"], file.parent.resolve())
        groups[name] = table
    return toml_text({name: _at_the_top(one) for name, one in {**document, "groups": groups}.items()})


def _at_the_top(entry: Any) -> Any:
    """Tables of tables stay so, and what is in them stands on a line."""
    if not isinstance(entry, dict):
        return inline(entry)
    return {name: {key: inline(value) for key, value in table.items()} for name, table in entry.items()}


def _whole_paths(entry: Any, beside: Path) -> Any:
    if isinstance(entry, str):
        return str(Path(escape(str(beside))) / entry)
    if isinstance(entry, list):
        return [_whole_paths(one, beside) for one in entry]
    if "each" in entry:  # the others lie in those folders
        return {**entry, "each": _whole_paths(entry["each"], beside)}
    return {name: _whole_paths(one, beside) for name, one in entry.items()}


def check_names(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    """InputError for an entry that there is not."""
    for name in table:
        if name not in known:
            raise InputError(f"{where} has no {quoted(name, 60)!r}; it has {', '.join(known)}".strip())


def table_of(document: Mapping[str, Any], name: str, where: str) -> dict[str, Any]:
    """A table of it, empty where it has none; InputError where that is something else."""
    found = document.get(name, {})
    if not isinstance(found, dict):
        raise InputError(f"{where} [{name}] must be a table")
    return found
