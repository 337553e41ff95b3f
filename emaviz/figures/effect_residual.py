"""How an effect looks in the current's residual at three severities, against a variable and over time, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.effects import Effect
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.shown import of_residual
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.variables import is_turn, of_variable
from ema_model.simulation.with_effect import WithEffect
from emaviz.colours import DIFFERENCE
from emaviz.figures.decimate import envelope
from emaviz.figures.lines import scattered
from emaviz.figures.svg import Series, chart, told
from emaviz.text.html import Html, html, joined

Array = NDArray[np.float64]

SEVERITIES = (("low", "#ff9a9a"), ("medium", DIFFERENCE), ("high", "#991b1b"))  # shades of the residual's colour
_SIGNAL = "current_A"
_DOTS, _POINTS = 400, 600  # of a severity
_SHARE, _FEWEST = 0.005, 200  # of a change's power that may lie before or behind what is shown; samples
_FLAT = 1e-3  # of the current's range: a change below is drawn as none


def pictures(effect: Effect, felt: Sequence[WithEffect], axes: Axes = ROTARY) -> Html:
    """The charts of an effect in one run, at each of its severities; against time there is but one."""
    drawn = [_series(effect, felt, axes, "time")]
    if effect.against != "time":
        drawn.insert(0, _series(effect, felt, axes, effect.against))
    return html('<div class="pictures">{}</div>', joined(drawn))


def legend(effect: Effect) -> Html:
    """Which colour is which size of the effect's first parameter."""
    first = effect.parameters[0]
    shown = Quantity("", first.unit).scaled(effect.severities)
    lines = (
        html('<span><b style="color:{}">━</b> {}: {} {}</span>', colour, name, told(shown.factor * value), shown.unit)
        for (name, colour), value in zip(SEVERITIES, effect.severities)
    )
    return html('<p class="legend">{} {}</p>', first.title, joined(lines, " "))


def _series(effect: Effect, felt: Sequence[WithEffect], axes: Axes, variable: str) -> Html:
    residual, axis = of_residual(_SIGNAL, axes), of_variable(variable, axes)
    title = f"{residual.title} {'over' if variable == 'time' else 'against'} {in_sentence(axis.title)}"
    part = _where(felt[-1].change(_SIGNAL)[1])
    lines = []
    for (name, colour), one in reversed(list(zip(SEVERITIES, felt))):  # so that a strong one hides no slight one
        x, y = one.against(variable)[part], one.change(_SIGNAL)[1][part]
        if variable == "time":
            x, y = envelope(x, [y], _POINTS)
            lines.append(Series(name, colour, x, y))
        else:
            x = np.mod(x, 2.0 * np.pi) if is_turn(variable, axes) else x
            places = scattered(x, y, _DOTS)
            lines.append(Series(name, colour, x[places], y[places], joined=False))
    least = _FLAT * float(np.ptp(felt[0].without[_SIGNAL]))
    return chart(title, axis, residual, lines, least)


def _where(change: Array) -> slice:
    """The samples about where nearly all of a change lies; all of them where there is none."""
    power = np.cumsum(change**2)
    if power[-1] == 0.0:
        return slice(None)
    first, last = np.searchsorted(power, [_SHARE * power[-1], (1.0 - _SHARE) * power[-1]])
    around = max(last - first, _FEWEST) // 4
    return slice(max(first - around, 0), last + around)
