"""Parameters in words."""

from __future__ import annotations

_ENDINGS = (
    *("_Nms2_rad", "_Ns2_m", "_Nms_rad", "_Ns_m", "_Nm_rad", "_N_m", "_Nm_A", "_N_A", "_kgm2", "_kg", "_rad_s"),
    *("_m_s", "_1_rad", "_1_m", "_1_s", "_rad", "_Nm", "_Ohm", "_m", "_N", "_H", "_V", "_A", "_s"),
)


def parameter_title(path: str) -> str:
    """'Motor inertia' of 'motor.inertia_kgm2'; the unit is told apart."""
    section, _, name = path.rpartition(".")
    for ending in _ENDINGS:
        if name.endswith(ending):
            name = name.removesuffix(ending)
            break
    words = f"{section.replace('.', ' ')} {name}".replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def in_sentence(title: str) -> str:
    """A title within a sentence: 'motor inertia', but 'RMS current' as it is."""
    return title if title[1:2].isupper() else title[:1].lower() + title[1:]
