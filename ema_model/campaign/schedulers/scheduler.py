"""What computes tasks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from ema_model.campaign.task import Task

MOST_DEATHS = 3  # of the workers that had a task, after which it counts as an error


class Died(Exception):
    """The workers that had the task ended without an answer: killed, or out of memory."""


Outcome = tuple[Task, "dict[str, Any] | Died"]


class Scheduler(Protocol):
    """Workers somewhere."""

    @property
    def workers(self) -> int:
        """How many tasks it computes at a time."""
        ...

    def outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        """The rows of the tasks as they come, some at a time, or none, so that waiting can be told; closing the
        iterator ends the work.

        Raises InputError for workers that cannot compute them.
        """
        ...
