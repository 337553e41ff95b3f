"""The library of effects as a small static reference: an index and a page an effect, without script or network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ema_model.actuator import load_actuator
from ema_model.effects import CATALOGUE, Effect
from ema_model.effects.effect import FAMILIES
from ema_model.effects.user.torque import KEYS, TITLES
from ema_model.errors import InputError, quoted
from ema_model.files.written import whole_file
from ema_model.quantities import VARIABLES, Axes
from ema_model.simulation.run import EffectRuns
from emaviz.figures.discovery import effect_residual_legend, pictures
from emaviz.text.html import mathml
from emaviz.views.report import escape, paragraph, table

_STYLE = (
    ":root{color-scheme:light dark}"
    "body{font:16px/1.5 system-ui,sans-serif;max-width:52rem;margin:2rem auto;padding:0 1rem}"
    "table{border-collapse:collapse}td,th{padding:2px 14px 2px 0;text-align:left;vertical-align:top}"
    "math{font-size:1.25em;margin:1rem 0}h2{font-size:1.05em;margin-top:1.4em}"
    ".pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));"
    "gap:1rem;margin:.5rem 0 1.2rem}"
    ".pictures svg{max-width:30rem}"
    ".legend{display:flex;flex-wrap:wrap;gap:0 1.2em;font-size:.9em}"
)
_LINEAR = Axes("linear", "linear")


def write_effects_reference(folder: str | Path) -> list[Path]:
    """Writes index.html and a page for each effect and each kind of user's effect; InputError where it cannot."""
    target = Path(folder)
    if target.exists() and not target.is_dir():
        raise InputError(f"--html {quoted(target)}: is a file; name a folder")
    runs = EffectRuns(load_actuator())
    pages = {"index": _index()}
    pages |= {name: _page(effect.title, _effect(effect, runs)) for name, effect in CATALOGUE.items()}
    pages |= {name: _page(TITLES[name], _users(name)) for name in KEYS}
    written = []
    try:
        target.mkdir(parents=True, exist_ok=True)
        for name, text in pages.items():
            written.append(target / f"{name}.html")
            with whole_file(written[-1]) as draft:
                draft.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise InputError(f"--html {quoted(target)}: cannot be written ({error.strerror}); check the folder") from None
    return written


def _page(title: str, body: str) -> str:
    back = '<p><a href="index.html">All effects</a></p>' if title != "Effects" else ""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)} – emaviz</title><style>{_STYLE}</style></head>\n"
        f"<body>{back}<h1>{escape(title)}</h1>\n{body}\n</body></html>\n"
    )


def _index() -> str:
    parts = []
    for family, of_what in FAMILIES.items():
        members = [effect for effect in CATALOGUE.values() if effect.family == family]
        parts.append(f"<h2>Of {escape(of_what)}</h2>{_links([(e.name, e.title, e.shows) for e in members])}")
    parts.append(f"<h2>Your own</h2>{_links([(name, TITLES[name], '') for name in KEYS])}")
    return _page("Effects", "".join(parts))


def _links(members: Sequence[tuple[str, str, str]]) -> str:
    rows = (
        f'<tr><td><a href="{escape(name)}.html">{escape(title)}</a></td><td>{escape(shows)}</td></tr>'
        for name, title, shows in members
    )
    return f"<table>{''.join(rows)}</table>"


def _effect(effect: Effect, runs: EffectRuns) -> str:
    rows = []
    for one in effect.parameters:
        there = one.on(_LINEAR).shown
        rows.append(
            [one.name, one.meaning, f"{one.low:g} … {one.high:g}", f"{one.default:g}", there * (there != one.name)]
        )
    heads = ["Parameter", "means", "range", "default", "on a linear axis"]
    facts = [["Shows", effect.shows], ["Mistaken for", effect.mistaken_for], ["Source", effect.source]]
    if effect.against != "time":
        facts.insert(1, ["Follows", f"the {VARIABLES[effect.against].noun}"])
    if effect.duplicates:
        facts.append(["Duplicates", f"{effect.duplicates}, which a calibration moves"])
    usual = ", ".join(f"{value:g}" for value in effect.severities)
    facts.append(["Slight, clear, strong", f"{effect.parameters[0].name} = {usual}"])
    return (
        f"{mathml(effect.equation)}{paragraph(effect.explanation)}{_picture(effect, runs)}"
        f"{table(heads, rows, text_columns=5)}{table(['', ''], facts, text_columns=2)}"
    )


def _picture(effect: Effect, runs: EffectRuns) -> str:
    """How it looks in the residual, in the run that shows it most; nothing where the actuator does not stand it."""
    felt = runs.severities(effect)
    if not felt:
        return ""
    lead = paragraph(f"In a {felt[0].run}, with the effect minus without:")
    drawn = effect_residual_legend(effect) + pictures(effect, felt)
    return f"<h2>How it looks in the residual</h2>{lead}{drawn}"


def _users(name: str) -> str:
    rows = [[key, meaning] for key, meaning in KEYS[name].items()]
    told = paragraph(f"In an actuator file, the table [effects.{name}]:")
    return told + table(["Key", "means"], rows, text_columns=2)
