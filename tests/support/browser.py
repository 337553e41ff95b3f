"""How headless Chromium is started: WebGL by software, nothing that asks the network."""

from __future__ import annotations

SOFTWARE_GL = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync --use-gl=angle --use-angle=gl-egl --ignore-gpu-blocklist --disable-accelerated-2d-canvas "
    "--disable-gpu-rasterization"
).split()
