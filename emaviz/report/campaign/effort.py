"""What it took: time a task, and the workers' memory."""

from __future__ import annotations

import numpy as np

from emaviz.figures import error_distribution, worker_memory
from emaviz.report.campaign.subject import Rows
from emaviz.report.section import Figures, Section, pair

_MOST_WORKERS = 8  # that are drawn


class Effort(Section[Rows]):
    """Two figures."""

    title = "Effort"
    anchor = "effort"
    place = 70

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where nothing was computed."""
        rows = [row for one in subject.by_kind.values() for row in one if row["elapsed_s"] is not None]
        if not rows:
            return ""
        rows.sort(key=lambda row: row["finished_s"])
        seconds: dict[str, list[float]] = {}
        memory: dict[str, tuple[list[float], list[float]]] = {}
        for row in rows:
            seconds.setdefault(row["group"], []).append(row["elapsed_s"])
            if row["memory_MB"] is not None:
                minutes, megabytes = memory.setdefault(row["worker"], ([], []))
                minutes.append((row["finished_s"] - rows[0]["finished_s"]) / 60.0)
                megabytes.append(row["memory_MB"])
        shown = dict(sorted(memory.items(), key=lambda one: -len(one[1][0]))[:_MOST_WORKERS])
        thin = {name: tuple(np.asarray(one)[:: max(1, len(one) // 300)] for one in its) for name, its in shown.items()}
        drawn = [figures.place(error_distribution.figure("Time of a task", "Time [s]", seconds), 320)]
        if thin:
            drawn.append(figures.place(worker_memory.figure(thin), 320))  # pyright: ignore[reportArgumentType]
        return pair(*drawn)
