"""How headless Chromium is started: WebGL by software, nothing that asks the network, few pictures a second."""

from __future__ import annotations

from typing import Any

SOFTWARE_GL = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync --use-gl=angle --use-angle=gl-egl --ignore-gpu-blocklist --disable-accelerated-2d-canvas "
    "--disable-gpu-rasterization"
).split()
# By software GL a scene at rest takes a core and a half, of two, for nothing that most tests look at: what moves there
# is asked of its poses.  So nothing is drawn in it, and a page has five frames a second.
CALM = """
for (const gl of [WebGL2RenderingContext.prototype, WebGLRenderingContext.prototype])
  for (const draw of ['drawElements', 'drawArrays', 'drawElementsInstanced', 'drawArraysInstanced'])
    gl[draw] = () => {};
const frame = window.requestAnimationFrame.bind(window);
window.requestAnimationFrame = (then) => setTimeout(() => frame(then), 200);
window.cancelAnimationFrame = clearTimeout;
"""


# Plotly's own, of a chart whose panel is left while it is being drawn: it goes on drawing what is no longer there.
NOT_OURS = ("_redrawFromAutoMarginCount",)


class Browser:
    """A browser of Playwright's, whose pages are calm unless they are asked to be drawn, and whose errors are heard."""

    def __init__(self, chromium: Any) -> None:
        self._chromium = chromium
        self._errors: list[str] = []

    def new_page(self, *, drawn: bool = False, **settings: Any) -> Any:
        """Of a context of its own."""
        page = self._chromium.new_page(**settings)
        self._hear(page)
        if not drawn:
            page.add_init_script(CALM)
        return page

    def new_context(self, *, drawn: bool = False, **settings: Any) -> Any:
        """Whose pages are calm as well."""
        context = self._chromium.new_context(**settings)
        context.on("page", self._hear)
        if not drawn:
            context.add_init_script(CALM)
        return context

    def errors(self) -> list[str]:
        """What pages have thrown, or written to their console as an error, since this was asked last."""
        heard, self._errors = self._errors, []
        return [one for one in heard if not any(text in one for text in NOT_OURS)]

    def close(self) -> None:
        """With all its pages."""
        self._chromium.close()

    def _hear(self, page: Any) -> None:
        page.on("pageerror", lambda error: self._errors.append(f"{page.url}: {error}"))
        page.on("console", lambda said: said.type == "error" and self._errors.append(f"{page.url}: {said.text}"))
