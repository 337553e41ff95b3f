"""The thesis's evaluation beside ours: its tables, where it deviates, convergence, responses, how it was made."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import plotly.graph_objects as go

from ema_model.campaign.thesis import (
    ALGORITHMS,
    AS_THE_THESIS,
    CASES,
    DEVIATIONS,
    FAMILIES,
    MISSED_PERCENT,
    MULTIPLE,
    SIGNALS,
    STOP_A,
    Case,
    Drawn,
    Evaluation,
    Family,
    Point,
    case_of,
)
from ema_model.campaign.thesis_words import NAMES, NONE, answer, coefficient_table, number, row_table, short_table
from ema_model.quantities import in_sentence, of_signal
from emaviz.figures import campaign, comparison
from emaviz.figures.campaign import SearchEffort
from emaviz.views import Columns, Group, Line, Piece, Row, Section, View
from emaviz.views.campaign import effort, errors, pairs, tasks


def _answer(of: Evaluation) -> Iterator[Piece]:
    """In words, in numbers, and as figure 5.2 has it."""
    first, *more = answer(of)
    yield Line(first, "answer")
    yield from map(Line, more)
    heads, lines = short_table(of)
    if not lines:
        return
    ours, theirs = {}, {}
    for one in of.scores:
        if one.error.count:
            ours.setdefault(one.algorithm, {})[one.case.title] = one.error.mean
            if one.printed is not None:
                theirs.setdefault(one.algorithm, {})[one.case.title] = one.printed.mean
    yield Line("Mean Err in % (T 5.2 as printed): the thesis's ten runs, and ours, by algorithm.", "small")
    yield Columns(heads, lines, 1)
    drawn = campaign.errors_beside("Mean error of each actuator (figure 5.2)", ours, theirs, NAMES)
    yield Row([drawn], 150 + 32 * len({one.case.name for one in of.scores if one.error.count}))


def _rows(of: Evaluation) -> Iterator[Piece]:
    """Every actuator and algorithm (tables 5.1–5.38)."""
    told = (
        "Mean ± standard deviation over the runs. Err is T 5.2 as printed, which takes k7 as a number; beside it, "
        "k7 is the angle that it is. The difference is ours − the thesis's. Times are by the clock, of different "
        "computers; ours of one core a search, and longer where others used the machine."
    )
    heads, lines = row_table(of)
    yield Line(told)
    yield Columns(heads, lines)


def _coefficients(of: Evaluation) -> Iterator[Piece]:
    """A line a fault and algorithm (tables 5.39–5.43); none where no fault has been computed with all three."""
    heads, lines = coefficient_table(of)
    if not lines:
        return
    told = (
        "PC = 100 (1 − Err·t / Σ Err·t) over the three algorithms (T 5.4), errors and times of low and high "
        "averaged first, as the thesis does. It compares algorithms of one computer, and is blind to how good all "
        "three are."
    )
    yield Line(told)
    yield Columns(heads, lines)


def _bias(of: Evaluation) -> Iterator[Piece]:
    """What of the error is the search's, and what the model's: the k that tells each fault, and another fitness."""
    if not any(one.error.count for one in of.scores):
        return
    heads = ["Median of the runs", "true"]
    for name in NAMES:
        heads += [f"{NAMES[name]}, thesis", NAMES[name]] if name in ALGORITHMS else [NAMES[name]]
    lines = []
    for case in CASES:
        own = {one.algorithm: one for one in of.scores if one.case is case}
        if not any(one.error.count for one in own.values()):
            continue
        line = [f"{case.main}: {case.title}", f"{case.k[int(case.main[1:]) - 1]:g}"]
        for name in NAMES:
            one = own.get(name)
            k = NONE if one is None else number(one.k, 3)
            line += [number(None if one is None else one.printed_k, 3), k] if name in ALGORITHMS else [k]
        lines.append(line)
    told = (
        "Where three different searches agree on a wrong value, no search is to blame: that part of the error is "
        "the monitor model's and the fitness's, and more iterations do not take it away."
    )
    yield Line(told)
    yield Columns(heads, lines, 1)
    yield from _missed(of)
    yield from _filtered(of)


def _missed(of: Evaluation) -> Iterator[Piece]:
    heads = ["", "Thesis: missed", "Err % of the others", "Ours: missed", "Err % of the others"]
    lines = [
        [
            NAMES[one.algorithm],
            f"{one.printed_missed} of {one.printed_count}" if one.printed_count else NONE,
            number(one.printed_error_of_others),
            f"{one.missed} of {one.count}",
            number(one.error_of_others, 2 if one.algorithm in ALGORITHMS else 3),
        ]
        for one in of.missed
    ]
    told = (
        f"Runs whose Err is above {MISSED_PERCENT:g} % have ended in a minimum that is not the fault's; that part "
        "is the search's, and few of them make the mean."
    )
    yield Line(told)
    yield Columns(heads, lines, 1)


def _filtered(of: Evaluation) -> Iterator[Piece]:
    found = of.fitness_compared()
    if not found:
        return
    heads = ["Mean Err %", "thesis", "every sample, the thesis's circuit", "means, equivalent circuit"]
    told = (
        "The same searches on the same actuators, with the fitness on means over 0.5 ms, which takes out the "
        "chopping ripple, and the circuit that is the phases' equivalent:"
    )
    yield Line(told)
    yield Columns(heads, [[NAMES[name], *map(number, means)] for name, means in found.items()], 1)


def _deviations(of: Evaluation) -> Iterator[Piece]:
    """Where this is not the thesis's own evaluation, a line each."""
    lines = [[one.what, one.thesis, one.here, one.why] for one in DEVIATIONS]
    yield Columns(["What", "Thesis", "Here", "Why"], lines, 4)


# --- figure 5.4: how the searches converge; several faults at once, as in the thesis, the other actuators folded ------


def _convergence(of: Evaluation) -> Iterator[Piece]:
    """None where nothing was searched."""
    shown = [case for case in CASES if _histories(of, case.name, "rmse_history_A")]
    if not shown:
        return
    first = next((case for case in shown if case.name == MULTIPLE), shown[0])
    ends = [one[-1] for its in _histories(of, first.name, "rmse_history_A").values() for one in its]
    told = (
        f"{first.title}: the best so far, with the thesis's fitness. The best of all searches ends at "
        f"{min(ends):.3g} A, which is what chopping leaves between the two models: from there on the RMSE tells "
        "hardly anything of the error."
    )
    yield Line(told)
    yield _drawn(of, first)
    if others := [_drawn(of, case) for case in shown if case is not first]:
        yield Group("The other actuators", others, folded=True)


def _drawn(of: Evaluation, case: Case) -> Row:
    """RMSE, and the error that the thesis does not draw."""
    rmse, error = (_histories(of, case.name, what) for what in ("rmse_history_A", "error_history_percent"))
    return Row(
        [
            campaign.convergence_bands(rmse, title=case.title, names=NAMES),
            campaign.convergence_bands(error, title="Its error", y="Err [%]", names=NAMES),
        ],
        340,
    )


def _histories(of: Evaluation, case: str, what: str) -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = {}
    for name in ALGORITHMS:
        for row in of.of(AS_THE_THESIS):
            known = case_of(row["k_true"])
            if row["algorithm"] == name and known is not None and known.name == case:
                found.setdefault(name, []).append(row[what])
    return found


# --- what chapter 6 asks for: error against population, iterations and evaluations, and when to stop ------------------


def _trade_off(of: Evaluation) -> Iterator[Piece]:
    """A table of stops, and figures by actuator."""
    if stops := of.stops:
        reached, count = (sum(getattr(one, what) for one in stops) for what in ("reached", "count"))
        told = (
            f"The thesis's stop at an RMSE of {STOP_A:g} A: {reached} of {count} searches reached it; the lowest RMSE "
            f"of any was {min(one.least_A for one in stops):.3g} A. When each could have ended, by its RMSE falling no "
            "more:"
        )
        heads = [
            "",
            "searches",
            "within 1 % from iteration (median)",
            "95 % of them by",
            "Err % there",
            "Err % at the end",
        ]
        lines = [
            [NAMES[one.algorithm], one.count, f"{one.settled:.0f}", f"{one.settled_high:.0f}",
             number(one.error_settled_percent), number(one.error_percent)]
            for one in stops
        ]  # fmt: skip
        yield Line(told)
        yield Columns(heads, lines, 1)
    every = of.points
    for case in dict.fromkeys(one.case.name for one in every):
        points = [one for one in every if one.case.name == case]
        populations, iterations = ({getattr(one, of) for one in points} for of in ("population", "iterations"))
        usual_n, usual_t = (
            (50 if 50 in populations else max(populations)),
            (150 if 150 in iterations else max(iterations)),
        )
        title = points[0].case.title
        by_n = [one for one in points if one.iterations == usual_t]
        by_t = [one for one in points if one.population == usual_n]
        several = f"median Err of {points[0].count} searches each, with 5 to 95 %"
        yield Line(f"{title}: {several if points[0].count > 1 else 'Err of one search each'}.")
        yield Row(
            [
                _effort(f"{usual_t} iterations", "Population", by_n, lambda one: one.population),
                _effort(f"Population of {usual_n}", "Iterations", by_t, lambda one: one.iterations),
            ]
        )
        yield Row([_effort("All of them", "Evaluations", points, lambda one: one.evaluations, joined=False)])


def _effort(title: str, x: str, points: list[Point], at: Callable[[Point], float], *, joined: bool = True) -> go.Figure:
    found = {
        name: [
            SearchEffort(at(one), one.low_percent, one.error_percent, one.high_percent)
            for one in points
            if one.algorithm == name
        ]
        for name in ALGORITHMS
    }
    return campaign.search_effort(title, x, {n: its for n, its in found.items() if its}, NAMES, joined=joined)


# --- figures 3.17–3.24: the Reference Model against the Monitor Model -------------------------------------------------

_SIGNALS = {  # the thesis's figures: the signal, and its error
    "motor_position_rad": "3.17, 3.18",
    "user_position_rad": "3.19, 3.20",
    "motor_speed_rad_s": "3.21, 3.22",
    "current_A": "3.23, 3.24",
}


def _models(of: Evaluation) -> Iterator[Piece]:
    """Four signals, healthy and faulty."""
    if of.drawn is None:
        return
    axes = of.drawn.actuator.axes
    for one in of.drawn.pairs:
        told = []
        for name in _SIGNALS:
            whole = of_signal(name, axes)
            rms = one.rms_difference(name)
            told.append(f"{in_sentence(whole.title)} {whole.scaled(rms).text(rms)}")
        yield Line(f"{one.title}, on the chirp, at 10 kHz; rms of monitor − reference: {', '.join(told)}.")
        drawn = [
            comparison.model_pair(
                f"{of_signal(name, axes).title}, {in_sentence(one.title)}"
                + (f" ({number})" if one.name == "healthy" else ""),
                one.reference,
                one.monitor,
                name,
                axes=axes,
            )
            for name, number in _SIGNALS.items()
        ]
        yield from pairs(drawn, 340)


# --- figures 3.27–3.70: what five severities of each fault do to a step and to a chirp --------------------------------


def _severities(of: Evaluation) -> Iterator[Piece]:
    """A part a fault: the chirp open, the step folded."""
    if of.drawn is None:
        return
    yield Line("The reference model, on a step of 1 rad at 10 ms and on the chirp.")
    for family in FAMILIES:
        chirp, step = ([*_responses(of.drawn, family, run)] for run in ("chirp", "step"))
        folded = Group(f"{family.title}, step", step, folded=True)
        yield Group(f"{family.title} (figures {family.figures})", [*chirp, folded])


def _responses(drawn: Drawn, family: Family, run: str) -> Iterator[Row]:
    axes = drawn.actuator.axes
    every = [
        campaign.responses(
            f"{of_signal(name, axes).title}, {in_sentence(family.title)}, {run}",
            drawn.families[family.name, run],
            name,
            with_command=name.startswith("user_position"),
            axes=axes,
        )
        for name in SIGNALS
    ]
    yield Row(every[:2])
    yield Row(every[2:])


def _made(of: Evaluation) -> Iterator[Piece]:
    """As a campaign's own report has it."""
    for part in (tasks, errors, effort):
        yield from part(of.campaign)


def _record(of: Evaluation, path: Path, configuration: Mapping[str, Any]) -> None:
    """Tables, convergence and responses."""
    from emaviz.recording.reproduce import write_reproduction  # rerun takes a second to import

    write_reproduction(of, path)


VIEW = View(
    of=Evaluation,
    name="reproduce",
    title=lambda of: of.store.header.title,
    lead=lambda of: of.store.header.about,
    sections=(
        Section("Answer", "answer", of=_answer),
        Section("Row by row", "rows", of=_rows),
        Section("Performance coefficients", "coefficients", of=_coefficients),
        Section("Search or model?", "bias", of=_bias),
        Section("Where this deviates from the thesis, and why", "deviations", of=_deviations),
        Section("Convergence (figure 5.4)", "convergence", of=_convergence),
        Section("How much search an answer takes (chapter 6)", "effort", of=_trade_off),
        Section("Reference against monitor model (figures 3.17–3.24)", "models", of=_models),
        Section("Severities of each fault (figures 3.27–3.70)", "severities", of=_severities),
        Section("How it was made", "made", of=_made),
    ),
    meaning=lambda of: "good" if any(one.error.count for one in of.scores) else "open",
    record=_record,
)
