"""k1…k8 as bars against the truth, in HTML that the app and reports share."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator
from ema_model.actuator.readings import sentences
from ema_model.faults import FAULTS
from emaviz.colours import DIFFERENCE, MONITOR, TRUTH
from emaviz.text.html import Html, html, joined


def fault_bars(
    k: ArrayLike,
    actuator: Actuator,
    truth: ArrayLike | None = None,
    interval90: ArrayLike | None = None,
    alarms: tuple[str, ...] = (),
) -> Html:
    """A row for each k: name, bar in [0, 1], green tick at the truth, grey whisker for the interval, meaning."""
    k = np.asarray(k, dtype=float)
    rows = []
    for i, (fault, phrase) in enumerate(zip(FAULTS, sentences(k, actuator))):
        marks = [_box(0.0, k[i], 3, 10, DIFFERENCE if fault.name in alarms else MONITOR, 0.9)]
        if interval90 is not None:
            low, high = np.asarray(interval90)[i]
            marks.append(_box(low, max(high - low, 0.004), 7, 2, "currentColor", 0.85))
        if truth is not None:
            marks.append(_box(np.asarray(truth)[i] - 0.004, 0.008, 0, 16, TRUTH, 1.0))
        rows.append(
            html(
                "<tr>"
                '<td style="white-space:nowrap;padding:1px 6px 1px 0"><b>{}</b> {}</td>'
                '<td style="width:34%"><div style="position:relative;height:16px;background:#8686862e;'
                'border-radius:3px">{}</div></td>'
                '<td style="text-align:right;padding:0 6px;font-variant-numeric:tabular-nums">{:.3f}</td>'
                '<td style="white-space:nowrap;font-size:11px;opacity:.8">{}</td>'
                "</tr>",
                fault.name,
                fault.title,
                joined(marks),
                k[i],
                phrase,
            )
        )
    legend = html('<span style="color:{}">■</span> identified', MONITOR)
    legend += html(' &nbsp;<span style="color:{}">▮</span> truth', TRUTH) if truth is not None else ""
    legend += html(" &nbsp;━ 90 % interval") if interval90 is not None else ""
    return html(
        '<div style="padding:0 8px;font-size:12px"><table style="width:100%;border-collapse:collapse">'
        '{}</table><div style="opacity:.7;font-size:11px;padding-top:4px">{}</div></div>',
        joined(rows),
        legend,
    )


def _box(left: float, width: float, top: int, height: int, colour: str, opacity: float) -> Html:
    left, width = float(np.clip(left, 0.0, 1.0)), float(np.clip(width, 0.0, 1.0))
    return html(
        '<div style="position:absolute;left:{:.2f}%;width:{:.2f}%;top:{}px;'
        'height:{}px;background:{};opacity:{};border-radius:2px"></div>',
        100 * left,
        100 * min(width, 1 - left),
        top,
        height,
        colour,
        opacity,
    )
