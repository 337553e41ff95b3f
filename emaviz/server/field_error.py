"""An error beside its field: a line below the control, in the page, until the control is changed again."""

from __future__ import annotations

import json
from typing import Any

from emaviz.server.viser_private import Inside, id_of
from emaviz.text.results import begun

_SAY = r"""
((id, text, calm) => {
  const field = document.getElementById(id);
  if (!field) return;
  const button = field.tagName === 'BUTTON';
  const home = button ? field.parentElement : (field.closest('.mantine-Flex-root') ?? field).parentElement;
  let line = home.querySelector(':scope > .emaviz-beside');
  if (!text) { line?.remove(); return; }
  if (!line) {
    line = document.createElement('div');
    line.className = 'emaviz-beside';
    line.setAttribute('role', 'alert');
    line.style.cssText = 'font-size:12px;line-height:1.35;padding:2px 2px 0;overflow-wrap:anywhere';
    home.append(line);
    home.addEventListener(button ? 'click' : 'input', () => line.remove(), { once: true });
  }
  line.style.color = calm ? 'var(--mantine-color-dimmed)' : 'light-dark(#e03131,#ff8787)';
  line.textContent = text;
  if (!calm && document.hasFocus()) line.scrollIntoView({ block: 'nearest' });
})(ID, TEXT, CALM)
"""


def say_beside(inside: Inside, control: Any, text: str, client: int | None = None, *, calm: bool = False) -> None:
    """Says it in one page, or in all that are open; no text takes it away.  calm: it is no error."""
    source = _SAY.replace(
        "(ID, TEXT, CALM)", f"({json.dumps(id_of(control))}, {json.dumps(begun(text))}, {json.dumps(calm)})"
    )
    for one in inside.pages() if client is None else (client,):
        inside.run(source, one)
