"""A solid in the scene: the one place that says how the actuator's parts are drawn."""

from __future__ import annotations

import viser

from emaviz.scene.palette import Colour
from emaviz.scene.solids import Solid


def add_mesh(
    scene: viser.SceneApi,
    name: str,
    solid: Solid,
    colour: Colour,
    *,
    flat: bool = False,
    opacity: float | None = None,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> viser.MeshHandle:
    """Without shadows, which cost software GL most; flat: its edges are seen."""
    return scene.add_mesh_simple(
        name,
        solid.vertices,
        solid.faces,
        color=colour,
        flat_shading=flat,
        opacity=opacity,
        position=position,
        cast_shadow=False,
        receive_shadow=False,
    )
