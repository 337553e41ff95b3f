"""What a recorded run is, in a line: its kind and what came of it, from what its file says of itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ema_model.discovery.words import effect_title
from ema_model.quantities.numbers import number
from ema_model.quantities.titles import in_sentence

UNKNOWN = "run"


def summary(said: Mapping[str, Any]) -> tuple[str, str]:
    """('discovery', 'cogging torque: 1.69 → 0.757 × floor'); ('run', '') of a file that says nothing."""
    for key, (kind, words) in _KINDS.items():
        if isinstance(said.get(key), Mapping):
            try:
                return kind, words(said[key])
            except (KeyError, TypeError, IndexError, ValueError):  # of another version
                return kind, ""
    return UNKNOWN, ""


def _identification(found: Mapping[str, Any]) -> str:
    names = sorted({name for one in found.values() for name in one.get("alarms", ())})
    return "not healthy: " + ", ".join(names) if names else "healthy" if _all(found, "healthy") else "no single k off"


def _all(found: Mapping[str, Any], name: str) -> bool:
    return all(one.get(name) for one in found.values())


def _discovery(found: Mapping[str, Any]) -> str:
    names = [in_sentence(effect_title(str(one["name"]))) for one in found["effects"]]
    errors = [found["ladder"][at]["rmse"] for at in (0, -1)]
    if None in errors:
        fell = ""
    elif len(found["ladder"]) > 1:
        fell = f"{number(errors[0])} → {number(errors[1])} × floor"
    else:
        fell = f"{number(errors[0])} × floor"
    what = ", ".join(names) or str(found["verdict"]).replace("_", " ")
    return f"{what}: {fell}" if fell else what


def _comparison(found: Mapping[str, Any]) -> str:
    return str(found["sentences"][0])


def _tracking(found: Mapping[str, Any]) -> str:
    trends = [name for name, one in found["faults"].items() if one.get("trend")]
    return f"trend of {', '.join(trends)}" if trends else "no trend"


_KINDS: dict[str, tuple[str, Callable[[Mapping[str, Any]], str]]] = {
    "found": ("identification", _identification),
    "discovery": ("discovery", _discovery),
    "comparison": ("comparison", _comparison),
    "track": ("tracking", _tracking),
    "reproduce": ("evaluation", lambda _: "the thesis's tables beside ours"),
}
