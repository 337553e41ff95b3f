"""Folders in the layout of LeRobot's datasets (lerobot/datasets/utils.py: DEFAULT_DATA_PATH, DEFAULT_FEATURES)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

_DEFAULTS = {name: {"dtype": "int64", "shape": [1], "names": None} for name in ("frame_index", "episode_index")}
_DATA = {
    2: "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    3: "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}


def write_robot_dataset(
    root: Path,
    version: int,
    fps: float,
    names: Mapping[str, Sequence[str]],
    episodes: Sequence[Mapping[str, np.ndarray]],
) -> None:
    """names: by field, its parts; episodes: by field, numbers (n, parts) each; float32, as the robots' are."""
    parts = {name: {"dtype": "float32", "shape": [len(own)], "names": list(own)} for name, own in names.items()}
    features = {**parts, "timestamp": {"dtype": "float32", "shape": [1], "names": None}, **_DEFAULTS}
    info = {"codebase_version": f"v{version}.1", "fps": fps, "data_path": _DATA[version], "features": features}
    (root / "meta").mkdir(parents=True)
    (root / "meta" / "info.json").write_text(json.dumps(info, indent=4))
    tables = [_table(index, fps, episode) for index, episode in enumerate(episodes)]
    folder = root / "data" / "chunk-000"
    folder.mkdir(parents=True)
    if version == 3:
        pq.write_table(pa.concat_tables(tables), folder / "file-000.parquet")
        return
    for index, table in enumerate(tables):
        pq.write_table(table, folder / f"episode_{index:06d}.parquet")


def _table(index: int, fps: float, episode: Mapping[str, np.ndarray]) -> pa.Table:
    frames = np.arange(len(next(iter(episode.values()))))
    rows = {
        name: pa.FixedSizeListArray.from_arrays(pa.array(values.astype("f4").ravel()), values.shape[1])
        if values.shape[1] > 1
        else pa.array(values[:, 0].astype("f4"))
        for name, values in episode.items()
    }
    own = {
        "timestamp": (frames / fps).astype("f4"),
        "frame_index": frames,
        "episode_index": np.full(frames.size, index),
    }
    return pa.table({**rows, **own})
