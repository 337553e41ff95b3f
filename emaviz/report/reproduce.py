"""The report of the thesis's evaluation beside ours: its sections in reading order, and the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

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
    Point,
    case_of,
)
from ema_model.campaign.thesis_words import NAMES, NONE, answer, coefficient_table, number, row_table, short_table
from ema_model.quantities.axes import of_signal
from ema_model.quantities.titles import in_sentence
from emaviz.figures import campaign, comparison
from emaviz.figures.campaign import SearchEffort
from emaviz.report.campaign import Effort, Errors, Progress, Rows
from emaviz.report.html_document import Figures, Section, folded, page, pair, paragraph, table, write


@dataclass
class Reproduced:
    """The evaluation, and the responses that the thesis draws."""

    evaluation: Evaluation
    drawn: Drawn
    rows: Rows = field(init=False)

    def __post_init__(self) -> None:
        self.rows = Rows(self.evaluation.store)


# --- the answer, and a line for each actuator -------------------------------------------------------------------------


class Answer(Section[Reproduced]):
    """In words, in numbers, and as figure 5.2 has it."""

    title = "Answer"
    anchor = "answer"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        of = subject.evaluation
        first, *more = answer(of)
        told = paragraph(first, "answer") + "".join(paragraph(one) for one in more)
        heads, lines = short_table(of)
        if not lines:
            return told
        ours, theirs = {}, {}
        for one in of.scores:
            if one.error.count:
                ours.setdefault(one.algorithm, {})[one.case.title] = one.error.mean
                if one.printed is not None:
                    theirs.setdefault(one.algorithm, {})[one.case.title] = one.printed.mean
        drawn = campaign.errors_beside("Mean error of each actuator (figure 5.2)", ours, theirs, NAMES)
        note = "Mean Err in % (T 5.2 as printed): the thesis's ten runs, and ours, by algorithm."
        rows = len({one.case.name for one in of.scores if one.error.count})
        return told + paragraph(note, "small") + table(heads, lines) + figures.place(drawn, 150 + 32 * rows)


# --- tables 5.1–5.38, row by row --------------------------------------------------------------------------------------


class RowByRow(Section[Reproduced]):
    """Every actuator and algorithm."""

    title = "Row by row"
    anchor = "rows"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there: the thesis's rows are."""
        told = (
            "Mean ± standard deviation over the runs. Err is T 5.2 as printed, which takes k7 as a number; beside it, "
            "k7 is the angle that it is. The difference is ours − the thesis's. Times are by the clock, of different "
            "computers; ours of one core a search, and longer where others used the machine."
        )
        heads, lines = row_table(subject.evaluation)
        return paragraph(told) + table(heads, lines, text_columns=2)


# --- tables 5.39–5.43 -------------------------------------------------------------------------------------------------


class Coefficients(Section[Reproduced]):
    """A line a fault and algorithm."""

    title = "Performance coefficients"
    anchor = "coefficients"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where no fault has been computed with all three algorithms."""
        heads, lines = coefficient_table(subject.evaluation)
        if not lines:
            return ""
        told = (
            "PC = 100 (1 − Err·t / Σ Err·t) over the three algorithms (T 5.4), errors and times of low and high "
            "averaged first, as the thesis does. It compares algorithms of one computer, and is blind to how good all "
            "three are."
        )
        return paragraph(told) + table(heads, lines, text_columns=2)


# --- what of the error is the search's, and what the model's ----------------------------------------------------------


class ModelBias(Section[Reproduced]):
    """The k that tells each fault, and the same searches with another fitness."""

    title = "Search or model?"
    anchor = "bias"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was computed."""
        of = subject.evaluation
        if not any(one.error.count for one in of.scores):
            return ""
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
        return paragraph(told) + table(heads, lines) + self._missed(subject) + self._filtered(subject)

    def _missed(self, subject: Reproduced) -> str:
        heads = ["", "Thesis: missed", "Err % of the others", "Ours: missed", "Err % of the others"]
        lines = [
            [
                NAMES[one.algorithm],
                f"{one.printed_missed} of {one.printed_count}" if one.printed_count else NONE,
                number(one.printed_error_of_others),
                f"{one.missed} of {one.count}",
                number(one.error_of_others, 2 if one.algorithm in ALGORITHMS else 3),
            ]
            for one in subject.evaluation.missed
        ]
        told = (
            f"Runs whose Err is above {MISSED_PERCENT:g} % have ended in a minimum that is not the fault's; that part "
            "is the search's, and few of them make the mean."
        )
        return paragraph(told) + table(heads, lines)

    def _filtered(self, subject: Reproduced) -> str:
        found = subject.evaluation.fitness_compared()
        if not found:
            return ""
        heads = ["Mean Err %", "thesis", "every sample, the thesis's circuit", "means, equivalent circuit"]
        told = (
            "The same searches on the same actuators, with the fitness on means over 0.5 ms, which takes out the "
            "chopping ripple, and the circuit that is the phases' equivalent:"
        )
        return paragraph(told) + table(heads, [[NAMES[name], *map(number, means)] for name, means in found.items()])


# --- where this is not the thesis's own evaluation --------------------------------------------------------------------


class Deviations(Section[Reproduced]):
    """A line each."""

    title = "Where this deviates from the thesis, and why"
    anchor = "deviations"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        lines = [[one.what, one.thesis, one.here, one.why] for one in DEVIATIONS]
        return table(["What", "Thesis", "Here", "Why"], lines, text_columns=4)


# --- figure 5.4: how the searches converge ----------------------------------------------------------------------------


class Convergence(Section[Reproduced]):
    """Several faults at once, as in the thesis; the other actuators folded."""

    title = "Convergence (figure 5.4)"
    anchor = "convergence"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was searched."""
        shown = [case for case in CASES if self._histories(subject, case.name, "rmse_history_A")]
        if not shown:
            return ""
        first = next((case for case in shown if case.name == MULTIPLE), shown[0])
        ends = [one[-1] for its in self._histories(subject, first.name, "rmse_history_A").values() for one in its]
        told = (
            f"{first.title}: the best so far, with the thesis's fitness. The best of all searches ends at "
            f"{min(ends):.3g} A, which is what chopping leaves between the two models: from there on the RMSE tells "
            "hardly anything of the error."
        )
        others = "".join(self._drawn(subject, case, figures) for case in shown if case is not first)
        return (
            paragraph(told)
            + self._drawn(subject, first, figures)
            + (folded("The other actuators", others) if others else "")
        )

    def _drawn(self, subject: Reproduced, case: Case, figures: Figures) -> str:
        """RMSE, and the error that the thesis does not draw."""
        rmse, error = (
            self._histories(subject, case.name, what) for what in ("rmse_history_A", "error_history_percent")
        )
        return pair(
            figures.place(campaign.convergence_bands(rmse, title=case.title, names=NAMES), 340),
            figures.place(campaign.convergence_bands(error, title="Its error", y="Err [%]", names=NAMES), 340),
        )

    def _histories(self, subject: Reproduced, case: str, what: str) -> dict[str, list[list[float]]]:
        found: dict[str, list[list[float]]] = {}
        for name in ALGORITHMS:
            for row in subject.evaluation.of(AS_THE_THESIS):
                known = case_of(row["k_true"])
                if row["algorithm"] == name and known is not None and known.name == case:
                    found.setdefault(name, []).append(row[what])
        return found


# --- what chapter 6 asks for: error against population, iterations and evaluations, and when to stop ------------------


class TradeOff(Section[Reproduced]):
    """Figures by actuator, and a table of stops."""

    title = "How much search an answer takes (chapter 6)"
    anchor = "effort"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Left out where nothing was searched."""
        return self._stops(subject) + self._effort(subject, figures)

    def _stops(self, subject: Reproduced) -> str:
        stops = subject.evaluation.stops
        if not stops:
            return ""
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
        return paragraph(told) + table(heads, lines)

    def _effort(self, subject: Reproduced, figures: Figures) -> str:
        every = subject.evaluation.points
        parts = []
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
            parts.append(paragraph(f"{title}: {several if points[0].count > 1 else 'Err of one search each'}."))
            parts.append(
                pair(
                    _placed(figures, f"{usual_t} iterations", "Population", by_n, lambda one: one.population),
                    _placed(figures, f"Population of {usual_n}", "Iterations", by_t, lambda one: one.iterations),
                )
            )
            parts.append(
                _placed(figures, "All of them", "Evaluations", points, lambda one: one.evaluations, joined=False)
            )
        return "".join(parts)


def _placed(
    figures: Figures, title: str, x: str, points: list[Point], at: Callable[[Point], float], *, joined: bool = True
) -> str:
    found = {
        name: [
            SearchEffort(at(one), one.low_percent, one.error_percent, one.high_percent)
            for one in points
            if one.algorithm == name
        ]
        for name in ALGORITHMS
    }
    drawn = campaign.search_effort(title, x, {n: its for n, its in found.items() if its}, NAMES, joined=joined)
    return figures.place(drawn, 320)


# --- figures 3.17–3.24: the Reference Model against the Monitor Model -------------------------------------------------

_SIGNALS = {  # the thesis's figures: the signal, and its error
    "motor_position_rad": "3.17, 3.18",
    "user_position_rad": "3.19, 3.20",
    "motor_speed_rad_s": "3.21, 3.22",
    "current_A": "3.23, 3.24",
}


class Models(Section[Reproduced]):
    """Four signals, healthy and faulty."""

    title = "Reference against monitor model (figures 3.17–3.24)"
    anchor = "models"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        axes = subject.drawn.actuator.axes
        parts = []
        for one in subject.drawn.pairs:
            told = []
            for name in _SIGNALS:
                whole = of_signal(name, axes)
                rms = one.rms_difference(name)
                told.append(f"{in_sentence(whole.title)} {whole.scaled(rms).text(rms)}")
            parts.append(
                paragraph(f"{one.title}, on the chirp, at 10 kHz; rms of monitor − reference: {', '.join(told)}.")
            )
            drawn = [
                figures.place(
                    comparison.model_pair(
                        f"{of_signal(name, axes).title}, {in_sentence(one.title)}"
                        + (f" ({number})" if one.name == "healthy" else ""),
                        one.reference,
                        one.monitor,
                        name,
                        axes=axes,
                    ),
                    340,
                )
                for name, number in _SIGNALS.items()
            ]
            parts += [pair(*drawn[at : at + 2]) for at in range(0, len(drawn), 2)]
        return "".join(parts)


# --- figures 3.27–3.70: what five severities of each fault do to a step and to a chirp --------------------------------


class Severities(Section[Reproduced]):
    """A part a fault: the chirp open, the step folded."""

    title = "Severities of each fault (figures 3.27–3.70)"
    anchor = "severities"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        axes = subject.drawn.actuator.axes
        parts = [paragraph("The reference model, on a step of 1 rad at 10 ms and on the chirp.")]
        for family in FAMILIES:
            parts.append(f"<h3>{family.title} (figures {family.figures})</h3>")
            for run in ("chirp", "step"):
                runs = subject.drawn.families[family.name, run]
                drawn = [
                    figures.place(
                        campaign.responses(
                            f"{of_signal(name, axes).title}, {in_sentence(family.title)}, {run}",
                            runs,
                            name,
                            with_command=name.startswith("user_position"),
                            axes=axes,
                        ),
                        320,
                    )
                    for name in SIGNALS
                ]
                whole = pair(*drawn[:2]) + drawn[2]
                parts.append(whole if run == "chirp" else folded(f"{family.title}, step", whole))
        return "".join(parts)


# --- what was computed, with which version, in how much time, and what failed -----------------------------------------


class HowMade(Section[Reproduced]):
    """As a campaign's own report has it."""

    title = "How it was made"
    anchor = "made"

    def body(self, subject: Reproduced, figures: Figures) -> str:
        """Always there."""
        return "".join(part.body(subject.rows, figures) for part in (Progress(), Errors(), Effort()))


# --- the report of the thesis's evaluation, section by section --------------------------------------------------------

SECTIONS: tuple[Section[Reproduced], ...] = (
    Answer(),
    RowByRow(),
    Coefficients(),
    ModelBias(),
    Deviations(),
    Convergence(),
    TradeOff(),
    Models(),
    Severities(),
    HowMade(),
)


def write_reproduction_report(evaluation: Evaluation, drawn: Drawn, path: str | Path) -> None:
    """Writes one HTML file that opens offline, whole or not at all; InputError where it cannot be written."""
    header = evaluation.store.header
    write(path, page(header.title, header.about, SECTIONS, Reproduced(evaluation, drawn)))
