"""A whole page: styles, sections, figures and the script that draws them, in one file that asks no network."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from datetime import datetime
from importlib import resources
from pathlib import Path

from plotly.offline import get_plotlyjs

from ema_model.errors import InputError, quoted
from ema_model.files.whole_file import whole_file
from emaviz import __version__
from emaviz.figures.theme import DARK, LIGHT
from emaviz.report.markup import escape
from emaviz.report.section import Figures, Section, Subject


def page(title: str, lead: str, sections: Sequence[Section[Subject]], subject: Subject) -> str:
    """The HTML of a report; lead: plain text below the title."""
    figures = Figures()
    written = [(section, section.body(subject, figures)) for section in sections]
    written = [(section, body) for section, body in written if body]
    contents = "".join(f'<a href="#{escape(s.anchor)}">{escape(s.title)}</a>' for s, _ in written)
    parts = "".join(
        f'<section id="{escape(s.anchor)}"><h2>{escape(s.title)}</h2>{body}</section>' for s, body in written
    )
    style, script = _own("page.css"), _own("page.js")
    plotly = get_plotlyjs()
    now = datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(plotly, script)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(title)} – emaviz</title>\n<style>{style}</style>\n</head>\n<body>\n<main>\n"
        f'<header><h1>{escape(title)}</h1><p class="lead">{escape(lead)}</p></header>\n'
        f"<nav>{contents}</nav>\n{parts}\n"
        f"<footer>Written by emaviz {escape(__version__)}, {escape(now)}.</footer>\n</main>\n"
        f'<script type="application/json" id="figures">{_figures(figures)}</script>\n'
        f"<script>{plotly}</script>\n<script>{script}</script>\n</body>\n</html>\n"
    )


def write(path: str | Path, text: str) -> None:
    """Writes a page, whole or not at all; InputError in one line where that cannot be done."""
    target = Path(path)
    try:
        if target.is_dir():
            raise InputError(f"{quoted(target)}: is a folder; name a file in it")
        if not target.parent.is_dir():
            raise InputError(f"{quoted(target)}: the folder {quoted(target.parent)} does not exist; make it first")
        with whole_file(target) as draft:
            draft.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        why = error.strerror or type(error).__name__
        raise InputError(f"{quoted(target)}: the report cannot be written: {why}; write it elsewhere") from None


def _figures(figures: Figures) -> str:
    """Figures and templates as JSON that cannot end the element it stands in."""
    drawn = ",".join(json.dumps(_without_template(json.loads(str(f.to_json())))) for f in figures.placed)
    themes = json.dumps({"light": LIGHT.template().to_plotly_json(), "dark": DARK.template().to_plotly_json()})
    text = f'{{"themes":{themes},"figures":[{drawn}]}}'
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _without_template(figure: dict) -> dict:
    """The page gives each figure the template of light or dark."""
    figure["layout"].pop("template", None)
    return figure


def _policy(*scripts: str) -> str:
    """Nothing may be fetched, and no script may run but these."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" for script in scripts
    )
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'"


def _own(name: str) -> str:
    return resources.files("emaviz.report").joinpath(name).read_text(encoding="utf-8")
