"""One number everywhere: whatever shows a result states the same value for the same thing, and no more than it says.

Every number of a comparison, a discovery and an identification is collected with what it is called: from the words on
the terminal, the notebook, the JSON, the report, the charts and the page's panels.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
import pytest
from support.bench_units import ACTUATOR, motion
from support.comparison_by_hand import comparison as by_hand
from support.shown import bands, in_floors, named, plain, unstated, unsure

from ema_model.actuator import Actuator, load_actuator
from ema_model.actuator.actuator import between
from ema_model.comparison.compare import compare
from ema_model.comparison.residuals import OverFloor
from ema_model.comparison.result import (
    Comparison,
    SignalError,
    document_of,
    errors,
    errors_by_recording,
    free_simulation,
    verdict,
)
from ema_model.discovery import Discovery, discover, result_of, words
from ema_model.discovery.history import begun
from ema_model.discovery.result import Change, errors_of
from ema_model.discovery.snapshot import Look, assessed, look_at
from ema_model.estimation.calibrate import calibration_table, combination_in_words
from ema_model.faults import NAMES
from ema_model.identification.run import Identification, identify, in_one_line
from ema_model.identification.run import verdict as identified_verdict
from ema_model.identification.search import Objective
from ema_model.quantities import amount, number, of_signal, variable_title
from ema_model.recordings import Measurement
from ema_model.recordings.read import read_measurement
from ema_model.text import COLOURS
from emaviz.cli import main
from emaviz.figures import campaign
from emaviz.figures import comparison as comparison_figures
from emaviz.figures import discovery as discovery_figures
from emaviz.figures.identification import fault_bars
from emaviz.page import discover_candidate
from emaviz.page.compare_result import headline, motion_of, numbers
from emaviz.page.discover_result import answer
from emaviz.text.verdicts import MEANINGS, of_comparison, of_discovery, sure_words
from emaviz.views.report import export

FAILING, SLIGHT = 0.006, 0.00035  # N·m of cogging: far beyond noise; so little that a model passes outside its band
CANDIDATES = ("cogging_torque", "constant_load", "stribeck_friction")
IN_FLOORS = ("over_floor", "holdout_over_floor", "floor_band", "holdout_floor_band")
ON_LADDER = (*IN_FLOORS, "rmse_before", "rmse_after", "holdout_rmse_before", "holdout_rmse_after", "before", "after")


def run(cogging_Nm: float, seed: int = 0) -> Measurement:
    """A motor of the bench, moved to and fro, with twelve cogs a turn."""
    signals = motion(0.012, seed)
    signals["current_A"] += cogging_Nm / 0.05 * np.sin(12.0 * signals["motor_position_rad"] + 0.4)
    return Measurement(signals, name=f"run {seed}")


@cache
def compared(case: str) -> Comparison:
    """Without and with cogging; of the three-phase actuator with several signals, by hand."""
    if case == "several signals":
        return by_hand(("bench run", "second run"), duration_s=0.3)
    hidden = {"adequate": 0.0, "outside its band": SLIGHT, "failing": FAILING}[case]
    return compare([run(hidden)], bench(), holdout=[run(hidden, 1)] if case == "failing" else ())


@cache
def discovered(case: str) -> Discovery:
    """An effect that is found, with a recording that is held out; nothing to find; nothing claimed outside the band."""
    hidden = {"found": FAILING, "adequate": 0.0, "outside its band": SLIGHT}[case]
    held = [run(hidden, 1)] if case == "found" else ()
    return discover([run(hidden)], bench(), holdout=held, candidates=CANDIDATES, most_effects=1)


@cache
def bench() -> Actuator:
    folder = Path(_FOLDER[0])
    assert main(["actuator", "new", str(folder / "bench.toml"), "--name=bench", *ACTUATOR]) == 0
    return load_actuator(folder / "bench.toml")


_FOLDER: list[str] = []


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory):
    _FOLDER[:] = [str(tmp_path_factory.mktemp("bench"))]


COMPARED = ("adequate", "outside its band", "failing", "several signals")
DISCOVERED = ("adequate", "outside its band", "found")


def texts(result: Any, write: Callable[[Path], None], page: str) -> dict[str, str]:
    """All that is said of a result, by who says it."""
    folder = Path(mkdtemp(dir=_FOLDER[0]))
    write(folder / "report.html")
    return {
        "terminal": str(result),
        "notebook": plain(result._repr_html_()),
        "report": plain((folder / "report.html").read_text(encoding="utf-8")),
        "page": plain(page),
    }


@cache
def of_comparison_texts(found: Comparison) -> dict[str, str]:
    return texts(found, lambda path: export(found, path), headline(found) + numbers(found))


# --- a comparison -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", COMPARED)
def test_every_error_of_a_comparison_is_the_one_of_its_json(case):
    found = compared(case)
    told, document = of_comparison_texts(found), found.to_dict()
    known = named(document, IN_FLOORS)
    for who, text in told.items():
        assert unstated(text, known) == [], who
        pooled = re.search(r"All signals together, the error is ([\d.]+) times", text)
        assert pooled is not None and pooled[1] == number(found.over_floor), who
        assert unsure(text, document) == [], who
        assert "χ² per value" not in text, "another ruler"
        band = tuple(f"{one:.2f}" for one in document["floor_band"])
        assert band in bands(text), who
    for name, one in document["signals"].items():
        shown = SignalError(**{k: one[k] for k in ("rmse", "rmse_initial", "nrmse", "noise_floor", "mean_absolute")})
        of = shown.quantity(of_signal(name, found.actuator.axes))
        table = errors(found)
        row = next(row for row in table.rows if row[0] == of.title)
        cells = dict(zip(table.head, row[1:]))
        assert cells["rms error"] == number(of.factor * one["rmse"])
        assert cells["floor"] == number(of.factor * one["noise_floor"])
        assert cells["error / floor"] == number(one["over_floor"])
        for who, text in told.items():
            assert cells["error / floor"] in text and cells["rms error"] in text, (who, name)


@pytest.mark.parametrize("case", COMPARED)
def test_the_pooled_error_lies_between_those_that_it_pools(case):
    """4.84 floors beside four ratios of 1.10 and less is no mean of anything."""
    document = compared(case).to_dict()
    each = [one["over_floor"] for one in document["signals"].values() if one["counted"]]
    assert each and min(each) - 1e-9 <= document["over_floor"] <= max(each) + 1e-9
    residuals = compared(case).residuals
    over = [(residuals.values[name] / residuals.sigma[name]) ** 2 for name in document["signals"]]
    if case == "several signals":  # whose blocks all count alike
        assert each == pytest.approx([float(np.sqrt(np.mean(one))) for one in over])


@pytest.mark.parametrize("case", COMPARED)
def test_the_colours_of_a_comparison_are_those_of_its_numbers(case):
    found = compared(case)
    document = found.to_dict()
    tables = [errors(found)]
    if (each := errors_by_recording(found, found.primary)) is not None:
        tables.append(each)
    for table in tables:
        for row, severity in zip(table.rows, table.severities):
            band = [one["floor_band"] for one in _all_errors(document) if number(one["over_floor"]) == row[-1]]
            above = round(float(row[-1]), 2) > round(band[0][1], 2)
            assert (severity == "good") == (not above), row
            assert f"color:{COLOURS[severity or 'note']}" in table.html
    green = of_comparison(found) == "good"
    assert green == (document["adequate"] and document["within_band"])
    assert (MEANINGS["good"] in headline(found)) == green
    shown = motion_of(found, found.recordings[0], found.actuator)
    if shown is not None:
        assert (shown.heat is not None and bool(np.any(shown.heat > 0.0))) == bool(found.worst_regions)


def _all_errors(document: dict[str, Any]) -> list[dict[str, Any]]:
    parts = [document["signals"], *(one["signals"] for one in (*document["recordings"], *document["holdout"]))]
    return [one for part in parts for one in part.values()]


@pytest.mark.parametrize("case", COMPARED)
def test_a_comparison_says_no_more_than_its_numbers(case):
    found = compared(case)
    outside = round(found.over_floor, 2) > round(found.floor_band[1], 2)
    for who, text in of_comparison_texts(found).items():
        praise = "The model explains the recordings" in text
        assert praise == (found.adequate and not outside), who
        assert ("is left than noise explains" in text) == outside, who
        if found.adequate and outside:
            assert f"{100.0 * (found.over_floor - 1.0):.0f} % more is left than noise explains" in text, who
            assert "no variable explains it" in text, who
    if case == "outside its band":
        assert found.adequate and outside, "the case that this test is for"
        assert verdict(found) == "adequate", "what decides has not moved"


@pytest.mark.parametrize("case", COMPARED)
def test_shares_are_those_of_the_residual_as_it_is(case):
    found = compared(case)
    document = found.to_dict()
    by = {(one["variable"], one["modulator"]): one["r2"] for one in document["explained_by"]}
    assert all(0.0 <= share <= 1.0 for share in by.values())
    order = list(dict.fromkeys(variable_title(one["variable"]) for one in document["explained_by"]))
    figure = comparison_figures.explained(found)
    assert list(figure.layout.yaxis.categoryarray)[::-1] == order, "as the explanations are ranked"
    titles = {variable_title(one["variable"]): one["variable"] for one in document["explained_by"]}
    for bar, modulator in zip(figure.data, _modulators(figure)):
        for name, length in zip(bar.y, bar.x):
            assert length == pytest.approx(100.0 * by[titles[name], modulator])
    table = next((one for one in document_of(found).blocks if getattr(one, "title", "").startswith("what expl")), None)
    assert table is not None
    for row, one in zip(table.rows, document["explained_by"]):
        assert row[-1] == f"{100.0 * one['r2']:.1f} %"
    for text in of_comparison_texts(found).values():
        for share in re.findall(r"(\d[\d.]*) % of the residual", text):
            assert any(f"{100.0 * one:.0f}" == share for one in by.values())


def _modulators(figure: Any) -> list[str]:
    from ema_model.quantities import MODULATORS

    return [next(name for name, one in MODULATORS.items() if one.title == bar.name) for bar in figure.data]


@pytest.mark.parametrize("case", COMPARED)
def test_a_calibration_is_told_alike(case):
    found = compared(case)
    fit, document = found.calibration, found.to_dict()
    assert fit is not None and document["calibration"] is not None
    table = calibration_table(fit, found.actuator.axes)
    assert table is not None
    parameters = document["calibration"]["parameters"]
    for row, one in zip(table.rows, parameters.values()):
        assert row[2] == number(one["value"], 4)
        ends = one["interval90"]
        assert row[3] == ("the file's" if ends is None else " … ".join(number(end, 4) for end in ends))
    chart = campaign.calibration_scores(found)
    drawn = sorted(float(x) for trace in chart.data if trace.x is not None for x in trace.x if x is not None)
    assert all(any(abs(z - one["z"]) < 1e-9 for z in drawn) for one in parameters.values())
    for table in free_simulation(found.simulation, found.actuator.axes)[:1]:
        for row, one in zip(table.rows, document["simulation"].values()):
            sizes = [size for size in (one["rmse"], one["holdout_rmse"]) if size is not None]
            of = of_signal(next(iter(document["simulation"])), found.actuator.axes).scaled(sizes)
            assert row[1] == ("–" if one["rmse"] is None else number(of.factor * one["rmse"]))


# --- a discovery ------------------------------------------------------------------------------------------------------


@cache
def of_discovery_texts(found: Discovery) -> dict[str, str]:
    look: Any = type("Shown", (), {})()
    look.found, look.assessment, look.added, look.promising = found, _nothing_left(), list(found.effects), []
    return texts(found, lambda path: export(found, path), answer(look))


def _nothing_left() -> Any:
    class Left:
        explanation = None

    class Assessed:
        left = Left

    return Assessed


@pytest.mark.parametrize("case", DISCOVERED)
def test_every_error_of_a_discovery_is_the_one_of_its_json(case):
    found = discovered(case)
    document = found.to_dict()
    known = named(document, ON_LADDER) + named(
        document["ladder"], ("rmse", "holdout_rmse", "recordings", "holdout_recordings")
    )
    for who, text in of_discovery_texts(found).items():
        assert unstated(text, known) == [], who
        assert in_floors(text), who
        assert unsure(text, document) == [], who
        assert "χ² per value" not in text, "another ruler"
        assert tuple(f"{one:.2f}" for one in document["floor_band"]) in bands(text), who
    rungs = document["ladder"]
    lines = {one.name: one for one in discovery_figures.error_ladder(found).data}
    held = [one["holdout_rmse"] for one in rungs]
    for name, values in (("fitted", [one["rmse"] for one in rungs]), *((("held out", held),) if held[0] else ())):
        assert list(lines[name].y) == values and list(lines[name].text) == [number(one) for one in values]
    axis, unit = words.primary(found), words.ladder(found)
    for row, one in zip(unit.rows, rungs):
        assert row[1] == number(one["rmse"]) and row[2] == ("" if held[0] is None else number(one["holdout_rmse"]))
        rms = of_signal(axis, found.actuator.axes).scaled([rung["signals"][axis] for rung in rungs])
        assert row[3] == number(rms.factor * one["signals"][axis]), "in the signal's unit beside it"
    assert document["remaining"]["rmse"] == rungs[-1]["rmse"]


def test_an_effects_errors_are_those_of_the_ladder():
    """They are told by the ladder, whose steps are counted anew where a fit is settled."""
    document = discovered("found").to_dict()
    [one], (before, after) = document["effects"], document["ladder"][-2:]
    assert (one["rmse_before"], one["rmse_after"]) == (before["rmse"], after["rmse"])
    assert (one["holdout_rmse_before"], one["holdout_rmse_after"]) == (before["holdout_rmse"], after["holdout_rmse"])


def test_an_effect_in_anothers_place_is_told_from_the_step_before_both():
    found = discovered("found")
    [one], base = found.effects, found.ladder[0]
    changes = [Change(), Change("effect", ("stribeck_friction",)), Change("replaced", ("stribeck_friction", one.name))]
    steps = [
        replace(base, change=change, rmse=rmse, holdout_rmse=None) for change, rmse in zip(changes, (9.0, 4.0, 2.0))
    ]
    told = errors_of(steps, replace(one, rmse_before=9.1, rmse_after=2.1))
    assert (told["rmse_before"], told["rmse_after"], told["holdout_before"]) == (9.0, 2.0, None)


@pytest.mark.parametrize("case", DISCOVERED)
def test_a_discovery_says_no_more_than_its_numbers(case):
    found = discovered(case)
    document = found.to_dict()
    for error, band, nothing in ((found.ladder[-1].rmse, found.floor_band, True), (1.08, (0.96, 1.04), False)):
        if not nothing:  # as of a clean hobby rig
            found = replace(found, ladder=[*found.ladder[:-1], replace(found.ladder[-1], rmse=error)], held=None)
            found.data.__dict__.pop("floor_spread", None)
        found_above = round(error, 2) > round(band[1], 2)
        for who, text in of_discovery_texts(found).items():
            if found.verdict == "adequate" and nothing:
                assert ("Nothing is missing" in text) == (not found_above), who
                assert ("more is left than noise explains" in text.lower()) == found_above, who
    green = of_discovery(discovered(case)) == "good"
    assert green <= bool(document["remaining"]["within_band"])


def test_nothing_is_missing_is_not_said_of_an_error_outside_its_band():
    """A clean hobby rig at 1.08 floors, of which a true model's is 0.96 to 1.04."""
    found = discovered("adequate")

    class At(Discovery):
        in_floors = property(lambda self: OverFloor(1.08, (0.96, 1.04)))  # type: ignore[assignment]

    told = At(**{name: getattr(found, name) for name in Discovery.__dataclass_fields__})
    line = words.headline(told)
    assert line == (
        "At 1.08 times the floor, where a true model's error is 0.96 to 1.04, 8 % more is left than noise explains, "
        "and no effect of the library explains it."
    )
    assert of_discovery(told) == "warning" and not told.to_dict()["remaining"]["within_band"]


@cache
def looked_at() -> Look:
    """The page's first look at what a discovery has to find."""
    story = begun([run(FAILING)], bench(), (), None, lambda text: None)
    return look_at(story, result_of(story), assessed(story))


def test_cards_stand_in_the_order_of_their_bars():
    look = looked_at()
    probable = [look.probability(one) for one in look.promising]
    assert probable and probable == sorted(probable, reverse=True) and max(probable) <= 1.0
    style = discover_candidate.style(look, [(f"card {i}", one) for i, one in enumerate(look.promising)], None)
    bars = [float(one) for one in re.findall(r"linear-gradient\(to right,[^ ]+ ([\d.]+)%", style)]
    assert bars == [pytest.approx(100.0 * one, abs=0.05) for one in probable]
    for one, share in zip(look.promising, probable):
        text, head = discover_candidate.label(look, one), plain(discover_candidate.head(look, one))
        assert f"{words.in_percent(share)} probable" in text and discover_candidate.confidence(look, one) in head
        assert not unstated(text + head, [look.rmse, look.predicted_rmse(one)])


def test_a_card_is_as_sure_as_what_it_leaves_lets_it_be():
    """± 8 stood on a card under points of ± 45: it was told as if nothing but noise were left."""
    look = looked_at()
    best = look.promising[0]
    alone = 1.645 * best.settings["amplitude_Nm"] / np.sqrt(best.predicted_drop)
    for rest in (0.5, 1.0, 25.0):  # χ² per value that is left with it
        half = replace(look, chi2=best.predicted_drop + rest * look.values).uncertainty(best)
        assert half == pytest.approx(alone * np.sqrt(max(1.0, rest)))


def test_candidates_stand_in_one_order():
    found = discovered("found")
    table = words.candidates(found)
    assert table is not None
    titles = [row[0] for row in table.rows]
    assert titles == [words.effect_title(one["name"]) for one in found.to_dict()["candidates"]]
    chart = discovery_figures.candidates(found)
    drawn = [re.sub(r"<[^>]+>", "", one) for one in chart.layout.yaxis.ticktext][::-1]
    assert drawn == titles
    bars = {one.name: list(one.x)[::-1] for one in chart.data}
    for row, predicted, refitted in zip(table.rows, bars["predicted"], bars["refitted"]):
        assert row[1] in ("–", f"{predicted:.0f}") and row[2] in ("", f"{refitted or 0.0:.0f}")


# --- an identification ------------------------------------------------------------------------------------------------


@cache
def identified() -> Identification:
    """A short search on a simulated run; the phases of its motor are known together alone."""
    path = str(Path(_FOLDER[0]) / "chirp.csv")
    asked = "simulate --fault k2=0.3 --duration 0.1 --noise-current 0.1 --seed 3 --out"
    assert main([*asked.split(), path]) == 0
    objective = Objective([read_measurement(path)], load_actuator())
    return identify(objective, "do", population=4, iterations=2, polish=True)


def test_an_identification_is_told_alike():
    found = identified()
    document = found.to_dict()
    bars = fault_bars(found.k, found.actuator, None, found.uncertainty.interval90, found.uncertainty.alarms)
    page = sure_words(found) + bars
    told = texts(found, lambda path: export(found, path), page)
    for name, k, (low, high) in zip(NAMES, document["k"], document["k_interval90"]):
        for who in ("terminal", "notebook", "report"):
            assert f"{k:.4f}" in told[who] and f"{low:.4f} … {high:.4f}" in told[who], (who, name)
        assert f"{name} = {k:.4f}, 90 % interval {low:.4f} … {high:.4f}" in bars
    error = f"orrected error {amount(document['corrected_rmse'], 'A')}"
    assert error in told["terminal"] and error in told["notebook"] and error in told["report"]
    state = identified_verdict(found)
    assert document["adequate"] and document["healthy"] == state.startswith("healthy")
    for name in document["alarms"]:
        assert name in state and in_one_line(found).startswith("Not healthy")
    assert document["identifiable"], "what is known only together is told"
    for one, said in zip(found.uncertainty.identifiable, document["identifiable"]):
        line = combination_in_words(one, found.actuator.axes)
        assert line.startswith(f"{said['combination']} = ")
        assert all(line in text for text in told.values()), line
        low, high = said["interval90"]
        assert low < said["value"] < high
    phrases = between(found.k, found.uncertainty.interval90, found.actuator)
    for who, text in told.items():
        for phrase in phrases:
            text = text.replace(phrase, "")
        assert unsure(text, document["identifiable"]) == [], who


def test_what_is_known_only_together_holds_the_truth():
    """The play is the file's times 1 + 99 k2; both may be anything, their product was put in."""
    found = identified()
    truth = found.actuator.transmission.backlash_rad * (1.0 + 99.0 * 0.3)
    [play] = [one for one in found.uncertainty.identifiable if "k2" in one.powers]
    low, high = play.interval90
    assert play.powers == {"k2": 1, "transmission.backlash_rad": 1} and low <= truth <= high
    assert np.log(high / low) < 0.1
