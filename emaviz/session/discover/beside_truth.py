"""A discovery beside the truth that a challenge hides, in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ema_model.actuator.readings import sentences
from ema_model.challenges.truth import Truth
from ema_model.discovery import Discovery
from ema_model.discovery.result import Added
from ema_model.discovery.shown.labels import effect_title, fitted_of, value
from ema_model.effects import CATALOGUE, find
from ema_model.faults import BY_NAME, NAMES
from ema_model.quantities.numbers import amount
from ema_model.quantities.titles import in_sentence
from ema_model.text import Document, Lines, Remark, Remarks, Severity

_NEAR = 0.25  # of the true value, within which a strength counts as found where its interval misses it


# What of the model's parameters tells a fault that is slight enough to pass for it.
_OF_FAULT = {"k1": "friction", "k2": "backlash", "k8": "position_gain"}


def agrees(truth: Truth, found: Discovery, added: tuple[Added, ...]) -> bool:
    """Whether the answer names exactly what is hidden: the effects, or a torque of its own for an unknown one."""
    named = {one.name for one in added if one.name in CATALOGUE and not one.stands_for}
    own = any(one.name not in CATALOGUE for one in added)
    seen = all(_sees(found, fault) for fault in truth.faults)
    return named == set(truth.effects) and own == bool(truth.torque) and seen and not _invented(truth, found)


def _sees(found: Discovery, fault: str) -> bool:
    told = _OF_FAULT.get(fault)
    return fault in found.faults or (told is not None and any(told in p for p in found.parameters_outside_tolerance))


def _invented(truth: Truth, found: Discovery) -> list[str]:
    """Faults that were named and are not there; a phase belongs to its modulus."""
    return [name for name in found.faults if name not in truth.faults and name != "k7"]


def _fault(fault: str, k: ArrayLike, found: Discovery) -> Remark:
    index = NAMES.index(fault)
    what = f"{in_sentence(BY_NAME[fault].title)} fault: {sentences(k, found.plant.actuator)[index]}"
    if fault in found.faults:
        own, true = found.faults[fault], float(np.asarray(k)[index])
        low, high = own.interval90
        near = low <= true <= high or abs(own.value - true) <= _NEAR * abs(true - BY_NAME[fault].healthy)
        return _row(near, what, f"{fault} {true:g} in truth, {value(own)} found")
    good = _sees(found, fault)
    return _row(good, what, "its parameter is outside its tolerance" if good else "not found; try Identify")


def document_of(truth: Truth, found: Discovery, added: tuple[Added, ...]) -> Document:
    """Whether they agree, the truth in words, then effect by effect."""
    good = agrees(truth, found, added)
    verdict = Remark(f"Your answer {'agrees' if good else 'differs'}", "this is what was hidden", _severity(good))
    rows = [_effect(name, given, found, added) for name, given in truth.effects.items()]
    rows += [_fault(fault, truth.k, found) for fault in truth.faults]
    for name in _invented(truth, found):
        rows.append(_row(False, f"the fault {BY_NAME[name].label}", "is not hidden here"))
    if truth.torque:
        own = next((one for one in added if one.name not in CATALOGUE), None)
        what = f"an effect outside the library: T = {truth.torque}"
        how = f"found as {in_sentence(effect_title(own.name))}" if own else "not found: add the residual's curve"
        rows.append(_row(own is not None, what, how))
    for one in added:
        if one.name in CATALOGUE and one.name not in truth.effects:
            tied = [name for name in one.same_as if name in truth.effects or name in truth.faults]
            if one.stands_for:
                why = "a parameter outside its tolerance; nothing of the kind is hidden"
            elif tied:
                why = f"cannot be told from {in_sentence(effect_title(tied[0]))} by these recordings"
            else:
                why = "is not hidden here"
            rows.append(_row(False, in_sentence(effect_title(one.name)), why))
    if not rows:
        rows.append(_row(True, "nothing is hidden", "and you added nothing"))
    return Document([Remarks([verdict]), Lines([truth.answer]), Remarks(rows)])


def _effect(name: str, given: dict[str, float], found: Discovery, added: tuple[Added, ...]) -> Remark:
    title = in_sentence(effect_title(name))
    order = given.get("order")
    own = [one for one in added if one.name == name]
    one = next((one for one in own if order is None or one.chosen.get("order") == order), own[0] if own else None)
    if one is None:
        return _row(False, title, "not found")
    first = find(name, found.actuator.axes).parameters[0]
    fitted = fitted_of(found, one, first.name)
    low, high = fitted.interval90
    inside = low <= given[first.name] <= high
    near = inside or abs(fitted.value - given[first.name]) <= _NEAR * abs(given[first.name])
    told = f"{in_sentence(first.title)} {amount(given[first.name], first.unit)} in truth, {value(fitted)} found"
    if order is not None:
        told += f"; order {order:g} in truth, {one.chosen.get('order', 0.0):g} found"
    return _row(near and (order is None or one.chosen.get("order") == order), title, told)


def _row(good: bool, what: str, how: str) -> Remark:
    return Remark(what[:1].upper() + what[1:], how, _severity(good))


def _severity(good: bool) -> Severity:
    return "good" if good else "bad"
