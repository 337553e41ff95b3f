"""A click on a flight in its chart: the page knows which point is hovered, and tells it through an unseen field."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import viser

from emaviz.figures.k_over_flights import CLICKED
from emaviz.page.page import Page
from emaviz.page.style import unseen_field
from emaviz.server.viser_private import Inside, id_of
from emaviz.text.html import add_html

_BETWEEN = "|"  # after it stands the time, so that a second click on a flight is another text
_SCRIPT = """
(() => {
  const field = FIELD, chart = CHART;
  if (window.__emavizFlights) document.removeEventListener('click', window.__emavizFlights, true);
  window.__emavizFlights = (event) => {
    const plot = event.target.closest?.('.js-plotly-plot');
    if (plot?.layout?.meta !== chart) return;
    const name = plot._hoverdata?.[0]?.text;
    const row = document.querySelector(`label[for="${field}"]`)?.closest('.mantine-Flex-root');
    const input = row?.querySelector('input');
    if (!name || !input) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, name + 'BETWEEN' + Date.now());
    input.dispatchEvent(new Event('input', { bubbles: true }));
  };
  document.addEventListener('click', window.__emavizFlights, true);
})();
"""


class FlightClicks:
    """clicked(name, window): called with a flight's name and the window in which it was clicked, on the screen."""

    def __init__(self, page: Page, clicked: Callable[[str, viser.ClientHandle | None], None]) -> None:
        gui = page.server.gui
        field: Any = gui.add_text("Flight clicked", "")
        add_html(gui, unseen_field(id_of(field)))

        def told(event: viser.GuiEvent[Any]) -> None:
            name = str(field.value).partition(_BETWEEN)[0]
            if event.client is not None and name:
                page.screen.post("flight clicked", lambda: clicked(name, event.client))

        field.on_update(told)
        script = _SCRIPT.replace("FIELD", json.dumps(id_of(field))).replace("CHART", json.dumps(CLICKED))
        Inside(page.server).run(script.replace("BETWEEN", _BETWEEN))
