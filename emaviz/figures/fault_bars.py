"""k1…k8 as dots with whiskers about the healthy value, in HTML that the app and reports share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator
from ema_model.actuator.readings import between, sentences
from ema_model.faults import FAULTS, HEALTHY
from ema_model.quantities.numbers import number
from emaviz.colours import FAULT, TRUTH
from emaviz.text.html import Html, html, joined

_LEAST_LIMIT = 1e-9
_ECCENTRICITY, _PHASE = 5, 6
_INK = "currentColor"


def fault_bars(
    k: ArrayLike,
    actuator: Actuator,
    truth: ArrayLike | None = None,
    interval90: ArrayLike | None = None,
    alarms: tuple[str, ...] = (),
    detectable: ArrayLike | None = None,
    adequate: bool = True,
) -> Html:
    """A row for each k (8,) on an axis of 0 … 1: the healthy value, a dot, its whisker, the limit of detection, words.

    interval90: (8, 2), there once the search has ended; detectable: (8,), distance from healthy where an alarm begins;
    adequate: whether the model fits, without which nothing is said of any fault.
    """
    k = np.asarray(k, dtype=float)
    ends = None if interval90 is None else np.asarray(interval90, dtype=float)
    limits = np.full(len(FAULTS), np.nan) if detectable is None else np.asarray(detectable, dtype=float)
    phrases = sentences(k, actuator) if ends is None else between(k, ends, actuator)
    rows = []
    for i, (fault, phrase) in enumerate(zip(FAULTS, phrases)):
        told = fault.name in alarms or (i == _PHASE and FAULTS[_ECCENTRICITY].name in alarms)
        marks = [_limit(HEALTHY[i], limits[i]), _box(HEALTHY[i] - 0.002, 0.004, 0, 18, _INK, 0.35)]
        if truth is not None:
            marks.append(_box(np.asarray(truth)[i] - 0.004, 0.008, 1, 16, TRUTH, 1.0))
        unknown = i == _PHASE and ends is not None and not told
        if ends is not None and not unknown:
            low, high = ends[i]
            marks.append(_box(low, max(high - low, 0.004), 8, 2, _INK, 0.85))
        if not unknown:
            marks.append(_dot(k[i], FAULT if told else _INK))
        words = phrase if ends is None or told else _unseen(i, ends[i], phrase, adequate)
        rows.append(
            html(
                '<tr title="{}">'
                '<td style="width:1%;white-space:nowrap;padding:1px 12px 1px 0"><b>{}</b> {}</td>'
                '<td style="width:30%"><div style="position:relative;height:18px;background:#8686861c;'
                'border-radius:3px">{}</div></td>'
                '<td style="width:1%;text-align:right;padding:0 6px 0 12px;font-variant-numeric:tabular-nums">{}</td>'
                '<td style="font-size:11.5px;{}">{}</td>'
                "</tr>",
                _values(i, k[i], None if ends is None else ends[i], limits[i]),
                fault.name,
                fault.title,
                joined(marks),
                "–" if unknown else f"{k[i]:.3f}",
                "font-weight:600" if told else "opacity:.8",
                words,
            )
        )
    legend = html("● identified")
    legend += html(' &nbsp;<span style="color:{}">●</span> fault', FAULT) if alarms else ""
    legend += html(' &nbsp;<span style="color:{}">▮</span> truth', TRUTH) if truth is not None else ""
    legend += html(" &nbsp;━ 90 % interval") if ends is not None else ""
    legend += html(" &nbsp;│ healthy")
    legend += html(" &nbsp;▒ below the detection limit") if detectable is not None else ""
    return html(
        '<div style="padding:0 8px;font-size:12px"><table style="width:100%;border-collapse:collapse">'
        '{}</table><div style="opacity:.7;font-size:11px;padding-top:4px">{}</div></div>',
        joined(rows),
        legend,
    )


def _values(index: int, k: float, ends: np.ndarray | None, limit: float) -> str:
    """What the row draws, in numbers, for the cursor."""
    said = [f"{FAULTS[index].name} = {k:.4f}"]
    if ends is not None:
        said.append(f"90 % interval {ends[0]:.4f} … {ends[1]:.4f}")
    said.append(f"healthy {HEALTHY[index]:g}")
    if limit > _LEAST_LIMIT:
        said.append(f"a change below {limit:.2g} cannot be seen")
    return ", ".join(said)


def _unseen(index: int, ends: np.ndarray, phrase: str, adequate: bool) -> str:
    """What is said of a k that has no alarm of its own."""
    name = FAULTS[index].name
    if not adequate:
        return "not identifiable: the model does not fit"
    if index == _PHASE:
        return "no angle without an eccentricity"
    if HEALTHY[index] == 0.0:
        return f"no fault seen ({name} < {number(_rounded_up(float(ends[1])), 2)})"
    return f"no fault seen ({phrase})"


def _rounded_up(value: float) -> float:
    """To two digits, and no less than what the bars can show."""
    value = max(value, 1e-3)
    step = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(np.ceil(value / step - 1e-9) * step)


def _limit(healthy: float, limit: float) -> Html:
    """The band about the healthy value in which a fault gives no alarm."""
    if not limit > _LEAST_LIMIT:
        return Html()
    low, high = max(healthy - limit, 0.0), min(healthy + limit, 1.0)
    return _box(low, high - low, 3, 12, "#868686", 0.45)


def _dot(value: float, colour: str) -> Html:
    return html(
        '<div style="position:absolute;left:calc({:.2f}% - 4px);top:5px;width:8px;height:8px;border-radius:50%;'
        'background:{}"></div>',
        100.0 * float(np.clip(value, 0.0, 1.0)),
        colour,
    )


def _box(left: float, width: float, top: int, height: int, colour: str, opacity: float) -> Html:
    left, right = np.clip([left, left + width], 0.0, 1.0)
    return html(
        '<div style="position:absolute;left:{:.2f}%;width:{:.2f}%;top:{}px;'
        'height:{}px;background:{};opacity:{};border-radius:1px"></div>',
        100.0 * left,
        100.0 * (right - left),
        top,
        height,
        colour,
        opacity,
    )
