"""How a window is laid out: the panels on the right, and the actuator as an inset."""

from __future__ import annotations

import threading

import viser

from emaviz.server.viser_private import Inside
from emaviz.text.html import Html, unescaped

# --- the panels on the right, of which each window sees one; what they and the left one leave is the actuator's -------

LEFT_PX = 380
_USUAL_WINDOW_PX = 1400
_NARROWEST_PX, _WIDEST_PX = 340, 1000
TWO_COLUMNS_PX = 1240  # from which width on what stands in two columns does
NARROW_PX = 577  # from which width on viser has panels: narrower, all of it is one sheet, and they come back anew
# Widths by which windows are told apart: what is docked is laid out for the widest that is no wider than the window.
WINDOWS_PX = (0, NARROW_PX, 900, 1000, 1100, 1200, TWO_COLUMNS_PX, *range(1300, 2000, 100), 2100, 2300, 2600)
_SHOWN_S = 0.15


class Docked:
    """Panels that give way to each other, in each window for itself."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server, self._inside = server, Inside(server)
        self._panels: dict[str, tuple[viser.PanelHandle, float]] = {}  # by name, each with its share
        self._first = ""  # what a window sees at first
        self._seen: dict[int, str] = {}  # by window, where it is another one
        self._window_px: dict[int, int] = {}  # of `WINDOWS_PX`, by window, where it is not the usual

        @server.on_client_disconnect
        def _(client: viser.ClientHandle) -> None:
            self._window_px.pop(client.client_id, None)
            self._seen.pop(client.client_id, None)

    def add(self, name: str, share: float, *, in_front: bool = False) -> viser.PanelHandle:
        """A panel that takes this share of what the left one leaves of a window; in_front: windows begin with it.

        To be `dock`ed once it is built.
        """
        panel = self._server.gui.add_panel(visible=in_front)
        self._panels[name] = panel, share
        if in_front:
            self._first = name
        return panel

    def dock(self) -> None:
        """Puts all of them to the right, where later changes leave them."""
        for panel, share in self._panels.values():
            panel.dock_right()
            panel.set_width(_width_px(_USUAL_WINDOW_PX, share))

    def show(self, client: int, name: str) -> None:
        """The panel that this window sees from now on; the others give way there."""
        before = self._seen.get(client, self._first)
        if before == name:
            return
        self._seen[client] = name
        self._inside.show_panel(client, self._panels[before][0], False)
        self._inside.show_panel(client, self._panels[name][0], True)
        # a panel that was hidden comes back narrow, and takes a width once it is there
        timer = threading.Timer(_SHOWN_S, self._set_width, (client,))
        timer.daemon = True
        timer.start()

    def fit(self, client: int, window_px: int) -> None:
        """Lays one window out for its width, one of `WINDOWS_PX`."""
        before = self._window_px.get(client, _USUAL_WINDOW_PX)
        if before != window_px:
            self._window_px[client] = window_px
            self._set_width(client)
            if before < NARROW_PX:
                self._inside.set_width(client, self._server.gui.main_panel, LEFT_PX)

    def _set_width(self, client: int) -> None:
        panel, share = self._panels[self._seen.get(client, self._first)]
        self._inside.set_width(client, panel, _width_px(self._window_px.get(client, _USUAL_WINDOW_PX), share))


def _width_px(window_px: int, share: float) -> int:
    """Of a panel."""
    return round(min(max(share * (window_px - LEFT_PX), _NARROWEST_PX), _WIDEST_PX))


# --- the actuator as a framed inset below the controls, so that results have the page's width; a click lets it --------
# The actuator as a framed inset below the controls, so that results have the page's width; a click lets it grow
# Each window lays itself out: a script there follows its workspace, and everything else is a style sheet.  It leans on
# names in viser's own page; where one has changed, the actuator stands between the panels as it does once it has grown.

COLUMNS = Html('<div class="emaviz-columns"></div>')  # stands in a tab whose parts take two columns where there is room
NEXT_COLUMN = Html('<div class="emaviz-next-column"></div>')  # stands in the folder that begins the second one
ALL_COLUMNS = Html('<div class="emaviz-all-columns"></div>')  # stands in a folder that is as wide as both
# Stands before what gives way to the second column where there is one only.
PLOTS_EARLY = Html('<div class="emaviz-early"></div>')
ROOM = Html('<div class="emaviz-room"></div>')  # stands in a folder that only a large window has room for
_ROOM_PX = 1700, 940  # of such a window, width and height
LEAST_WIDTH_PX = 900  # of a window whose actuator is an inset; figures are as high as in it where it is narrower
_STRIP_PX = 76  # of the playback below
_FOLDED_PX = 38  # high, of an inset that is folded away but for its buttons
_CLICK_PX = 4  # a pointer that moves further turns the actuator

_SCRIPT = """
(() => {
  window.emavizInset?.end();
  let asked = false, low = false, grown = false, folded = false, down = null;
  const root = document.documentElement, body = document.body, button = document.createElement('button');
  const fold = document.createElement('button');
  button.className = fold.className = 'emaviz-grow';
  body.append(button, fold);
  const picture = () => document.querySelector('[data-dock-root] > div:has(> canvas)');
  const dress = () => {
    const at = picture(), left = document.querySelector('[data-dock-region=left]');
    const both = ['left', 'right'].every(side => document.querySelector(`[data-dock-region-resize=${side}]`));
    const can = asked && at && left && both && innerWidth >= LEAST, inset = can && !grown;
    if (left) root.style.setProperty('--emaviz-left', `${left.getBoundingClientRect().width}px`);
    body.classList.toggle('emaviz-inset', inset);
    body.classList.toggle('emaviz-low-inset', inset && low);
    const told = document.querySelector('.mantine-Notification-root');  // which stands on the picture
    body.classList.toggle('emaviz-folded-inset', inset && folded && !told);
    button.style.display = can ? 'block' : 'none';
    fold.style.display = inset ? 'block' : 'none';
    if (at) {  // what is told stands on the picture, beside the button
      const box = at.getBoundingClientRect(), above = inset ? 6 : 52;
      const note = { left: box.left + 6, top: box.top + above, width: Math.min(box.width - (inset ? 80 : 12), 440),
                     height: (inset ? box.height : Math.min(box.height, innerHeight - STRIP)) - above - 6 };
      for (const [side, px] of Object.entries(note)) root.style.setProperty(`--emaviz-note-${side}`, `${px}px`);
    }
    if (!can) return;
    const box = at.getBoundingClientRect();
    button.style.left = `${box.right - 34}px`;
    button.style.top = `${box.top + (inset ? 6 : 22)}px`;
    button.textContent = inset ? '⤢' : '⤡';
    button.title = inset ? 'Larger actuator' : 'Smaller actuator';
    button.setAttribute('aria-label', button.title);
    fold.style.left = `${box.right - 64}px`;
    fold.style.top = button.style.top;
    fold.textContent = folded ? '▴' : '▾';
    fold.title = folded ? 'Show the actuator' : 'Fold the actuator away';
    fold.setAttribute('aria-label', fold.title);
  };
  const grow = (to) => { grown = to; dress(); };
  const pressed = (event) => {
    down = body.classList.contains('emaviz-inset') && picture()?.contains(event.target) ? event : null;
  };
  const released = (event) => {
    if (down && Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) < CLICK) grow(true);
    down = null;
  };
  button.addEventListener('click', () => grow(!grown));
  fold.addEventListener('click', () => { folded = !folded; dress(); });
  document.addEventListener('pointerdown', pressed, true);
  document.addEventListener('pointerup', released, true);
  const timer = setInterval(dress, 100);
  window.emavizInset = {
    enter: (inset, lower) => { asked = inset; low = lower; grown = false; dress(); },
    end: () => {
      clearInterval(timer);
      button.remove();
      fold.remove();
      document.removeEventListener('pointerdown', pressed, true);
      document.removeEventListener('pointerup', released, true);
    },
  };
})();
"""


def script() -> str:
    """To run in every page: `window.emavizInset.enter(inset, lower)` lays it out for a workspace."""
    return (
        _SCRIPT.replace("LEAST", str(LEAST_WIDTH_PX)).replace("CLICK", str(_CLICK_PX)).replace("STRIP", str(_STRIP_PX))
    )


def style() -> Html:
    """The inset at the lower left, the controls above it, the results to the right of both."""
    inset, right = "body.emaviz-inset", "body.emaviz-inset [data-dock-region=right]"
    any_columns = "div:has(> div > .emaviz-columns)"
    columns, room = f"{right} {any_columns}", "> div:has(.emaviz-room)"
    wide, high = _ROOM_PX
    return unescaped(
        "<style>"
        ":root{--emaviz-inset:clamp(150px,calc(46vh - 138px),330px)}"
        "body.emaviz-low-inset{--emaviz-inset:clamp(130px,calc(46vh - 138px),180px)}"
        f"body.emaviz-folded-inset{{--emaviz-inset:{_FOLDED_PX}px}}"
        f"{inset} [data-dock-root] > div:has(> canvas){{inset:auto auto 8px 8px!important;"
        "width:calc(var(--emaviz-left) - 16px)!important;height:var(--emaviz-inset)!important;z-index:6;"
        "border:1px solid rgba(134,142,150,.55);border-radius:6px;overflow:hidden;cursor:pointer}"
        f"{inset} [data-dock-region=left]{{bottom:calc(var(--emaviz-inset) + 16px)!important}}"
        f"{right}{{width:calc(100% - var(--emaviz-left))!important}}"
        f"{right} > div:not([data-dock-region-handle]):not([data-dock-region-resize]) > div{{width:100%!important}}"
        f"{right} [data-dock-region-resize]{{display:none!important}}"
        # what is told, where it covers no control and no result
        ".mantine-Notifications-root{left:var(--emaviz-note-left,10px)!important;right:auto!important;"
        "top:var(--emaviz-note-top,80px)!important;bottom:auto!important;width:var(--emaviz-note-width,300px)!important;"
        "max-height:var(--emaviz-note-height,50vh);overflow-y:auto}"
        # a control's hint stands beside the panel, on the control's height: it covers no other control
        "body:has([data-dock-region=left]:hover) .mantine-Tooltip-tooltip[style*='15rem']"
        "{left:calc(var(--emaviz-left,400px) + 8px)!important}"
        ".emaviz-grow{position:fixed;z-index:7;width:26px;height:26px;padding:0;border-radius:4px;cursor:pointer;"
        "font-size:15px;line-height:24px;border:1px solid rgba(134,142,150,.55);"
        "background:var(--mantine-color-body);color:var(--mantine-color-text)}"
        f"@media (min-width:{TWO_COLUMNS_PX}px){{{columns}{{columns:2;column-gap:6px;padding-top:12px}}"
        f"{columns} > div{{break-inside:avoid}}"
        f"{columns} > div:has(.emaviz-next-column){{break-before:column}}"
        f"{columns} > div:has(.emaviz-all-columns){{column-span:all}}}}"
        f"{any_columns} {room}{{display:none}}"
        f"@media (min-width:{wide}px) and (min-height:{high}px){{{columns} {room}{{display:block}}}}"
        f"@media (max-width:{TWO_COLUMNS_PX - 1}px){{{columns}:has(> div > .emaviz-early)"
        "{display:flex;flex-direction:column}"
        f"{columns} > div:has(> .emaviz-early) ~ div{{order:2}}"
        f"{columns} > div:has(> .emaviz-early) ~ div:has(.emaviz-next-column){{order:1}}}}"
        "</style>"
    )
