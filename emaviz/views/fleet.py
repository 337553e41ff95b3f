"""Units of one type beside each other: in what they differ, each unit's parameters, whose model suits whom."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike

from ema_model.fleet.result import UnitsCompared, headline
from emaviz.figures import fleet
from emaviz.text.results import of_units
from emaviz.views import ANSWER, Figures, Section, View


def _parameters(result: UnitsCompared) -> Sequence[Sequence[go.Figure]]:
    """As each unit's own recordings tell them; left out where nothing is told."""
    return [[fleet.unit_parameters(result)]] if fleet.shown(result) else []


def _transfer(result: UnitsCompared) -> Sequence[Sequence[go.Figure]]:
    """The error of each model on each unit, in floors."""
    return [[fleet.transfer_matrix(result)]]


def _lead(result: UnitsCompared) -> str:
    return f"{result.actuator.name}, {len(result.units)} units"


def _columns(result: UnitsCompared) -> Mapping[str, ArrayLike]:
    """A row for each unit: its parameters as its own recordings tell them, with 1 σ."""
    found: dict[str, ArrayLike] = {"unit": np.array(result.units)}
    for path, one in result.alone.items():
        name = result.name_in_files(path)
        found |= {name: one.value, f"{name}_sigma": one.sigma}
    return found


SECTIONS: tuple[Section[UnitsCompared], ...] = (
    ANSWER,
    Section("Parameters of each unit", "parameters", (Figures(_parameters, fleet.height_px),)),
    Section(
        "The model of one unit on another",
        "transfer",
        (Figures(_transfer, lambda result: 160 + 28 * len(result.units)),),
    ),
)

VIEW = View(
    of=UnitsCompared,
    name="units",
    title=headline,
    lead=_lead,
    sections=SECTIONS,
    meaning=of_units,
    columns=_columns,
)
