"""A frequency response: magnitude, phase and coherence, measured and of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray

from ema_model.analyses.frequency import FrequencyResponse, Response
from ema_model.analyses.frequency_words import agrees, channel_title, headline, magnitude_unit
from ema_model.quantities import HALF_90
from emaviz.figures import theme
from emaviz.text.verdicts import Meaning
from emaviz.views import ANSWER, Figures, Section, View

Array = NDArray[np.float64]

_FREQUENCY = "Frequency [Hz]"
_DECIBEL = 20.0 / np.log(10.0)  # dB of a relative error
_BAND = "rgba(47,111,222,0.18)"


def magnitude(result: FrequencyResponse) -> go.Figure:
    """Measured with its 90 % band, the model's, and the functions whose resonance and delay are told."""
    shaded = ", shaded where both differ beyond the scatter" if result.differs else ""
    unit = magnitude_unit(result)
    figure = _new(f"Magnitude{shaded}", "Magnitude [dB]" if unit == "1" else f"Magnitude [dB of {unit}]")
    theme.shade(figure, [(one.from_Hz, one.to_Hz) for one in result.differs])
    for name, side, colour, dash in _sides(result):
        if name == "measured":
            _band(figure, result.frequency_Hz, side.magnitude_dB, HALF_90 * _DECIBEL * side.sigma)
        _add(figure, name, result.frequency_Hz, side.magnitude_dB, colour, dash)
        _add(figure, f"{name}, fitted", result.frequency_Hz, side.fitted_dB, colour, "dot", width=1.0)
    _mark(figure, result)
    return figure


def phase(result: FrequencyResponse) -> go.Figure:
    """Degrees, of frequencies that count."""
    figure = _new("Phase", "Phase [°]")
    for name, side, colour, dash in _sides(result):
        if name == "measured":
            _band(figure, result.frequency_Hz, side.phase_deg, HALF_90 * np.degrees(side.sigma))
        _add(figure, name, result.frequency_Hz, side.phase_deg, colour, dash)
        _add(figure, f"{name}, fitted", result.frequency_Hz, side.fitted_deg, colour, "dot", width=1.0)
    _mark(figure, result)
    return figure


def coherence(result: FrequencyResponse) -> go.Figure:
    """γ² of both."""
    figure = _new("Coherence", "Coherence γ² [-]")
    for name, side, colour, dash in _sides(result):
        _add(figure, name, result.frequency_Hz, side.coherence, colour, dash)
    figure.update_yaxes(range=[0.0, 1.05])
    return figure


def _sides(result: FrequencyResponse) -> Sequence[tuple[str, Response, str, str]]:
    """Name, response, colour and dash."""
    both = (("measured", result.measured, theme.MEASURED, "solid"), ("model", result.model, theme.MODEL, "dash"))
    return [(name, side, colour, dash) for name, side, colour, dash in both if side is not None]


def _new(title: str, y: str) -> go.Figure:
    figure = theme.new(title, _FREQUENCY, y)
    figure.update_xaxes(type="log")
    return figure


def _add(figure: go.Figure, name: str, x: Array, y: Array, colour: str, dash: str, *, width: float = 1.8) -> None:
    line = {"color": colour, "dash": dash, "width": width}
    said = "%{x:.4g} Hz: %{y:.4g}"
    figure.add_trace(go.Scatter(x=x, y=y, mode="lines", name=name, line=line, hovertemplate=said))


def _band(figure: go.Figure, x: Array, middle: Array, half: Array) -> None:
    """Of each stretch of frequencies that count."""
    known = np.isfinite(middle) & np.isfinite(half)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(int)))
    first = True
    for start, stop in edges.reshape(-1, 2):
        part = slice(start, stop)
        around = {
            "x": np.concatenate([x[part], x[part][::-1]]),
            "y": np.concatenate([(middle + half)[part], (middle - half)[part][::-1]]),
        }
        look = {"fill": "toself", "fillcolor": _BAND, "mode": "lines", "line": {"width": 0}, "hoverinfo": "skip"}
        figure.add_trace(go.Scatter(**around, **look, name="measured, 90 %", showlegend=first))
        first = False


def _mark(figure: go.Figure, result: FrequencyResponse) -> None:
    """A line where a resonance or an antiresonance is told, in the side's colour."""
    for _, side, colour, dash in _sides(result):
        for mode in (side.resonance, side.antiresonance):
            if mode is not None:
                line = {"color": colour, "width": 1, "dash": dash}
                figure.add_vline(x=mode.frequency_Hz.value, line=line)


def _bode(result: FrequencyResponse) -> Sequence[Sequence[go.Figure]]:
    return [] if result.measured is None else [[magnitude(result)], [phase(result)]]


def _coherence(result: FrequencyResponse) -> Sequence[Sequence[go.Figure]]:
    return [] if result.measured is None else [[coherence(result)]]


def _lead(result: FrequencyResponse) -> str:
    return f"{result.actuator} beside {', '.join(result.recordings)}: {channel_title(result)}"


def _meaning(result: FrequencyResponse) -> Meaning:
    known = agrees(result)
    return "open" if known is None else "good" if known else "warning"


def _columns(result: FrequencyResponse) -> Mapping[str, ArrayLike]:
    found: dict[str, ArrayLike] = {"frequency_Hz": result.frequency_Hz, "counts": result.counts}
    for name, side, *_ in _sides(result):
        found |= {
            f"{name}_magnitude_dB": side.magnitude_dB,
            f"{name}_phase_deg": side.phase_deg,
            f"{name}_coherence": side.coherence,
        }
    return found


VIEW = View(
    of=FrequencyResponse,
    name="frequency",
    title=headline,
    lead=_lead,
    sections=(
        ANSWER,
        Section("Bode plot", "bode", (Figures(_bode, 300),)),
        Section("Coherence", "coherence", (Figures(_coherence, 220),)),
    ),
    meaning=_meaning,
    columns=_columns,
)
