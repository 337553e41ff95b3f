"""LeRobot's datasets, versions 2 and 3: Parquet files of episodes below `data`, and what they hold in meta/info.json.

A row has all joints' positions in one field; the joints' names stand in `features`.  Version 2 has a file for each
episode, version 3 several episodes in one, told apart by `episode_index` (huggingface.co/docs/lerobot; the layout is
`DEFAULT_DATA_PATH` and `DEFAULT_FEATURES` of lerobot/datasets/utils.py).
"""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import Any

import msgspec

from ema_model.recordings.formats.channels import MOST_COLUMNS

EPISODE = "episode_index"
_INFO = os.path.join("meta", "info.json")
_FOLDERS_UP = 3  # data/chunk-000/episode_000000.parquet
_MOST_BYTES = 1_000_000


def files_in(folder: str) -> list[str]:
    """The files of a dataset's episodes, in their order; of any other folder nothing."""
    if not os.path.isfile(os.path.join(folder, _INFO)):
        return []
    return sorted(str(path) for path in Path(folder).glob("data/*/*.parquet") if path.is_file())


def has_episodes(path: str) -> bool:
    """Whether it is a file of a dataset's episodes, of one or of several."""
    return path.lower().endswith(".parquet") and EPISODE in _features(path)


def episode(index: float) -> str:
    """What a dataset calls an episode."""
    return f"episode_{int(index):06d}"


def names_of_parts(path: str) -> dict[str, list[str]]:
    """By field: what its numbers are called, of an episode of a dataset; of any other file nothing."""
    return {
        name: names
        for name, told in _features(path).items()
        if isinstance(told, dict) and (names := _flat(told.get("names")) or _counted(told.get("shape")))
    }


def _features(path: str) -> dict[str, Any]:
    folder = os.path.dirname(os.path.realpath(path))
    for _ in range(_FOLDERS_UP):
        info = os.path.join(folder, _INFO)
        if os.path.isfile(info):
            return _told(info)
        folder = os.path.dirname(folder)
    return {}


def _told(info: str) -> dict[str, Any]:
    try:
        if os.path.getsize(info) > _MOST_BYTES:
            return {}
        with open(info, "rb") as file:
            features = msgspec.json.decode(file.read())["features"]
    except (OSError, msgspec.DecodeError, RecursionError, KeyError, TypeError):
        return {}
    return features if isinstance(features, dict) else {}


def _flat(names: Any) -> list[str]:
    """Version 2.0 has them under the kind of what they name: {"motors": [...]}."""
    if isinstance(names, dict):
        names = list(itertools.chain.from_iterable(one for one in names.values() if isinstance(one, list)))
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        return []
    return names


def _counted(shape: Any) -> list[str]:
    """Numbers for parts without names, of which there are several."""
    is_row = isinstance(shape, list) and len(shape) == 1 and isinstance(shape[0], int)
    return [f"{i}" for i in range(shape[0])] if is_row and 1 < shape[0] <= MOST_COLUMNS else []
