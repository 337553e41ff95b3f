"""`emaviz schema`: what the fields of --json mean, as JSON Schema."""

from __future__ import annotations

import argparse
import json
from typing import Any

from ema_model.errors import InputError, did_you_mean, quoted
from emaviz.cli import COMMANDS
from emaviz.cli.parser import verb_of

HELP = "print what the fields of a command's --json mean, as JSON Schema"
PLACE = 14


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """VERB, in one word or two."""
    parser.add_argument(
        "verb", nargs="*", metavar="VERB", help="a command with --json: compare, actuator check; a list without it"
    )


def run(arguments: argparse.Namespace) -> int:
    """Prints the schema, or the commands that have one."""
    known = verbs_with_documents()
    wanted = " ".join(arguments.verb)
    if not wanted:
        width = max(map(len, known))
        print(*(f"{name:{width}}  {verb.HELP}" for name, verb in known.items()), sep="\n")
        return 0
    if wanted not in known:
        like = did_you_mean(wanted, known)
        raise InputError(f"schema {quoted(wanted)}: no command with --json; there are {', '.join(known)}{like}")
    print(json.dumps(schema_of(wanted, known[wanted]), indent=1, ensure_ascii=False))
    return 0


def verbs_with_documents() -> dict[str, Any]:
    """The commands that write --json, "compare" or "actuator check"."""
    found = {}
    for name in COMMANDS:
        verb = verb_of(name)
        if hasattr(verb, "VERBS"):
            found |= {f"{name} {inner}": one for inner, one in verb.VERBS.items()}
        else:
            found[name] = verb
    return {name: verb for name, verb in found.items() if hasattr(verb, "documents")}


def schema_of(name: str, verb: Any) -> dict[str, Any]:
    """JSON Schema (2020-12) of a command's --json: the head, and one of its documents."""
    import msgspec

    from emaviz.cli.output import HeadJson

    (head, *kinds), parts = msgspec.json.schema_components((HeadJson, *verb.documents()), ref_template="#/$defs/{name}")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"emaviz {name} --json",
        "allOf": [head, kinds[0] if len(kinds) == 1 else {"anyOf": kinds}],
        "$defs": parts,
    }
