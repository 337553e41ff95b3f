"""SI units: as people see them, as names of columns and parameters end in them, and what takes their place elsewhere.

On a linear axis an angle is a length, a torque a force, an inertia a mass: each unit says its counterpart there.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SiUnit:
    """One unit; `linear` is what is shown in its place on a linear axis, `prefixes` are those it is written with."""

    shown: str
    ending: str  # of a name, without the underscore
    linear: str = ""  # the unit itself where nothing changes
    prefixes: str = ""


_SMALL, _ALL_SIZES = "mµ", "mµk"
_SI_TABLE = (
    SiUnit("N·m·s²/rad", "Nms2_rad", "N·s²/m"),
    SiUnit("N·m·s/rad", "Nms_rad", "N·s/m"),
    SiUnit("N·m/rad³", "Nm_rad3", "N/m³"),
    SiUnit("N·m/rad", "Nm_rad", "N/m"),
    SiUnit("N·m/A", "Nm_A", "N/A"),
    SiUnit("kg·m²", "kgm2", "kg"),
    SiUnit("rad/s²", "rad_s2", "m/s²"),
    SiUnit("rad/s", "rad_s", "m/s", _SMALL),
    SiUnit("1/rad", "1_rad", "1/m"),
    SiUnit("rad", "rad", "m", _SMALL),
    SiUnit("N·m", "Nm", "N", _ALL_SIZES),
    # of linear axes
    SiUnit("N·s²/m", "Ns2_m"),
    SiUnit("N·s/m", "Ns_m"),
    SiUnit("N/m³", "N_m3"),
    SiUnit("N/m", "N_m"),
    SiUnit("N/A", "N_A"),
    SiUnit("kg", "kg"),
    SiUnit("m/s²", "m_s2"),
    SiUnit("m/s", "m_s", prefixes=_SMALL),
    SiUnit("1/m", "1_m"),
    SiUnit("m", "m", prefixes=_SMALL),
    SiUnit("N", "N", prefixes=_ALL_SIZES),
    # of both
    SiUnit("1/s", "1_s"),
    SiUnit("1/A", "1_A"),
    SiUnit("Ω", "Ohm"),
    SiUnit("Hz", "Hz"),
    SiUnit("H", "H"),
    SiUnit("V", "V", prefixes=_ALL_SIZES),
    SiUnit("A", "A", prefixes=_ALL_SIZES),
    SiUnit("s", "s", prefixes=_SMALL),
    SiUnit("°C", "C"),
)
BY_SHOWN: dict[str, SiUnit] = {unit.shown: unit for unit in _SI_TABLE}
# The longest first: a name that ends in _Nm_rad ends in _rad as well.
_BY_ENDING = {unit.ending: unit for unit in sorted(_SI_TABLE, key=lambda unit: -len(unit.ending))}


def of_name(name: str) -> SiUnit | None:
    """The unit that a name ends in: kg·m² of inertia_kgm2; None of a number without one."""
    return next((unit for ending, unit in _BY_ENDING.items() if name.endswith(f"_{ending}")), None)


def without_unit(name: str) -> str:
    """'inertia' of 'inertia_kgm2'."""
    unit = of_name(name)
    return name if unit is None else name.removesuffix(f"_{unit.ending}")


def linear_unit(shown: str) -> str:
    """The unit on a linear axis: N of N·m, A of A."""
    unit = BY_SHOWN.get(shown)
    return shown if unit is None else unit.linear or shown


def linear_name(name: str) -> str:
    """The linear counterpart of a rotary name: inertia_kgm2 → mass_kg, load_torque_Nm → load_force_N."""
    unit = of_name(name)
    if unit is None or not unit.linear:
        return name
    words = without_unit(name).replace("inertia", "mass").replace("torque", "force")
    return f"{words}_{BY_SHOWN[unit.linear].ending}"
