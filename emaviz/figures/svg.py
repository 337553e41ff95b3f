"""A chart as inline SVG, for pages without a script; its ink is the page's, so that it is read on light and dark."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.round_numbers import round_numbers
from emaviz.text.html import Html, escape, unescaped

Array = NDArray[np.float64]

_WIDTH, _HEIGHT = 460, 270
_LEFT, _RIGHT, _TOP, _BOTTOM = 58, 14, 26, 40
_AIR = 0.05  # of the range, above and below what is drawn
_TICKS = 6
_TURN_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0, 180.0, 360.0, 3600.0, 36000.0)  # degrees


@dataclass(frozen=True, eq=False)
class Series:
    """Points in SI units, (n,) each, joined by a line or each for itself."""

    name: str
    colour: str
    x: Array
    y: Array
    joined: bool = True


def chart(title: str, x: Quantity, y: Quantity, series: Sequence[Series], least: float = 0.0, style: str = "") -> Html:
    """One chart with its axes' titles and units, what comes first lying below.

    least: the half width of y's range, in its SI unit, that a line which hardly moves is drawn in; style: in CSS.
    Raises ValueError for points that are not finite.
    """
    across = np.concatenate([one.x for one in series])
    up = np.concatenate([one.y for one in series])
    if not (np.all(np.isfinite(across)) and np.all(np.isfinite(up))):
        raise ValueError(f"{title}: not all points are finite")
    x, y = x.scaled(across), y.scaled(max(float(np.max(np.abs(up))), least))
    horizontal = _Axis(x.factor * across.min(), x.factor * across.max(), _LEFT, _WIDTH - _RIGHT, x.unit == "°")
    low, high = min(up.min(), -least), max(up.max(), least)
    air = _AIR * (high - low)
    vertical = _Axis(y.factor * (low - air), y.factor * (high + air), _HEIGHT - _BOTTOM, _TOP)
    parts = [_grid(horizontal, vertical), _titles(title, x, y)]
    parts += [_drawn(one, horizontal.at(x.factor * one.x), vertical.at(y.factor * one.y)) for one in series]
    return unescaped(
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title)}" style="{style}" '
        f'fill="currentColor" font-size="12" font-family="system-ui,sans-serif">{"".join(parts)}</svg>'
    )


def told(value: float) -> str:
    """A round number, without zeros at its end: 0.05, 3·10⁻⁵."""
    mantissa, dot, power = number(value, 4).partition("·")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + dot + power


@dataclass(frozen=True)
class _Axis:
    """From low to high, in the shown unit, between two places in pixels."""

    low: float
    high: float
    start: float
    end: float
    is_turn: bool = False  # in degrees

    def at(self, value: Array) -> Array:
        return self.start + (self.end - self.start) * (value - self.low) / ((self.high - self.low) or 1.0)

    @property
    def ticks(self) -> list[float]:
        """Round numbers; parts of a turn where these are degrees."""
        return round_numbers(self.low, self.high, _TICKS, _TURN_STEPS if self.is_turn else ())


def _grid(x: _Axis, y: _Axis) -> str:
    lines, texts = [], []
    for value in x.ticks:
        at = float(x.at(np.array(value)))
        lines.append(f"M{at:.1f} {y.start:g}V{y.end:g}")
        texts.append(_text(at, y.start + 15, told(value), "middle"))
    for value in y.ticks:
        at = float(y.at(np.array(value)))
        lines.append(f"M{x.start:g} {at:.1f}H{x.end:g}")
        texts.append(_text(x.start - 6, at + 4, told(value), "end"))
    zero = f"M{x.start:g} {float(y.at(np.array(0.0))):.1f}H{x.end:g}" if y.low <= 0.0 <= y.high else ""
    return (
        f'<path d="{"".join(lines)}" stroke="currentColor" opacity=".15"/>'
        f'<path d="{zero}" stroke="currentColor" opacity=".5"/>{"".join(texts)}'
    )


def _titles(title: str, x: Quantity, y: Quantity) -> str:
    middle = (_TOP + _HEIGHT - _BOTTOM) / 2
    return (
        _text(_LEFT, 15, title, "start", 'font-weight="600" font-size="13"')
        + _text((_LEFT + _WIDTH - _RIGHT) / 2, _HEIGHT - 8, x.label, "middle")
        + _text(13, middle, y.label, "middle", f'transform="rotate(-90 13 {middle:g})"')
    )


def _drawn(one: Series, x: Array, y: Array) -> str:
    if one.joined:
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y))
        return f'<polyline points="{points}" fill="none" stroke="{one.colour}" stroke-width="1.4"/>'
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(x, y))
    return f'<path d="{dots}" stroke="{one.colour}" stroke-width="3" stroke-linecap="round" opacity=".75"/>'


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(text)}</text>'
