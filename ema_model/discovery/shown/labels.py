"""What the parts of a discovery are called: effects, steps of the ladder, fitted values."""

from __future__ import annotations

import math

from ema_model.actuator.naming import on_axes
from ema_model.discovery.result import Added, Change, Discovery
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError
from ema_model.estimation import Calibrated
from ema_model.faults import BY_NAME, cause_of, causes
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import amount, with_uncertainty
from ema_model.quantities.titles import all_of, in_sentence

_FAULTS = {"k6": "Rotor eccentricity"}  # that are called otherwise than their number: with its phase it is one cause
_SIGNS = {"effect": "+", "removed": "−"}


def effect_title(name: str) -> str:
    """'Cogging torque' of 'cogging_torque'; the name itself of an effect that is not known here.

    Of a fault 'Backlash (fault k2)', since effects have names like its title.
    """
    if name in BY_NAME:
        return f"{_FAULTS.get(name, BY_NAME[name].title)} (fault {name})"
    try:
        return find(name).title
    except InputError:
        return name


def rung_title(one: Change, axes: Axes) -> str:
    """'+ Cogging torque'."""
    if one.kind in _SIGNS:
        names = [name for name in one.names if name not in BY_NAME or name == cause_of(name)[0]]
        return f"{_SIGNS[one.kind]} {all_of([effect_title(name) for name in names])}{_of_orders(one, axes)}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).title} freed"
    if one.kind == "replaced":
        before, after = (effect_title(name) for name in one.names)
        return f"{after} in place of {in_sentence(before)}"
    if one.kind == "fault":  # a phase belongs to its modulus
        return f"Fault {all_of([BY_NAME[name].label for name in causes(one.names)])}"
    label = rung_label(one, axes)
    return label[:1].upper() + label[1:]


def rung_label(one: Change, axes: Axes) -> str:
    """'+ cogging_torque of orders 28, 14', by the library's names: for the terminal and JSON."""
    if one.kind == "fault":
        return f"fault {all_of([BY_NAME[name].label for name in one.names])}"
    if one.kind == "parameter":
        return f"{on_axes(one.names[0], axes).path} outside its tolerance"
    if one.kind == "replaced":
        return f"{one.names[1]} in place of {one.names[0]}"
    if one.kind == "without_controller":
        return "calibrated, without the controller"
    if one.kind == "calibrated":
        return one.kind
    if one.names[0] in BY_NAME:
        return f"{_SIGNS[one.kind]} fault {all_of([BY_NAME[name].label for name in one.names])}"
    names = [name if name in CATALOGUE else in_sentence(effect_title(name)) for name in one.names]
    return f"{_SIGNS[one.kind]} {all_of(names)}{_of_orders(one, axes)}"


def _of_orders(one: Change, axes: Axes) -> str:
    """' of orders 28, 14', or along a linear motor ' of pitches 2.50 mm, 417 µm'."""
    if not one.orders:
        return ""
    if axes.motor == "linear":
        return f" of pitches {', '.join(amount(2.0 * math.pi / order, 'm') for order in one.orders)}"
    return f" of orders {', '.join(f'{order:g}' for order in one.orders)}"


def value(one: Calibrated) -> str:
    """'12.2 ± 0.70 mN·m': with half of the 90 % interval."""
    half = 0.5 * (one.interval90[1] - one.interval90[0])
    return with_uncertainty(one.value, half, one.unit)


def settings(found: Discovery, one: Added) -> dict[str, str]:
    """Each parameter of an added effect with its value; whole numbers, which are chosen and not fitted, first."""
    chosen = {name: f"{setting:g}" for name, setting in one.chosen.items()}
    return chosen | {name: value(fitted_of(found, one, name)) for name in one.parameters}


def fitted_of(found: Discovery, one: Added, name: str) -> Calibrated:
    """A fitted parameter of an added effect as the last model has it: later effects may have moved it."""
    return found.calibration.parameters.get(f"effects.{one.key}.{name}", one.parameters[name])
