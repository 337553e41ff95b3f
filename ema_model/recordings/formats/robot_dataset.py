"""LeRobot's datasets, version 2: a Parquet file for each episode below `data`, and what it holds in meta/info.json.

A row has all joints' positions in one field; the joints' names stand in `features` (huggingface.co/docs/lerobot).
"""

from __future__ import annotations

import itertools
import os
from typing import Any

import msgspec

_INFO = os.path.join("meta", "info.json")
_FOLDERS_UP = 3  # data/chunk-000/episode_000000.parquet
_MOST_BYTES = 1_000_000


def names_of_parts(path: str) -> dict[str, list[str]]:
    """By field: what its numbers are called, of an episode of a dataset; of any other file nothing."""
    folder = os.path.dirname(os.path.realpath(path))
    for _ in range(_FOLDERS_UP):
        info = os.path.join(folder, _INFO)
        if os.path.isfile(info):
            return _features(info)
        folder = os.path.dirname(folder)
    return {}


def _features(info: str) -> dict[str, list[str]]:
    try:
        if os.path.getsize(info) > _MOST_BYTES:
            return {}
        with open(info, "rb") as file:
            features = msgspec.json.decode(file.read())["features"]
        return {name: names for name, told in features.items() if (names := _flat(told.get("names")))}
    except (OSError, msgspec.DecodeError, RecursionError, KeyError, TypeError, AttributeError):
        return {}


def _flat(names: Any) -> list[str]:
    """Version 2.0 has them under the kind of what they name: {"motors": [...]}."""
    if isinstance(names, dict):
        names = list(itertools.chain.from_iterable(one for one in names.values() if isinstance(one, list)))
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        return []
    return names
