"""The model's equations as HTML, the terms of added effects set off from the base model's."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ema_model.discovery import Discovery
from ema_model.discovery.result import Added
from ema_model.discovery.shown.fault_pages import page_of
from ema_model.discovery.shown.labels import effect_title, settings
from ema_model.discovery.words import faults
from ema_model.effects import Effect, find
from ema_model.effects.effect import STAGES
from ema_model.faults import cause_of, causes
from emaviz.text.html import Html, html, joined
from emaviz.text.mathml import mathml

# Where an effect acts, the equation of the base model that it stands in, in the order of the page.
_LINES = {
    "motion": "J dω/dt = k_t i − T_f(ω) − τ T_load",
    "current": "L di/dt = v − R i − k_e ω",
    "friction": "T_f = T_s at rest, T_d sgn ω in motion",
    "output": "θ_user = τ θ, with play",
    "sensors": "read: θ_user, θ, ω, i",
    "drive": "I_ref = sat(K_P (ω_ref − ω) + K_I ∫(ω_ref − ω) dt), ω_ref = sat(G (θ_cmd − θ_user))",
}
_OF_PLACE = {
    "moving_friction": "friction",
    "friction": "friction",
    "electric_torque": "motion",
    "shaft_torque": "motion",
    "inverse_inertia": "motion",
    "back_emf": "current",
    "winding_resistance": "current",
    "bus_voltage": "current",
    "user_position": "output",
    "position_reading": "sensors",
    "current_reading": "sensors",
    "motor_angle_reading": "sensors",
    "motor_speed_reading": "sensors",
    **dict.fromkeys(STAGES, "drive"),
}


def equation(found: Discovery, added: Sequence[Added]) -> Html:
    """The lines that added effects and faults change, each with its terms and fitted values; "" without any."""
    by_line: dict[str, list[Html]] = {}
    for one in added:
        effect = find(one.key)
        values = joined(
            (html("{} = {}", _symbol(effect, name), text) for name, text in settings(found, one).items()), ", "
        )
        if len(effect.parameters) > 6:
            values = html("{} knots, fitted", len(effect.parameters))
        by_line.setdefault(_line(effect), []).append(_term(effect_title(one.name), effect.equation, values))
    told = faults(found)
    for fault in causes(found.faults):
        page = page_of(fault)
        term = _term(effect_title(fault), page.equation, html("{}", ", ".join(told[name] for name in cause_of(fault))))
        by_line.setdefault(page.line, []).append(term)
    rows = []
    for line, base in _LINES.items():
        if line in by_line or line == "motion":
            extra = joined(by_line.get(line, []))
            more = html(' <span style="opacity:.65">and</span>') if extra else ""
            shown = mathml(base, "inline")
            rows.append(html('<div style="font-size:15px">{}{}</div>{}', shown, more, extra))
    return joined(rows if by_line else [])


def _term(title: str, equation: str, values: Html) -> Html:
    return html(
        '<div style="margin:2px 0 4px 6px;padding-left:8px;border-left:3px solid rgba(134,142,150,.55)">'
        "<b>{}:</b> "
        '<span style="font-size:15px">{}</span>'
        '<div style="font-size:12px;opacity:.85">{}</div></div>',
        title,
        mathml(equation, "inline"),
        values,
    )


def _line(effect: Effect) -> str:
    return next((_OF_PLACE[place.__name__] for place in effect.places if place.__name__ in _OF_PLACE), "motion")


def _symbol(effect: Effect, name: str) -> str | Html:
    """'A', typeset, where the parameter's meaning names a symbol of the equation; else its own name."""
    meaning = next((p.meaning for p in effect.parameters if p.name == name), "")
    symbols = set(re.split(r"[^\w]+", effect.equation))
    symbol = next((word for word in re.split(r"[^\w]+", meaning)[1:] if word and word in symbols), "")
    return mathml(symbol, "inline") if symbol else name.rpartition("_")[0].replace("_", " ") or name
