"""Short pieces of HTML on the Compare tab: the list of recordings, the mapping's table, the data health card."""

from __future__ import annotations

from collections.abc import Iterable

from ema_model.recordings import SIGNALS, ColumnMapping, MappedColumn
from ema_model.recordings.health.card import Finding, Health
from ema_model.text import COLOURS
from emaviz.session.opened import Opened
from emaviz.text.html import Html, html, joined

_MARKS = {"good": ("✓", COLOURS["good"]), "note": ("●", COLOURS["note"]), "warning": ("▲", COLOURS["warning"])}
_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')
_DIM = Html('style="opacity:.65"')


def recordings_list(opened: Iterable[Opened]) -> Html:
    """A line for each recording: what it is and how its data are."""
    rows = []
    for one in opened:
        if one.measurement is None or one.health is None:
            mark, text = _mark("warning"), "no table is found in it" if one.problem else "columns to be checked"
        else:
            m = one.measurement
            mark = _mark(one.health.severity)
            length = f"{m.samples:,} samples".replace(",", " ")
            text = f"{length}, a static map" if m.is_map else f"{m.duration_s:.3g} s, {length}"
        rows.append(html("<div>{} <b>{}</b> <span {}>{}</span></div>", mark, one.path.name, _DIM, text))
    return html("<div {}>{}</div>", _BOX, joined(rows) or html("<span {}>None yet.</span>", _DIM))


def mapping_table(mapping: ColumnMapping) -> Html:
    """Signal ← column [unit], sign, and how sure the guess is; below it, what is left aside and why."""
    rows = []
    for entry in mapping.entries:
        signal = SIGNALS[entry.signal]
        unit = entry.unit or signal.unit
        sure = f"{100.0 * entry.confidence:.0f} %"
        colour = (
            COLOURS["good"] if entry.confidence >= 0.8 else COLOURS["warning"] if entry.confidence < 0.6 else "inherit"
        )
        rows.append(
            html(
                '<tr title="{}"><td><b>{}</b></td>'
                '<td style="overflow-wrap:anywhere">← {}{}</td>'
                '<td style="white-space:nowrap">{}</td>'
                '<td style="text-align:right;color:{};white-space:nowrap">{}</td></tr>',
                entry.reason,
                signal.title,
                entry.column,
                _done(entry),
                unit or "–",
                colour,
                sure,
            )
        )
    aside = joined(
        html('<div style="overflow-wrap:anywhere"><b>{}</b>: {}</div>', column, why)
        for column, why in mapping.unmapped[:12]
    )
    more = html("<div>… and {} more</div>", len(mapping.unmapped) - 12) if len(mapping.unmapped) > 12 else ""
    left = html('<div style="padding-top:6px"><span {}>Left aside</span>{}{}</div>', _DIM, aside, more) if aside else ""
    table = _table((("signal", "left"), ("column", "left"), ("unit", "left"), ("sure", "right")), rows)
    return html("<div {}>{}{}</div>", _BOX, table, left)


def _done(entry: MappedColumn) -> str:
    """What is done to a column's numbers beside its unit, and to its time."""
    factor = entry.sign * entry.scale
    offset = f" {'+' if entry.offset > 0.0 else '−'} {abs(entry.offset):.6g}" if entry.offset else ""
    delay = f", {abs(1e3 * entry.delay_s):.6g} ms {'late' if entry.delay_s > 0.0 else 'early'}" if entry.delay_s else ""
    return (f" × {factor:.6g}".replace("-", "−") if factor != 1.0 else "") + offset + delay


def health_card(health: Health) -> Html:
    """What to know of the data, warnings first; what was found in order stands folded below."""
    lines = {severity: [_finding(f) for f in health.findings if f.severity == severity] for severity in _MARKS}
    told = joined(lines["warning"] + lines["note"])
    good = lines["good"]
    if not good:
        return html("<div {}>{}</div>", _BOX, told)
    summary = html("{} {} {} in order", _mark("good"), len(good), "others are" if told else "checks are")
    folded = html('<details><summary style="cursor:pointer">{}</summary>{}</details>', summary, joined(good))
    return html("<div {}>{}{}</div>", _BOX, told, folded)


def _finding(finding: Finding) -> Html:
    return html(
        '<div style="display:flex;gap:6px;padding:1px 0"><span style="flex:none;width:14px">'
        "{}</span><span>{}</span></div>",
        _mark(finding.severity),
        finding.sentence,
    )


def _table(heads: Iterable[tuple[str, str]], rows: Iterable[str]) -> Html:
    """Heads are (text, side); rows are ready."""
    head = joined(
        html('<th style="text-align:{};font-weight:400;opacity:.65">{}</th>', side, text) for text, side in heads
    )
    style = "width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums"
    return html('<table style="{}"><tr>{}</tr>{}</table>', style, head, joined(rows))


def _mark(severity: str) -> Html:
    sign, colour = _MARKS[severity]
    return html('<span style="color:{}" title="{}">{}</span>', colour, severity, sign)
