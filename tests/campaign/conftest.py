"""Tasks that are computed in the tests' own process leave it as it was."""

from __future__ import annotations

import os

import numba
import pytest

from ema_model import kernel_cache
from ema_model.campaign.rows import ENVIRONMENT
from ema_model.simulation import pack


@pytest.fixture(autouse=True)
def _as_before(monkeypatch):
    """What `rows.prepare` sets for a worker's process, taken back."""
    for name in ENVIRONMENT:
        monkeypatch.setenv(name, os.environ.get(name, ""))
        if not os.environ[name]:
            monkeypatch.delenv(name)
    monkeypatch.setattr(kernel_cache, "turns", kernel_cache.turns)
    monkeypatch.setattr(pack, "_only_library", pack._only_library)
    threads = numba.get_num_threads()
    yield
    numba.set_num_threads(threads)
