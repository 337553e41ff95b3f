"""Processes killed while they save: no file is ever damaged, and the next start removes what they left."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from saving import KINDS, SIZE, save_over_and_over

from ema_model.files.written import remove_abandoned
from emaviz.recording.read import recover

# Each begins with all imports done, by a server that has done them once.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["saving"])
LONGEST_S = 0.25  # until the kill; several savings of each kind


def killed_while_saving(target: Path, after_s: float) -> None:
    """Saves to the target over and over in a process, and kills it."""
    started, begun = PROCESSES.Pipe(duplex=False)
    process = PROCESSES.Process(target=save_over_and_over, args=(target, begun))
    process.start()
    try:
        assert started.poll(60.0) and started.recv()
        time.sleep(after_s)
    finally:
        process.kill()
        process.join()


def kill(folder: Path, names: list[str], seed: int) -> Counter[str]:
    """Kills one process a name at a random moment; counts what was found.  Every target must be whole each time."""
    random = np.random.default_rng(seed)
    counts: Counter[str] = Counter()
    for number, name in enumerate(names):
        at = folder / str(number)
        at.mkdir()
        killed_while_saving(at / name, float(random.uniform(0.0, LONGEST_S)))
        left = set(os.listdir(at)) - {name, "data"}
        counts.update({"kills": 1, "left something": bool(left), "files left": len(left)})
        _is_whole(at / name)
        counts["recordings recovered"] += sum(found.ok for found in recover(at))
        remove_abandoned(at)
        left = {other for other in os.listdir(at) if not other.endswith((".rrd", ".rrd.damaged"))} - {name, "data"}
        assert not left, left
        _is_whole(at / name)
    return counts


def _is_whole(target: Path) -> None:
    values = np.asarray(KINDS[target.name][1](target))
    assert len(values) == SIZE and (values == values[0]).all()


def test_a_kill_damages_nothing(tmp_path):
    assert kill(tmp_path, list(KINDS), seed=1)["kills"] == len(KINDS)


@pytest.mark.study
def test_sixty_kills_damage_nothing(tmp_path):
    counts = kill(tmp_path, list(KINDS) * 12, seed=2)
    print("\n", ", ".join(f"{count} {what}" for what, count in counts.items()), "; 0 targets damaged", sep="")
    assert counts["kills"] == 60 and counts["left something"] > 0
