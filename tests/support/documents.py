"""What commands write with --json, held against the types that state it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec

from emaviz.cli.output import HeadJson
from emaviz.cli.verbs.schema import verbs_with_documents


def result_of(path: str | Path, verb: str) -> dict[str, Any]:
    """The result that a command wrote, "compare" or "actuator check": it has what is stated, and nothing else."""
    found = json.loads(Path(path).read_text(encoding="utf-8"))
    check_document(found, verbs_with_documents()[verb].documents())
    return found


def check_document(found: dict[str, Any], kinds: tuple[type, ...]) -> None:
    """Fails for one that is of none of these kinds, behind the head that all have."""
    head = {name: found[name] for name in HeadJson.__annotations__}
    assert msgspec.convert(head, HeadJson, strict=True) == head, "a field of the head is not stated"
    rest = {name: value for name, value in found.items() if name not in head}
    why = [misfit(rest, kind) for kind in kinds]
    assert "" in why, "; ".join(f"{kind.__name__}: {one}" for kind, one in zip(kinds, why))


def misfit(document: dict[str, Any], kind: Any) -> str:
    """Why a document is not of a kind; empty where it is."""
    try:
        # Fields that are not stated are left out.
        return "" if msgspec.convert(document, kind, strict=True) == document else "a field is not stated"
    except msgspec.ValidationError as error:
        return str(error)
