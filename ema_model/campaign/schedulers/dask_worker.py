"""What a Dask worker leaves out while it computes a campaign."""

from __future__ import annotations

from typing import Any

from distributed import WorkerPlugin


class Unprofiled(WorkerPlugin):
    """Stops the worker's profiler.

    It keeps a tree of calls for each second, 0.2 MB of them: in an hour a worker would grow by several hundred.
    """

    name = "emaviz-unprofiled"
    idempotent = True

    def setup(self, worker: Any) -> None:
        """On each worker, those that join later as well."""
        for name in ("profile", "profile-cycle"):
            if (callback := worker.periodic_callbacks.pop(name, None)) is not None:
                callback.stop()
        worker.profile_history.clear()
        worker.profile_keys_history.clear()
