"""Style sheets that viser has no setting for: the playback strip below the page, the play-head, dark figures.

They lean on names in viser's own page.  Where a name has changed, playback is an ordinary floating panel and the
play-head stays away; nothing else depends on them.
"""

from __future__ import annotations

from collections.abc import Sequence

from emaviz.colours import HELD_OUT, LIMIT, rgb
from emaviz.figures.theme import DARK, LIGHT
from emaviz.page import charts, window_layout
from emaviz.text.html import Html, html, unescaped

JOBS = Html('<div class="emaviz-jobs"></div>')  # stands in the panel that becomes the job bar
STRIP = Html('<div class="emaviz-strip"></div>')  # stands in the panel that becomes the strip
TIME_CHARTS = Html('<div class="emaviz-time"></div>')  # stands beside charts over time
LONG_LABELS = Html('<div class="emaviz-long"></div>')  # stands beside controls with long labels
IN_PAIRS = Html('<div class="emaviz-pairs"></div>')  # stands before short controls, two of which share a line
IN_ROW = Html('<div class="emaviz-row"></div>')  # stands before buttons that share a line
# stands before the upload button that takes dropped files, which is not to be seen
WIDE_MODAL = Html("<style>.mantine-Modal-root{--modal-size:min(960px,92vw)!important}</style>")
STRIP_HEIGHT_PX = 68
_JOBS_HEIGHT_PX = 25  # of the strip, whose small print gives way
_HELD_OUT_ON_DARK, _LIMIT_ON_DARK = "#d17ee3", "#f06595"  # of numbers and notes, which are thin
_ROW_PX = 48
_BUTTON_PX = 90  # that a button in a row needs at least
_LABEL = "> div > .mantine-Flex-root > div:first-child"


def page() -> Html:
    """What holds for the whole page."""
    rules = unescaped(
        "<style>"
        # all tabs of the main panel in one line
        "[data-dock-region=left] [data-dock-tab]{padding-left:2px!important;padding-right:2px!important;"
        "font-size:11px!important}[data-dock-region=left] [data-dock-tab] *{font-size:inherit!important}"
        "[data-dock-region=left] [data-dock-tab] > div:has(svg){display:none!important}"
        # a panel scrolls up and down alone: what stands in it is as wide as it
        "[data-dock-region=left] .mantine-ScrollArea-content{display:block!important;min-width:0!important;"
        "max-width:100%}[data-dock-region=left] .js-plotly-plot{max-width:100%}"
        # a figure takes the panel's width, and does not widen it to what it was drawn with
        "[data-dock-region=left] div:has(> .js-plotly-plot){contain:inline-size}"
        # tabs stay in sight where what is below them scrolls
        ".mantine-ScrollArea-content [data-dock-area],[data-dock-region=left] .mantine-ScrollArea-content "
        "div:has(> div > div > div > [data-dock-area]){overflow:clip!important}"
        ".mantine-ScrollArea-content [data-dock-strip]{position:sticky!important;top:0;z-index:4;"
        "background:var(--mantine-color-body)}"
        # of which the upper edge of one within a result overlaps the control above it
        "[data-dock-region=right] .mantine-ScrollArea-content [data-dock-strip]{top:-6px;"
        "background:linear-gradient(transparent 6px,var(--mantine-color-body) 6px)}"
        # a slider's number in full: viser's box has room for five characters
        ".mantine-Slider-root ~ .mantine-NumberInput-root,"
        "div:has(> .mantine-Slider-root) + .mantine-NumberInput-root,"
        "div:has(> div .mantine-Slider-root) > .mantine-NumberInput-root{width:3.9rem!important}"
        # five tabs of a narrow panel on the right in one line, too
        "[data-dock-region=right] [data-dock-tab]{padding-left:9px!important;padding-right:9px!important;"
        "max-width:none!important}"
        "@media (max-width: 1250px){[data-dock-region=right] [data-dock-tab] > div:has(svg){display:none!important}}"
        # what is chosen from a list ends before the list's mark
        "input[aria-haspopup=listbox]{text-overflow:ellipsis!important;padding-right:1.7em!important}"
        # handles for docking panels elsewhere, which nobody needs; what folds a panel away stays
        "[data-dock-region-handle]{cursor:default!important}[data-dock-region-handle] > div:first-child,"
        "[data-dock-region] [data-dock-griphandle]{display:none!important}"
        # what stands last in a panel ends above its edge
        "[data-dock-region=right] .mantine-ScrollArea-viewport{padding-bottom:14px}"
        f"div:has(> div > .emaviz-long) {_LABEL}{{width:11.6em!important}}"
        "div:has(> div > .emaviz-pairs){display:grid;grid-template-columns:1fr 1fr}"
        "div:has(> .emaviz-pairs){display:none!important}"
        "div:has(> div > .emaviz-row){display:flex;flex-wrap:wrap;padding:0 6px}"
        "div:has(> .emaviz-row){display:none!important}div:has(> div > .emaviz-row) > div:not(:has(button))"
        "{flex:0 0 100%;order:1}div:has(> div > .emaviz-row) > div:has(button)"
        f"{{flex:1 1 {_BUTTON_PX}px;margin-inline:3px!important;container-type:inline-size}}"
        "div:has(> div > .emaviz-row) button{padding:0 4px;font-size:12.5px}"
        "@container (max-width:149px){div:has(> div > .emaviz-row) .mantine-Button-section{display:none}}"
        f"div:has(> div > .emaviz-pairs) {_LABEL}{{width:5.6em!important}}"
        f"div:has(> div > .emaviz-pairs) > div:has(input[type=checkbox]) > .mantine-Flex-root > div:first-child"
        "{width:8.4em!important}"
        # a term that the pointer explains
        "abbr[title]{text-decoration:underline dotted rgba(134,142,150,.9);text-underline-offset:2px;cursor:help}"
        # where a result will stand, while it is computed
        ".emaviz-waits{height:96px;border-radius:6px;margin:0 10px 7px;background:linear-gradient(90deg,"
        "rgba(134,142,150,.1),rgba(134,142,150,.28),rgba(134,142,150,.1));background-size:200% 100%;"
        "animation:emaviz-waits 1.4s linear infinite}@keyframes emaviz-waits{to{background-position:-200% 0}}"
        # a result's links, in the line of the tabs above it
        ".emaviz-share{display:flex;gap:16px;justify-content:flex-end;padding:2px 12px;font-size:12.5px;"
        "line-height:20px}.emaviz-report{padding:6px 12px 0;font-size:14px}"
        ".emaviz-share a{color:inherit;text-underline-offset:2px}"
        "@media (min-width:900px){[data-dock-region=right] .emaviz-share{position:fixed;top:20px;right:34px;z-index:5}}"
        # Rerun's viewer, in the panel or over the whole window
        ".emaviz-viewer > div{padding:0 10px 4px;font-size:12px;overflow-wrap:anywhere}.emaviz-viewer button{"
        "font:inherit;color:inherit;background:none;border:0;padding:0;text-decoration:underline;cursor:pointer}"
        ".emaviz-viewer iframe{width:100%;height:calc(100vh - 205px);border:0}.emaviz-whole{position:fixed;inset:0;"
        "z-index:300;background:var(--mantine-color-body)}.emaviz-whole > div{padding:5px 10px!important}"
        ".emaviz-whole iframe{height:calc(100vh - 30px)}.emaviz-viewer:not(.emaviz-whole) button span:last-child,"
        ".emaviz-whole button span:first-child{display:none}"
        "</style>"
    )
    return rules + _strip() + _jobs() + window_layout.style() + charts.chart_style() + charts.measure_style()


def _strip() -> Html:
    """Lays the panel that holds `STRIP` along the bottom of the page, and ends everything else above it."""
    panel = "[data-floating-window]:has(.emaviz-strip)"
    row = f"{panel} div:has(> div > .emaviz-strip)"
    handles = ("griphandle", "strip", "header", "resize")
    rules = (
        f"body:has(.emaviz-strip) [data-dock-root]{{height:calc(100% - {STRIP_HEIGHT_PX}px)!important;"
        "overflow:visible!important}"
        f"{panel}{{position:fixed!important;left:0!important;right:0!important;top:auto!important;bottom:0!important;"
        f"width:100%!important;height:{STRIP_HEIGHT_PX}px!important;transform:none!important;"
        "border-radius:0!important;box-shadow:none!important;border-top:1px solid rgba(134,142,150,.35)}"
        + ",".join(f"{panel} [data-dock-{handle}]" for handle in handles)
        + "{display:none!important}"
        f"{row}{{display:flex;align-items:center;gap:2px;padding:0 6px!important;height:{_ROW_PX}px}}"
        f"{row} > div{{flex:0 0 auto;padding-bottom:0!important}}"
        f"{row} {_LABEL}{{width:auto!important;white-space:nowrap}}"
        f"{row} > div:has(> button):first-of-type{{width:100px}}"
        f"{row} > div:has(input[role=combobox],input[aria-haspopup=listbox]){{width:165px}}"
        f"{row} > div:nth-of-type(4){{flex:1 1 auto}}"
        f"{row} > div:nth-of-type(5){{width:200px}}"
    )
    narrow = (
        f"{row} > div:nth-of-type(5){{width:175px}}{row} button{{padding:0 6px!important;font-size:12px!important}}"
    )
    narrow += f"{row} > div:has(> button){{width:84px}}{row} .mantine-Button-section{{display:none}}"
    wide, less = "@media (min-width: 900px)", "(max-width: 1250px)"
    return unescaped(f"<style>{wide}{{{rules}}}{wide} and {less}{{{narrow}}}</style>")


def _jobs() -> Html:
    """Lays the panel that holds `JOBS` along the bottom edge, over the strip's small print."""
    panel = "[data-floating-window]:has(.emaviz-jobs)"
    row, handles = f"{panel} div:has(> div > .emaviz-jobs)", ("griphandle", "strip", "header", "resize")
    return unescaped(
        f"<style>{panel}{{position:fixed!important;left:0!important;right:0!important;top:auto!important;"
        f"bottom:0!important;width:100%!important;height:{_JOBS_HEIGHT_PX}px!important;transform:none!important;"
        "border-radius:0!important;box-shadow:none!important;z-index:90!important;overflow:hidden!important;"
        "border-top:2px solid var(--mantine-primary-color-filled,#2f6fde)}"
        + ",".join(f"{panel} [data-dock-{handle}]" for handle in handles)
        + "{display:none!important}"
        f"{row}{{display:flex;align-items:center;gap:8px;padding:0 10px!important;height:{_JOBS_HEIGHT_PX - 2}px}}"
        f"{row} > div{{flex:0 0 auto;padding:0!important;margin:0!important}}"
        f"{row} > div:has(> .emaviz-jobs){{display:none}}{row} > div:has(.emaviz-job){{flex:1 1 0;min-width:0}}"
        f"{row} button{{height:19px!important;min-height:0!important;padding:0 8px!important;font-size:12px!important;"
        "width:auto!important}"
        f"{row} .mantine-Button-section{{margin-inline:0 6px!important}}"
        f"{row} span{{white-space:nowrap}}"
        ".emaviz-job{display:flex;align-items:center;gap:12px;font-size:13px;line-height:20px;white-space:nowrap;"
        "overflow:hidden}.emaviz-job > span{overflow:hidden;text-overflow:ellipsis}"
        ".emaviz-job a{cursor:pointer;text-decoration:underline;text-underline-offset:2px}"
        ".emaviz-job-share{flex:0 0 140px;height:7px;border-radius:4px;overflow:hidden;"
        "background:rgba(134,142,150,.3)}"
        ".emaviz-job-share > i{display:block;height:100%;background:var(--mantine-primary-color-filled,#2f6fde)}"
        ".emaviz-job-unknown{width:30%;animation:emaviz-job 1.6s infinite alternate ease-in-out}"
        "@keyframes emaviz-job{from{margin-left:0}to{margin-left:70%}}</style>"
    )


def unseen(controls: Sequence[str]) -> Html:
    """Takes controls off the screen, by their ids, for scripts to press."""
    rows = ",".join(f"div:has(> [id='{one}'])" for one in controls)
    return unescaped(f"<style>{rows}{{display:none!important}}</style>")


def unseen_field(field: str) -> Html:
    """The same for a field of text, which its label alone names by its id."""
    label = f"label[for='{field}']"
    rows = f".mantine-Flex-root:has({label}),div:has(> .mantine-Flex-root {label})"
    return unescaped(f"<style>{rows}{{display:none!important}}</style>")


def caption(text: str) -> Html:
    """A line of small print at the bottom of the strip."""
    return html(
        '<div style="position:fixed;left:18px;bottom:4px;font-size:12px;opacity:.7;white-space:nowrap">{}</div>', text
    )


def play_head(share: float | None) -> Html:
    """Tells `measure.js` where the upright line stands in every chart over time, a share of its width; None: none."""
    if share is None or not 0.0 <= share <= 1.0:
        return Html()
    return html('<i class="emaviz-play-head" data-share="{}"></i>', f"{100.0 * share:.2f}")


def figures(dark: bool) -> Html:
    """Text, grids and hover labels of figures that were drawn for a light page, legible on a dark one.

    Numbers at a trace's points and notes in a figure keep a colour of their own, where they have one.
    """
    if not dark:
        return Html()
    of, seen = ".js-plotly-plot", "stroke-opacity:1!important"
    red, green, blue = rgb(LIGHT.ink)
    own = ":is(.textpoint,.annotation) text"
    text = f".main-svg text:not({own}),{own}[style*='fill: rgb({red}, {green}, {blue})']"
    return unescaped(
        f"<style>{of} :is({text}){{fill:{DARK.ink}!important}}.u-title{{color:{DARK.ink}}}"
        f"{of} .textpoint text[style*='fill: rgb({', '.join(map(str, rgb(HELD_OUT)))})']"
        f"{{fill:{_HELD_OUT_ON_DARK}!important}}"
        f"{of} .annotation text[style*='fill: rgb({', '.join(map(str, rgb(LIMIT)))})']"
        f"{{fill:{_LIMIT_ON_DARK}!important}}"
        f"{of} :is(.gridlayer,.angular-grid,.radial-grid) path{{stroke:{DARK.grid}!important;{seen}}}"
        f"{of} :is(.zerolinelayer path,path.ticks){{stroke:{DARK.zero}!important;{seen}}}"
        f"{of} .hoverlayer .hovertext path{{fill:{DARK.paper}!important}}"
        ".mantine-Paper-root>.mantine-ActionIcon-root{background:rgba(0,0,0,.4)!important}</style>"
    )
