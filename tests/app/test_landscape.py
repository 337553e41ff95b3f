"""The cost around an answer: slices, ways, the figure and the words."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.errors import InputError
from ema_model.faults import HEALTHY, vector
from ema_model.identification.run import landscape_words, way_sentences
from ema_model.identification.search import Landscape, Way, extent, slices, ways
from ema_model.identification.uncertainty import Suggestion
from ema_model.simulation.run import run_in_words
from emaviz.figures import identification
from emaviz.text.verdicts import sure_words

TRUTH = vector({"k1": 0.3, "k6": 0.4})


def bowl(k):
    """A cost with its least at TRUTH and a ridge at k2 = 0.5."""
    k = np.atleast_2d(k)
    away = k - TRUTH
    away[:, 6] -= np.round(away[:, 6])
    return np.sqrt(np.sum(away**2, axis=1)) + np.where(np.abs(k[:, 1] - 0.5) < 0.05, 1.0, 0.0) + 0.1


def whole(*arguments, **options):
    return list(slices(bowl, *arguments, **options))


def test_a_slice_is_the_cost_over_two_k_and_grows_to_the_whole():
    through = vector({"k1": 0.9, "k3": 0.2, "k6": 0.1})
    parts = whole(through, 0, 5, points=9)
    assert [part.rows for part in parts] == sorted({part.rows for part in parts}) and parts[-1].share == 1.0
    assert np.all(np.isnan(parts[0].error_A[parts[0].rows :])) and np.all(np.isfinite(parts[-1].error_A))
    last = parts[-1]
    for row, column in ((0, 0), (3, 7), (8, 8)):
        k = through.copy()
        k[0], k[5] = last.across[column], last.upwards[row]
        assert last.error_A[row, column] == pytest.approx(bowl(k)[0])
    row, column = np.unravel_index(np.argmin(last.error_A), last.error_A.shape)
    assert abs(last.across[column] - 0.3) <= 0.0625 and abs(last.upwards[row] - 0.4) <= 0.0625


def test_a_model_that_diverges_is_a_gap():
    def diverging(k):
        return np.where(k[:, 0] > 0.5, np.inf, 1.0)

    last = list(slices(diverging, HEALTHY, 0, 1, points=5))[-1]
    assert np.isnan(last.error_A[:, 3:]).all() and np.isfinite(last.error_A[:, :3]).all()


@pytest.mark.parametrize("pair", [(1, 1), (0, 8), (-1, 2)])
def test_two_different_k_are_needed(pair):
    with pytest.raises(InputError, match="two different"):
        whole(TRUTH, *pair)


def test_a_close_up_holds_the_answer_and_stays_inside():
    interval = np.tile([0.0, 0.02], (8, 1))
    assert extent(TRUTH, 0) == (0.0, 1.0)
    low, high = extent(TRUTH, 0, interval, close=True)
    assert low < 0.3 < high and high - low == pytest.approx(0.12)
    low, high = extent(TRUTH, 1, interval, close=True)
    assert low == 0.0 and high == pytest.approx(0.12)
    assert extent(TRUTH, 1, np.tile([0.0, 1.0], (8, 1)), close=True) == (0.0, 1.0)


def test_a_trap_has_a_ridge_before_the_answer():
    far, near = TRUTH.copy(), TRUTH.copy()
    far[1], near[0] = 0.9, 0.8
    found = ways(bowl, {"ssa": far, "do": near, "hba": TRUTH}, TRUTH)
    assert found["ssa"].is_trap and not found["do"].is_trap and found["do"].is_worse and not found["hba"].is_worse
    first, second, third = way_sentences(found)
    assert "local minimum" in first and "had not converged" in second and "ended at the answer" in third
    assert "has the answer: a fit went on" in way_sentences(found, "do")[1], "its own fit has led there"


def test_a_way_goes_the_short_way_round_the_angle():
    start, stop = vector({"k6": 0.4, "k7": 0.95}), vector({"k6": 0.4, "k7": 0.05})
    seen = []

    def watching(k):
        seen.append(k[:, 6])
        return np.ones(len(k))

    ways(watching, {"do": start}, stop)
    assert np.all((seen[0] >= 0.94) | (seen[0] <= 0.06))
    assert Way(1.0, 1.0, 1.0).is_worse is False


def test_the_map_has_units_marks_and_a_box():
    found = whole(TRUTH, 0, 5, points=9)[-1]
    interval = np.stack([TRUTH - 0.05, TRUTH + 0.05], axis=1)
    drawn = identification.landscape_figure(found, identification.Marks(TRUTH, interval, TRUTH, {"do": HEALTHY}))
    assert "k1" in drawn.layout.xaxis.title.text and "[–]" in drawn.layout.yaxis.title.text
    assert drawn.data[0].colorbar.title.text == "corrected error [A]"
    assert [trace.name for trace in drawn.data[1:]] == ["Dandelion ended", "truth", "answer, 90 %"]
    (box,) = drawn.layout.shapes
    assert (box.x0, box.x1, box.y0, box.y1) == pytest.approx((0.25, 0.35, 0.35, 0.45))
    assert landscape_words(found).startswith(
        "Held: k2 0.000, k3 0.000, k4 0.000, k5 0.000, k7 0.500, k8 0.500. Corrected error from "
    )
    half = whole(TRUTH, 0, 5, points=9)[1]
    assert landscape_words(half).startswith("Stopped at 44 %. Held: k2")
    empty = Landscape(0, 5, TRUTH, np.linspace(0, 1, 3), np.linspace(0, 1, 3), np.full((3, 3), np.nan), 0)
    identification.landscape_figure(empty, identification.Marks(TRUTH))


@pytest.mark.parametrize("low, high", [(0.1, 3.0), (1e-9, 1e6), (0.31, 0.33), (5.0, 5.0)])
def test_a_scale_of_logarithms_has_a_few_round_values(low, high):
    ticks = identification.round_values(low, high)
    assert 2 <= len(ticks) <= 8 and all(a <= b for a, b in itertools.pairwise(ticks))


# --- words ------------------------------------------------------------------------------------------------------------


def answer(**known):
    usual = {
        "healthy": False,
        "alarms": (),
        "ambiguous": (),
        "adequate": True,
        "warnings": (),
        "separated_by": None,
        "hardly_known": (),
        "identifiable": (),
        "uninformative": False,
    }
    return SimpleNamespace(uncertainty=SimpleNamespace(**{**usual, **known}), polished=True)


def test_a_run_is_told_in_words():
    chirp = Suggestion("chirp", {"amplitude_rad": 0.02, "end_Hz": 12.0}, 0.5, 2.0)
    assert (
        run_in_words(chirp.command, chirp.settings, chirp.duration_s)
        == "a chirp with amplitude 0.02 rad, end 12 Hz, for 0.5 s"
    )
    assert chirp.options == "--command chirp --set amplitude_rad=0.02 --set end_Hz=12 --duration 0.5"


def test_what_cannot_be_told_apart_is_named_with_what_would():
    said = sure_words(
        answer(
            alarms=("k1",), ambiguous=(("k1", "k8"),), separated_by=Suggestion("step", {"final_rad": 0.005}, 0.5, 2.0)
        )
    )
    assert "k1 friction" in said and "k1 (friction) and k8 (proportional gain)" in said
    assert "a step with final 0.005 rad" in said
    assert "Healthy" in sure_words(answer(healthy=True)) and sure_words(None) == ""
    misfit = sure_words(answer(adequate=False, warnings=("The model <b>does not</b> fit.",)))
    assert "The model does not fit" in misfit
    assert "does not fit" in misfit and "<b>does not</b>" not in misfit
