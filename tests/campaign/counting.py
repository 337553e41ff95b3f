"""For `dask worker --preload counting.py`: writes a line a task that its worker begins, into $EMAVIZ_COUNTING."""

from __future__ import annotations

import os

from distributed import WorkerPlugin


class Counting(WorkerPlugin):
    """Of one worker."""

    name = "counting"

    def transition(self, key, start, finish, **kwargs):
        if finish == "executing" and str(key).startswith("emaviz-"):
            line = f"{os.getpid()} {key}\n".encode()
            with open(os.environ["EMAVIZ_COUNTING"], "ab", buffering=0) as file:
                file.write(line)  # one write of a short line is whole, whoever else writes


async def dask_setup(worker):
    await worker.plugin_add(Counting())
