"""Links to the Rerun viewer: a tab of its own is as light or dark as the page is when they are pressed."""

from __future__ import annotations

from pathlib import Path

from emaviz.recording.viewer import ViewerHost
from emaviz.server.viser_private import Inside
from emaviz.text.html import Html, html

LINK = "emaviz-viewer"  # their class
# Without it the viewer follows the system's theme.  A link is told on its way, so that what was drawn before the page
# changed is right as well: before a press of any button, of which one opens a tab and one a menu, or of Enter.
_SCRIPT = """
(() => {
  window.emavizLinks?.();
  const told = (event) => {
    const link = event.target.closest?.('a.LINK');
    if (!link) return;
    const address = new URL(link.href);
    const dark = document.documentElement.dataset.mantineColorScheme === 'dark';
    address.searchParams.set('theme', dark ? 'dark' : 'light');
    link.href = address;
  };
  const kinds = ['pointerdown', 'click'];
  for (const kind of kinds) document.addEventListener(kind, told, true);
  window.emavizLinks = () => { for (const kind of kinds) document.removeEventListener(kind, told, true); };
})();
"""


def follow_theme(inside: Inside) -> None:
    """In every page that is or will be open."""
    inside.run(_SCRIPT.replace("LINK", LINK))


def recording_link(viewer: ViewerHost | None, path: Path, text: str = "") -> Html:
    """A link that opens a recording in the Rerun viewer, or its name where there is none."""
    if viewer is None:
        return html('<div style="padding:2px 10px;font-size:13px">{}</div>', path.name)
    return html(
        '<div style="padding:2px 10px;font-size:13px;overflow-wrap:anywhere"><a class="{}" href="{}" '
        'target="_blank" rel="noopener">{}</a></div>',
        LINK,
        viewer.url_of(path.name),
        text or f"Open {path.name} in Rerun ↗",
    )
