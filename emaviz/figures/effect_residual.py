"""How an effect looks in the current's residual, against a variable and over time, as SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.effects import Effect
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.shown import of_residual
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.variables import of_variable
from ema_model.simulation.with_effect import WithEffect, few_periods
from emaviz.colours import DIFFERENCE
from emaviz.figures.decimate import envelope
from emaviz.figures.lines import scattered
from emaviz.figures.svg import Series, chart, told
from emaviz.text.html import Html, html, joined

Array = NDArray[np.float64]

SEVERITIES = (("low", "#ff9a9a"), ("medium", DIFFERENCE), ("high", "#991b1b"))  # shades of the residual's colour
_SIGNAL = "current_A"
_DOTS, _PERIODIC_DOTS, _POINTS = 400, 900, 600  # of a severity
_START = 0.1  # of a run, in which a loop that finds its way hides what is periodic
_SHARE, _FEWEST = 0.005, 200  # of a change's power that may lie before or behind what is shown; samples
# of a window: below the text and the sliders of most effects it is seen whole
_FITS = "width:100%;max-height:clamp(180px,calc(100vh - 665px),330px)"
_FLAT = 1e-3  # of the current's range: a change below is drawn as none


def pictures(effect: Effect, felt: Sequence[WithEffect], axes: Axes = ROTARY) -> Html:
    """The charts of an effect in one run, at each of its severities; against time there is but one."""
    shown = [(name, colour, one) for (name, colour), one in zip(SEVERITIES, felt)]
    drawn = [_series(shown, axes, "time")]
    if effect.against != "time":
        drawn.insert(0, _series(shown, axes, effect.against))
    return html('<div class="pictures">{}</div>', joined(drawn))


def picture(effect: Effect, felt: WithEffect, axes: Axes) -> Html:
    """One run against the variable that the effect follows; over time where it follows none."""
    drawn = _series([("", DIFFERENCE, felt)], axes, effect.against, _FITS)
    return html('<div class="emaviz-picture" style="padding:4px 6px">{}</div>', drawn)


def legend(effect: Effect) -> Html:
    """Which colour is which size of the effect's first parameter."""
    first = effect.parameters[0]
    shown = Quantity("", first.unit).scaled(effect.severities)
    lines = (
        html('<span><b style="color:{}">━</b> {}: {} {}</span>', colour, name, told(shown.factor * value), shown.unit)
        for (name, colour), value in zip(SEVERITIES, effect.severities)
    )
    return html('<p class="legend">{} {}</p>', first.title, joined(lines, " "))


def _series(felt: Sequence[tuple[str, str, WithEffect]], axes: Axes, variable: str, style: str = "") -> Html:
    """felt: with its name and its colour each, the slightest first; style: the picture's, in CSS."""
    residual, axis = of_residual(_SIGNAL, axes), of_variable(variable, axes)
    title = f"{residual.title} {'over' if variable == 'time' else 'against'} {in_sentence(axis.title)}"
    strongest = felt[-1][2]
    change = strongest.change(_SIGNAL)[1]
    span, dots, begin = 0.0, _DOTS, 0
    if variable == "motor_angle":  # what follows it is periodic
        span, periods = few_periods(strongest.settings)
        dots = _PERIODIC_DOTS
        begin = int(_START * len(change))
        if float(np.ptp(strongest.against(variable)[begin:])) > span:
            title += f", folded to {periods} periods"
        else:
            span = 0.0
    part = _where(change, begin)
    lines = []
    for name, colour, one in reversed(felt):  # so that a strong one hides no slight one
        x, y = one.against(variable)[part], one.change(_SIGNAL)[1][part]
        if variable == "time":
            x, y = envelope(x, [y], _POINTS)
            lines.append(Series(name, colour, x, y))
        else:
            x = np.mod(x, span) if span else x
            places = scattered(x, y, dots)
            lines.append(Series(name, colour, x[places], y[places], joined=False))
    least = _FLAT * float(np.ptp(strongest.without[_SIGNAL]))
    return chart(title, axis, residual, lines, least, style)


def _where(change: Array, begin: int) -> slice:
    """The samples from `begin` on about where nearly all of a change lies; all of these where there is none."""
    power = np.cumsum(np.where(np.arange(len(change)) < begin, 0.0, change) ** 2)
    if power[-1] == 0.0:
        return slice(begin, None)
    first, last = np.searchsorted(power, [_SHARE * power[-1], (1.0 - _SHARE) * power[-1]])
    around = max(last - first, _FEWEST) // 4
    return slice(max(first - around, begin), last + around)
