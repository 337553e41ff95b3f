"""A swarm of candidates as it converges: in the plane of two k, or as lines across all eight; SVG in HTML."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.faults import FAULTS, NAMES
from emaviz.colours import TRUTH
from emaviz.text.html import Html, escape, html, unescaped

Array = NDArray[np.floating]

_WIDTH, _PLANE_HEIGHT, _LINES_HEIGHT = 460, 572, 572  # as fills a column of a usual window
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 14, 10, 36
_MOST_DRAWN = 150  # candidates of one swarm
# of a window: with what stands above and below it, the picture is seen whole
_FITS = "max-height:calc(100vh - 335px);min-height:200px"
_INK = 'fill="currentColor"'


@dataclass(frozen=True, eq=False)
class Swarm:
    """One optimiser's candidates, in its colour."""

    name: str
    colour: str
    population: Array  # (n, 8)
    best: Array  # (8,)


def plane(swarms: Sequence[Swarm], x: int, y: int, truth: Array | None = None, trails: Sequence[Array] = ()) -> Html:
    """Candidates as points over k number x and y (0 … 7); ringed: the best; cross: the truth.

    trails: for each swarm the way of its best, (m, 8).
    """
    right, low = _WIDTH - _RIGHT, _PLANE_HEIGHT - _BOTTOM

    def at(k: Array) -> tuple[Array, Array]:
        k = np.atleast_2d(k)
        return _LEFT + (right - _LEFT) * k[:, x], low - (low - _TOP) * k[:, y]

    parts = [_grid(right, low)]
    parts.append(_text((_LEFT + right) / 2, _PLANE_HEIGHT - 4, f"{FAULTS[x].label} [–]", "middle"))
    turned = f'transform="rotate(-90 12 {(_TOP + low) / 2:.0f})"'
    parts.append(_text(12, (_TOP + low) / 2, f"{FAULTS[y].label} [–]", "middle", turned))
    for swarm, trail in zip(swarms, trails):
        if len(trail) > 1:
            points = " ".join(f"{px:.1f},{py:.1f}" for px, py in zip(*at(trail)))
            parts.append(
                f'<polyline points="{points}" fill="none" stroke="{swarm.colour}" stroke-width="1.4" opacity=".6"/>'
            )
    for swarm in swarms:
        dots = "".join(f"M{px:.1f} {py:.1f}h0" for px, py in zip(*at(swarm.population[:_MOST_DRAWN])))
        parts.append(
            f'<path d="{dots}" stroke="{swarm.colour}" stroke-width="5" stroke-linecap="round" opacity=".55"/>'
        )
    for swarm in swarms:
        (px,), (py,) = at(swarm.best)
        parts.append(
            f'<circle cx="{px:.1f}" cy="{py:.1f}" r="7" fill="none" stroke="{swarm.colour}" stroke-width="2.5"/>'
        )
    if truth is not None:
        (px,), (py,) = at(truth)
        parts.append(
            f'<path d="M{px - 9:.1f} {py:.1f}h18M{px:.1f} {py - 9:.1f}v18" stroke="{TRUTH}" stroke-width="2.5"/>'
        )
    return _picture(parts, _PLANE_HEIGHT) + _key(
        "● candidates", "◯ best, with its path", "✚ true value" if truth is not None else ""
    )


def lines(swarms: Sequence[Swarm], truth: Array | None = None) -> Html:
    """Candidates as lines across eight upright axes, 0 below and 1 above; bold: the best; green: the truth."""
    low = _LINES_HEIGHT - _BOTTOM - 8
    xs = np.linspace(_LEFT, _WIDTH - _RIGHT - 12, len(NAMES))

    def way(k: Array) -> str:
        ys = low - (low - _TOP) * np.asarray(k, dtype=float)
        return "M" + "L".join(f"{px:.0f} {py:.1f}" for px, py in zip(xs, ys))

    parts = []
    for px, fault in zip(xs, FAULTS):
        parts.append(f'<path d="M{px:.0f} {_TOP}V{low}" stroke="currentColor" opacity=".25"/>')
        parts.append(_text(px, low + 15, fault.name, "middle", 'font-weight="600"'))
        parts.append(_text(px, low + 29, _SHORT[fault.name], "middle", 'opacity=".7" font-size="10"'))
    for value in (0.0, 0.5, 1.0):
        parts.append(_text(_LEFT - 8, low - (low - _TOP) * value + 4, f"{value:g}", "end"))
    for swarm in swarms:
        drawn = "".join(way(k) for k in swarm.population[:_MOST_DRAWN])
        parts.append(f'<path d="{drawn}" fill="none" stroke="{swarm.colour}" stroke-width="1" opacity=".28"/>')
    for swarm in swarms:
        parts.append(f'<path d="{way(swarm.best)}" fill="none" stroke="{swarm.colour}" stroke-width="3"/>')
    if truth is not None:
        parts.append(f'<path d="{way(truth)}" fill="none" stroke="{TRUTH}" stroke-width="2.2" stroke-dasharray="6 4"/>')
    return _picture(parts, _LINES_HEIGHT) + _key(
        "thin: candidates", "bold: best", "dashed: true values" if truth is not None else ""
    )


_SHORT = dict(zip(NAMES, ("friction", "backlash", "short A", "short B", "short C", "eccentr.", "its phase", "gain")))


def _grid(right: float, low: float) -> str:
    size = f'width="{right - _LEFT}" height="{low - _TOP}"'
    parts = [f'<rect x="{_LEFT}" y="{_TOP}" {size} {_INK} opacity=".04"/>']
    for value in np.linspace(0.0, 1.0, 6):
        px, py = _LEFT + (right - _LEFT) * value, low - (low - _TOP) * value
        parts.append(f'<path d="M{px:.0f} {_TOP}V{low}M{_LEFT} {py:.0f}H{right}" stroke="currentColor" opacity=".12"/>')
        parts.append(_text(px, low + 14, f"{value:g}", "middle"))
        parts.append(_text(_LEFT - 5, py + 4, f"{value:g}", "end"))
    return "".join(parts)


def _text(x: float, y: float, text: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {_INK} {more}>{escape(text)}</text>'


def _key(*marks: str) -> Html:
    """What the marks mean; all values are severities without a unit, 0 … 1."""
    return html(
        '<div style="font-size:12px;opacity:.75;text-align:center;padding:2px 8px 6px">{} · severities, 0 … 1</div>',
        " · ".join(mark for mark in marks if mark),
    )


def _picture(parts: Sequence[str], height: int) -> Html:
    """Parts: drawn from numbers and colours of ours, and from `_text`."""
    return unescaped(
        f'<div class="emaviz-picture" style="padding:0 6px"><svg viewBox="0 0 {_WIDTH} {height}" '
        f'width="100%" font-size="11" style="{_FITS}" '
        f'font-family="system-ui,sans-serif">{"".join(parts)}</svg></div>'
    )
