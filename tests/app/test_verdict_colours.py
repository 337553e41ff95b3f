"""Green says that nothing is missing, and nothing else: on the page as in the reports."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from support.comparison_by_hand import comparison
from support.discovered import with_cogging

from emaviz.page.compare_result import headline
from emaviz.page.discover_result import answer
from emaviz.text.verdicts import MEANINGS, of_discovery, of_units
from emaviz.views import discovery
from emaviz.views.comparison import VIEW
from emaviz.views.report import Figures, markup

GREEN = MEANINGS["good"]


def look(found, assessed=True) -> Any:
    """A story as it stands, of which nothing is promising any more."""
    assessment = SimpleNamespace(left=SimpleNamespace(explanation=None)) if assessed else None
    return SimpleNamespace(found=found, assessment=assessment, added=list(found.effects), promising=[])


@pytest.mark.parametrize(
    ("adequate", "error", "meaning"), [(True, 1.0, "good"), (True, 1.08, "warning"), (False, 1.0, "warning")]
)
def test_a_comparison_is_green_where_the_model_is_adequate_and_within_its_band(adequate, error, meaning):
    compared = comparison()
    signals = {
        name: replace(one, in_floors=replace(one.in_floors, error=error)) for name, one in compared.signals.items()
    }
    compared = replace(compared, adequate=adequate, over_floor=error, signals=signals)
    assert (GREEN in headline(compared)) == (meaning == "good") and MEANINGS[meaning] in headline(compared)
    assert f'class="verdict {meaning}"' in markup(VIEW.sections[0].pieces(compared), Figures())


def test_units_are_green_where_their_models_miss_nothing():
    for known, meaning in (({}, "good"), ({"is_missed": True}, "warning"), ({"differences": ["one"]}, "warning")):
        found: Any = SimpleNamespace(**{"differences": [], "scattering": [], "is_missed": False, **known})
        assert of_units(found) == meaning


@pytest.mark.long
def test_a_discovery_is_green_where_nothing_is_missing():
    found = with_cogging()
    nothing = replace(found, verdict="adequate", effects=[], faults={}, parameters_outside_tolerance=())
    meanings = {
        "good": [nothing],
        "found": [
            replace(found, verdict="effects_found"),
            replace(nothing, faults={"k1": next(iter(found.calibration.parameters.values()))}),
            replace(nothing, parameters_outside_tolerance=("motor.inertia_kgm2",)),
        ],
        "warning": [replace(found, verdict=one) for one in ("partly_explained", "unknown_effect", "not_converged")],
    }
    for meaning, answers in meanings.items():
        assert [of_discovery(one) for one in answers] == [meaning] * len(answers)
    for one in (replace(found, verdict="effects_found"), nothing):
        meaning = of_discovery(one)
        assert MEANINGS[meaning] in answer(look(one)) and (GREEN in answer(look(one))) == (one is nothing)
        assert f'class="verdict {meaning}"' in markup(discovery.VIEW.sections[0].pieces(one), Figures())
    assert GREEN not in answer(look(nothing, assessed=False)), "it is not yet known"
