"""k1…k8 as bars against the truth, in HTML that the app and reports share."""

from __future__ import annotations

import html

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator import Actuator
from ema_model.faults import FAULTS, sentences
from emaviz.colours import DIFFERENCE, MONITOR, TRUTH


def fault_bars(
    k: ArrayLike,
    actuator: Actuator,
    truth: ArrayLike | None = None,
    interval90: ArrayLike | None = None,
    alarms: tuple[str, ...] = (),
) -> str:
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
            "<tr>"
            f'<td style="white-space:nowrap;padding:1px 6px 1px 0"><b>{fault.name}</b> {html.escape(fault.title)}</td>'
            '<td style="width:34%"><div style="position:relative;height:16px;background:#8686862e;border-radius:3px">'
            f"{''.join(marks)}</div></td>"
            f'<td style="text-align:right;padding:0 6px;font-variant-numeric:tabular-nums">{k[i]:.3f}</td>'
            f'<td style="white-space:nowrap;font-size:11px;opacity:.8">{html.escape(phrase)}</td>'
            "</tr>"
        )
    legend = f'<span style="color:{MONITOR}">■</span> identified'
    legend += f' &nbsp;<span style="color:{TRUTH}">▮</span> truth' if truth is not None else ""
    legend += " &nbsp;━ 90 % interval" if interval90 is not None else ""
    return (
        '<div style="padding:0 8px;font-size:12px"><table style="width:100%;border-collapse:collapse">'
        f'{"".join(rows)}</table><div style="opacity:.7;font-size:11px;padding-top:4px">{legend}</div></div>'
    )


def _box(left: float, width: float, top: int, height: int, colour: str, opacity: float) -> str:
    left, width = float(np.clip(left, 0.0, 1.0)), float(np.clip(width, 0.0, 1.0))
    return (
        f'<div style="position:absolute;left:{100 * left:.2f}%;width:{100 * min(width, 1 - left):.2f}%;top:{top}px;'
        f'height:{height}px;background:{colour};opacity:{opacity};border-radius:2px"></div>'
    )
