"""What a reader sees of a result: its text in every form, and the numbers in it."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Mapping
from typing import Any

from ema_model.quantities import number, with_uncertainty

_TIMES = re.compile(
    r"(?<!of )(?<![\d.])([\d.]+)(?: (?:to|→|→ ≈) ([\d.]+))? "
    r"(?:times(?! a turn| the derivative| as | an electrical)|× floor|× the floor|floors are left)"
)
_BAND = re.compile(r"true model's (?:error )?is ([\d.]+) to ([\d.]+)")
_SURE = re.compile(r"\d[^\s]* ± \d[^\s]*")


def plain(markup: str) -> str:
    """HTML in reading order, without scripts, styles and tags."""
    body = re.sub(r"<(script|style|svg)\b.*?</\1>", " ", markup, flags=re.S)
    body = re.sub(r"</?(td|th|tr|p|div|h\d|li|table|section)\b[^>]*>", "\n", body)
    return "\n".join(" ".join(line.split()) for line in html.unescape(re.sub(r"<[^>]+>", "", body)).split("\n"))


def in_floors(text: str) -> list[str]:
    """Every error in floors that a text states."""
    return [one for found in _TIMES.findall(text) for one in found if one]


def bands(text: str) -> set[tuple[str, str]]:
    """Between what a true model's error is said to lie."""
    return set(_BAND.findall(text))


def named(document: Any, names: Iterable[str]) -> list[float]:
    """All numbers of a JSON document that stand under one of these names, at any depth."""
    found: list[float] = []
    if isinstance(document, Mapping):
        for name, value in document.items():
            if name in names:
                found += _numbers(value)
            found += named(value, names)
    elif isinstance(document, list):
        for value in document:
            found += named(value, names)
    return found


def _numbers(value: Any) -> list[float]:
    if isinstance(value, Mapping):
        return [one for part in value.values() for one in _numbers(part)]
    if isinstance(value, list):
        return [one for part in value for one in _numbers(part)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def unstated(text: str, numbers: Iterable[float]) -> list[str]:
    """Errors in floors that a text states, and that are none of these numbers to the digits that are shown."""
    known = {number(one) for one in numbers} | {f"{one:.2f}" for one in numbers}
    return [one for one in in_floors(text) if one not in known]


def unsure(text: str, document: Any) -> list[str]:
    """'value ± half' of a text that are those of no value and interval of the document."""
    for said in sorted(_sure(document), key=len, reverse=True):
        text = text.replace(said, "")
    return _SURE.findall(text)


def _sure(document: Any) -> set[str]:
    found: set[str] = set()
    if isinstance(document, Mapping):
        ends = document.get("interval90")
        if ends and "value" in document:
            half, unit = 0.5 * (ends[1] - ends[0]), document.get("unit", "")
            found.add(with_uncertainty(document["value"], half, unit))
        for value in document.values():
            found |= _sure(value)
    elif isinstance(document, list):
        for value in document:
            found |= _sure(value)
    return found
