"""Addresses of results: each opens its tab and what is shown there; a report and a recording are links beside it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import parse_qs, quote, unquote

import viser

from ema_model.errors import InputError
from emaviz.page.panel import LINK
from emaviz.page.style import unseen_field
from emaviz.page.workspaces import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.server.safe_server import RESULTS, Kept
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.session_file import Provenance
from emaviz.text.html import Html, add_html, html, joined

Place = Mapping[str, Sequence[str]]  # what a tab shows, by what an address calls it

_BETWEEN = "|"  # after it stands the time, so that the same address told twice is another text
_LONGEST = 4000  # characters of an address
_TYPES = {".html": "text/html", ".rrd": "application/octet-stream"}
VIEW = ".view"  # stands for a recording that is shown by the Rerun viewer

# On the page: the address follows what is shown, and one that is opened is told; a link to a result is copied.
_SCRIPT = """
(() => {
  window.emavizPlaces?.end();
  const field = FIELD, heard = new AbortController(), on = { capture: true, signal: heard.signal };
  const begun = new URLSearchParams(location.search);
  let asked = [...begun.keys()].some(key => key !== 'view' && key !== 'token') ? begun.toString() : null;
  let told = false;
  const tell = () => {
    const row = document.querySelector(`label[for="${field}"]`)?.closest('.mantine-Flex-root');
    const input = row?.querySelector('input');
    if (!input || !begun.get('view')) return;
    told = true;
    const text = `${asked}BETWEEN${Date.now()}`;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, text);
    input.dispatchEvent(new Event('input', { bubbles: true }));
  };
  const follow = () => {
    if (asked !== null) { if (!told) tell(); return; }
    const now = new URL(location.href), view = now.searchParams.get('view');
    if (!view) return;
    const shown = [...document.querySelectorAll('.emaviz-share')].find(
      line => line.dataset.view === view && line.checkVisibility());
    const wanted = shown ? `view=${view}&${shown.dataset.place}`.replace(/&$/, '') : `view=${view}`;
    if (now.search !== `?${wanted}`) history.replaceState(history.state, '', `${now.pathname}?${wanted}`);
  };
  document.addEventListener('click', async (event) => {
    const link = event.target.closest?.('.emaviz-copy');
    if (!link) return;
    event.preventDefault();
    const plain = link.dataset.text ??= link.textContent;
    try {
      await navigator.clipboard.writeText(link.href);
      link.textContent = 'Link copied';
    } catch {  // no secure page, or not allowed
      prompt('The address of this result', link.href);
    }
    setTimeout(() => { link.textContent = plain; }, 2000);
  }, on);
  const timer = setInterval(follow, 250);
  window.emavizPlaces = { opened: () => { asked = null; }, end: () => { clearInterval(timer); heard.abort(); } };
})();
"""


def share_line(view: str, place: Place, makes: Sequence[str] = ()) -> Html:
    """Links of a result, at the upper edge of its panel; makes: kinds of files, by suffix, that are made of it."""
    query = "&".join(f"{name}={_spelled(one)}" for name, values in place.items() for one in values)
    address = f"/?view={view}{'&' if query else ''}{query}"
    links = [html('<a class="emaviz-copy" href="{}" title="The address of what is shown here">Copy link</a>', address)]
    if ".html" in makes:
        links.append(_link(view, ".html", "Report ↗", "Opens as a page of its own, which needs nothing beside it"))
    if VIEW in makes:
        links.append(_link(view, VIEW, "Rerun ↗", "Opens the recording in the Rerun viewer"))
    if ".rrd" in makes:
        links.append(_link(view, ".rrd", ".rrd ↓", "Saves the recording for the Rerun viewer"))
    return html(
        '<div class="emaviz-share emaviz-all-columns" data-view="{}" data-place="{}">{}</div>',
        view,
        query,
        joined(links),
    )


def _spelled(text: str) -> str:
    """As an address has it, with ~ in place of %: viser's page decodes its address, whatever stands in it."""
    return quote(text, safe="/").replace("~", "%7E").replace("%", "~")


def _read(text: str) -> str:
    return unquote(text.replace("~", "%"))


def _link(view: str, suffix: str, text: str, hint: str) -> Html:
    at = f"{RESULTS}{quote(view)}{suffix}"
    follows = LINK if suffix == VIEW else ""  # which is told the page's theme
    return html('<a class="{}" href="{}" target="_blank" rel="noopener" title="{}">{}</a>', follows, at, hint, text)


class Opens(Protocol):
    """A tab that can be opened at a place."""

    def go_to(self, place: Place) -> None:
        """Shows it; InputError where it is not there."""


class Sharing:
    """Addresses that are opened, and files of results that are asked for as links."""

    def __init__(self, page: Page, viewer: ViewerHost | None) -> None:
        self._page, self._viewer = page, viewer
        self.tabs: Mapping[str, Opens] = {}  # by the workspace's name, once the page is built
        self.results: dict[str, Provenance] = {}  # by the workspace's name
        self.files: Callable[[str], Path | None] = lambda name: None  # others that may be asked for, by their name

    def connect(self) -> None:
        """Begins to follow windows; to be called where an unseen field may stand."""
        server = self._page.server
        field: Any = server.gui.add_text("Address opened", "")
        add_html(server.gui, unseen_field(id_of(field)))

        def told(event: viser.GuiEvent[Any]) -> None:
            query = str(field.value).rpartition(_BETWEEN)[0]
            if event.client is not None and 0 < len(query) <= _LONGEST:
                client = event.client.client_id
                self._page.screen.post(f"address {client}", lambda: self._open(query, client))

        field.on_update(told)
        script = _SCRIPT.replace("FIELD", json.dumps(id_of(field)))
        Inside(server).run(script.replace("BETWEEN", _BETWEEN))

    def _open(self, query: str, client: int) -> None:
        place = {name: [_read(one) for one in values] for name, values in parse_qs(query, max_num_fields=50).items()}
        tab = self.tabs.get(place.pop("view", [""])[0])
        try:
            if tab is not None:
                tab.go_to(place)
        except InputError as error:
            self._page.notify("This address cannot be opened", str(error), "yellow")
        finally:
            Inside(self._page.server).run("window.emavizPlaces?.opened()", client)

    def answer(self, name: str, query: str = "") -> Kept | None:
        """A result's file, by 'compare.html' and the like; None where there is none.  On any thread.

        query: with the theme of the page, in which the Rerun viewer shows it.
        """
        view, _, kind = name.rpartition(".")
        result, suffix = self.results.get(view), f".{kind}"
        if result is None or result.files is None:
            path = self.files(name)
            return None if path is None or path.suffix not in _TYPES else _kept(path)
        wanted = ".rrd" if suffix == VIEW else suffix
        path = result.files.make(wanted) if wanted in _TYPES else None
        if path is None:
            return None
        if suffix == VIEW:
            theme = "dark" if parse_qs(query).get("theme") == ["dark"] else "light"
            return None if self._viewer is None else Kept(at=f"{self._viewer.url_of(path.name)}&theme={theme}")
        return _kept(path)


def _kept(path: Path) -> Kept | None:
    try:
        save = "" if path.suffix == ".html" else path.name
        return Kept(path.read_bytes(), _TYPES[path.suffix], save)
    except OSError:
        return None
