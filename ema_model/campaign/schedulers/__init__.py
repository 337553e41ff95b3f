"""Who computes the tasks: processes of this machine, or any cluster that Dask runs on."""

from __future__ import annotations

from ema_model.campaign.schedulers.scheduler import MOST_DEATHS, Died, Outcome, Scheduler

__all__ = ["MOST_DEATHS", "Died", "Outcome", "Scheduler", "scheduler"]


def scheduler(address: str | None, workers: int | None) -> Scheduler:
    """Dask's at this address, or, without one, so many processes (all cores by default).

    InputError for a scheduler that is not there.
    """
    if address is None:
        from ema_model.campaign.schedulers.processes import Processes

        return Processes(workers)
    from ema_model.campaign.schedulers.cluster import Cluster

    return Cluster(address)
