"""What `emaviz compare` says of a folder of recordings whose actuator's file lies in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from emaviz.cli import main
from support.documents import result_of


def one_file(path: Path, parts: list[dict[str, np.ndarray]]) -> None:
    """Several recordings, one after another, as one CSV."""
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    rows = np.column_stack(list(table.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(table), comments="", fmt="%.10g")


def compared(folder: Path, *arguments: object) -> dict[str, Any]:
    """The JSON of a comparison that succeeds."""
    out = folder / "result.json"
    given = [str(one) for one in arguments]
    assert main(["compare", *given, "--actuator", str(folder / "mine.toml"), "--json", str(out)]) == 0
    return result_of(out, "compare")
