"""Links to the Rerun viewer: a tab of its own is as light or dark as the page is when they are pressed."""

from __future__ import annotations

from emaviz.server.viser_private import Inside

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
