"""What the page may do in the browser: speak to its own server, and show the Rerun viewer's page."""

from __future__ import annotations

from websockets.datastructures import Headers

# All that viser's client needs is in its own page; blob: and data: are its workers, textures and saved files.
_PAGE = "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:"
_REST = "frame-ancestors 'self'; object-src 'none'; base-uri 'none'; form-action 'none'"


def protect(headers: Headers, host: str, viewer: str | None) -> None:
    """Adds the page's policy to an answer.

    host: name and port by which the browser asked; viewer: the address of the Rerun viewer, if it reaches that.
    """
    # Not every browser takes ws: for 'self', and a policy has no way to write an IPv6 address.
    websocket = "" if host.startswith("[") else f" ws://{host}"
    frame = f" {viewer}" if viewer else ""
    headers["Content-Security-Policy"] = (
        f"{_PAGE}; connect-src 'self' blob: data:{websocket}; frame-src 'self'{frame}; {_REST}"
    )
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Referrer-Policy"] = "no-referrer"
