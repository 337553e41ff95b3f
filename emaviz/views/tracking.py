"""The flights of a unit: what drifts, the way to each threshold, k over the flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model.tracking.track import Tracked, headline
from emaviz.figures import tracking
from emaviz.text.results import Meaning
from emaviz.views import ANSWER, Figures, Section, View


def _remaining(result: Tracked) -> Sequence[Sequence[go.Figure]]:
    """Of each k with a remaining life: the way to the threshold, and the distribution."""
    return [
        [tracking.k_over_flights(result, name), tracking.remaining_life(one.remaining_flights)]
        for name, one in result.faults.items()
        if one.remaining_flights is not None
    ]


def _others(result: Tracked) -> Sequence[Sequence[go.Figure]]:
    """Those without a remaining life, which stands above with its k."""
    return [
        [tracking.k_over_flights(result, name)] for name, one in result.faults.items() if one.remaining_flights is None
    ]


def _lead(result: Tracked) -> str:
    return ", ".join(filter(None, (result.actuator, f"{len(result.flights)} flights")))


def _meaning(result: Tracked) -> Meaning:
    return "warning" if not result.trusted or any(one.trend for one in result.faults.values()) else "good"


def _columns(result: Tracked) -> Mapping[str, ArrayLike]:
    """k of each flight that counts, with 1 σ of its own noise."""
    found: dict[str, ArrayLike] = {"flight": np.array([one.name for one in result.usable])}
    for name, one in result.faults.items():
        found |= {name: one.k, f"{name}_sigma": one.sigma}
    return found


def _record(result: Tracked, path: Path, configuration: Mapping[str, Any]) -> None:
    """On the timeline of the flights."""
    from emaviz.recording.tracking import write_tracking  # rerun takes a second to import

    write_tracking(result, path, configuration)


VIEW = View(
    of=Tracked,
    name="track",
    title=headline,
    lead=_lead,
    sections=(
        ANSWER,
        Section("Remaining life", "remaining", (Figures(_remaining),)),
        Section("k over the flights", "flights", (Figures(_others, 220),)),
    ),
    meaning=_meaning,
    columns=_columns,
    record=_record,
)
