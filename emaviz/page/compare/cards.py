"""Short pieces of HTML on the Compare tab: the list of recordings, the mapping's table, the data health card."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from ema_model.quantities.numbers import number
from ema_model.recordings import SIGNALS, ColumnMapping
from ema_model.recordings.health.card import Finding, Health
from emaviz.figures.calibration_scores import Score
from emaviz.session.opened import Opened

_MARKS = {"good": ("✓", "#2b8a3e"), "note": ("●", "#1c7ed6"), "warning": ("▲", "#e8590c")}
_BOX = 'style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"'
_DIM = 'style="opacity:.65"'


def recordings_list(opened: Iterable[Opened]) -> str:
    """A line for each recording: what it is and how its data are."""
    rows = []
    for one in opened:
        if one.measurement is None or one.health is None:
            mark, text = _mark("warning"), "columns to be checked"
        else:
            m = one.measurement
            mark = _mark(one.health.severity)
            length = f"{m.samples:,} samples".replace(",", " ")
            text = f"{length}, a static map" if m.is_map else f"{m.duration_s:.3g} s, {length}"
        rows.append(f"<div>{mark} <b>{html.escape(one.path.name)}</b> <span {_DIM}>{text}</span></div>")
    return f"<div {_BOX}>{''.join(rows) or f'<span {_DIM}>None yet.</span>'}</div>"


def mapping_table(mapping: ColumnMapping) -> str:
    """Signal ← column [unit], sign, and how sure the guess is; below it, what is left aside and why."""
    rows = []
    for entry in mapping.entries:
        signal = SIGNALS[entry.signal]
        unit = entry.unit or signal.unit
        sure = f"{100.0 * entry.confidence:.0f} %"
        colour = "#2b8a3e" if entry.confidence >= 0.8 else "#e8590c" if entry.confidence < 0.6 else "inherit"
        sign = " × −1" if entry.sign < 0 else ""
        rows.append(
            f'<tr title="{html.escape(entry.reason, quote=True)}"><td><b>{html.escape(signal.title)}</b></td>'
            f'<td style="overflow-wrap:anywhere">← {html.escape(entry.column)}{sign}</td>'
            f'<td style="white-space:nowrap">{html.escape(unit) or "–"}</td>'
            f'<td style="text-align:right;color:{colour};white-space:nowrap">{sure}</td></tr>'
        )
    aside = "".join(
        f'<div style="overflow-wrap:anywhere"><b>{html.escape(column)}</b>: {html.escape(why)}</div>'
        for column, why in mapping.unmapped[:12]
    )
    more = f"<div>… and {len(mapping.unmapped) - 12} more</div>" if len(mapping.unmapped) > 12 else ""
    left = f'<div style="padding-top:6px"><span {_DIM}>Left aside</span>{aside}{more}</div>' if aside else ""
    table = _table((("signal", "left"), ("column", "left"), ("unit", "left"), ("sure", "right")), rows)
    return f"<div {_BOX}>{table}{left}</div>"


def health_card(health: Health) -> str:
    """What to know of the data, warnings first; what was found in order stands folded below."""
    lines = {severity: [_finding(f) for f in health.findings if f.severity == severity] for severity in _MARKS}
    told = "".join(lines["warning"] + lines["note"])
    good = lines["good"]
    if not good:
        return f"<div {_BOX}>{told}</div>"
    summary = f"{_mark('good')} {len(good)} {'others are' if told else 'checks are'} in order"
    folded = f'<details><summary style="cursor:pointer">{summary}</summary>{"".join(good)}</details>'
    return f"<div {_BOX}>{told}{folded}</div>"


def _finding(finding: Finding) -> str:
    return (
        f'<div style="display:flex;gap:6px;padding:1px 0"><span style="flex:none;width:14px">'
        f"{_mark(finding.severity)}</span><span>{html.escape(finding.sentence)}</span></div>"
    )


def calibration_table(scores: Sequence[Score]) -> str:
    """What each parameter was found to be, its 90 % interval, and how many σ that is from the file."""
    if not scores:
        return ""
    rows = []
    for score in scores:
        colour = "#e03131" if score.at_bound else "inherit"
        moved = f"{round(score.z, 2) + 0.0:+.2f} σ{' at its bound' if score.at_bound else ''}"
        moved = moved.replace("-", "−")
        interval = f"{number(score.low)} … {number(score.high)}"
        rows.append(
            f"<tr><td>{html.escape(score.title)}</td>"
            f'<td style="text-align:right;white-space:nowrap">{number(score.value, 4)}</td>'
            f'<td style="text-align:right;white-space:nowrap;padding-left:8px">{interval}</td>'
            f'<td style="padding-left:6px">{html.escape(score.unit)}</td>'
            f'<td style="text-align:right;white-space:nowrap;color:{colour}">{moved}</td></tr>'
        )
    heads = ("parameter", "left"), ("value", "right"), ("90 % interval", "right"), ("", "left"), ("from file", "right")
    return f"<div {_BOX}>{_table(heads, rows)}</div>"


def _table(heads: Iterable[tuple[str, str]], rows: Iterable[str]) -> str:
    """Heads are (text, side); rows are ready."""
    head = "".join(f'<th style="text-align:{side};font-weight:400;opacity:.65">{text}</th>' for text, side in heads)
    style = "width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums"
    return f'<table style="{style}"><tr>{head}</tr>{"".join(rows)}</table>'


def _mark(severity: str) -> str:
    sign, colour = _MARKS[severity]
    return f'<span style="color:{colour}" title="{severity}">{sign}</span>'
