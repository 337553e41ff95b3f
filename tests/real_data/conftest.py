"""Real measurements, where they are: in ../shared/data beside the project, or where EMAVIZ_DATA points."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_PROJECT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of the real measurements; tests that need it are skipped where it is not."""
    folder = Path(os.environ.get("EMAVIZ_DATA", _PROJECT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real measurements in {folder}; tests/benchmarks/RESULTS.md says where they come from")
    return folder


@pytest.fixture(scope="session")
def actuators() -> Path:
    """The folder of the shipped actuator files."""
    return _PROJECT / "assets" / "actuators"
