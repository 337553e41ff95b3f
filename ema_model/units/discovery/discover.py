"""Looks for the physics that units lack: unit by unit, and in each again for what others lack.

Each unit's parameters are its own in this, so that what units differ in is no effect that they lack.  An effect that
at least half of the units lack is asked of the others by itself, since one rival less may tell it; what a unit lacks
besides is looked for with that in its model.  Every claim of a unit is one of its own recordings, held-out ones too:
evidence is not added up over units, so that an effect too weak for each of them is not found.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ema_model.actuator import Actuator
from ema_model.discovery import Added, Discovery, discover
from ema_model.recordings import Measurement
from ema_model.units.compare import check_units, compare_units
from ema_model.units.discovery.result import Lack, UnitsDiscovered

Progress = Callable[[str], None]
_Units = Mapping[str, Sequence[Measurement]]


def discover_units(
    units: _Units,
    actuator: Actuator,
    *,
    holdout: _Units | None = None,
    signals: Sequence[str] | None = None,
    most_effects: int = 3,
    seed: int = 0,
    on_progress: Progress | None = None,
) -> UnitsDiscovered:
    """The recordings of several units of one type, by the units' names.

    holdout: recordings that are not fitted, by which each unit's effects are confirmed; most_effects: of a unit.
    Raises InputError for one unit only, and for recordings that cannot be compared.
    """
    tell = on_progress or (lambda text: None)
    held = holdout or {}
    check_units(units, held)

    def look(name: str, model: Actuator, most: int, candidates: Sequence[str] | None = None) -> Discovery:
        return discover(
            units[name],
            model,
            holdout=held.get(name, ()),
            signals=signals,
            candidates=candidates,
            most_effects=most,
            on_progress=lambda text: tell(f"{name}: {text}"),
        )

    last = {name: look(name, actuator, most_effects) for name in units}
    added: dict[str, list[Added]] = {name: [*one.effects] for name, one in last.items()}
    for effect in _often(added):
        for name in units:
            if any(_is_it(one, effect) for one in added[name]):
                continue
            alone = look(name, actuator, 1, [effect])
            if alone.effects:
                rest = look(name, alone.actuator, max(0, most_effects - 1))
                last[name], added[name] = rest, [*alone.effects, *rest.effects]
    lacks = _lacks(added)
    common = [one for one in lacks if len(one.by_unit) == len(units)]
    model = _with(actuator, common, last)
    compared = compare_units(units, model, holdout=held, seed=seed, on_progress=tell)
    return UnitsDiscovered(
        tuple(units), tuple(lacks), last, compared, model, frozenset(name for name in units if held.get(name))
    )


def _is_it(one: Added, effect: str) -> bool:
    return one.name == effect or effect in one.same_as


def _often(added: Mapping[str, Sequence[Added]]) -> list[str]:
    """Effects that half of the units lack, or more, the most frequent first."""
    names = dict.fromkeys(one.name for of_unit in added.values() for one in of_unit)
    counts = {name: sum(any(_is_it(one, name) for one in of_unit) for of_unit in added.values()) for name in names}
    return sorted((name for name in names if 2 * counts[name] >= len(added)), key=lambda name: -counts[name])


def _lacks(added: Mapping[str, Sequence[Added]]) -> list[Lack]:
    """By effect, those that most units lack first; a unit's rival of another unit's effect is that effect."""
    left = {name: [*of_unit] for name, of_unit in added.items()}
    found = []
    while any(left.values()):
        names = dict.fromkeys(one.name for of_unit in left.values() for one in of_unit)
        of_it = {
            effect: {
                name: next(one for one in of_unit if _is_it(one, effect))
                for name, of_unit in left.items()
                if any(_is_it(one, effect) for one in of_unit)
            }
            for effect in names
        }
        effect = max(names, key=lambda name: len(of_it[name]))
        by_unit = of_it[effect]
        rivals = set.intersection(*({one.name, *one.same_as} for one in by_unit.values())) - {effect}
        found.append(Lack(effect, by_unit, tuple(sorted(rivals))))
        left = {name: [one for one in of_unit if one is not by_unit.get(name)] for name, of_unit in left.items()}
    return found


def _with(actuator: Actuator, common: Sequence[Lack], last: Mapping[str, Discovery]) -> Actuator:
    """The actuator with effects as one unit has them, free to differ: the unit that holds all under their own names."""
    for lack in common:
        unit, one = next(((u, one) for u, one in lack.by_unit.items() if one.name == lack.effect))
        improved = last[unit].actuator
        prefix = f"effects.{one.key}."
        tolerances = {path: tolerance for path, tolerance in improved.tolerances.items() if path.startswith(prefix)}
        actuator = replace(
            actuator,
            effects={**actuator.effects, one.key: improved.effects[one.key]},
            tolerances={**actuator.tolerances, **tolerances},
        )
    return actuator
