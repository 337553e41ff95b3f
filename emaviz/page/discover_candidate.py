"""A candidate: its card, its effect with sliders, and a law of one's own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.actuator import Actuator
from ema_model.discovery import Candidate
from ema_model.discovery.snapshot import Look, user_begins
from ema_model.discovery.words import effect_title, in_percent, page_of, size
from ema_model.discovery.words import typical as typical_fault
from ema_model.discovery.words import value as as_fitted
from ema_model.effects import Effect, find
from ema_model.effects.effect import FAMILIES
from ema_model.effects.user import UserEffect, user_torque
from ema_model.effects.user.expression import FUNCTIONS, VARIABLES, Size
from ema_model.effects.user.torque import RANGE
from ema_model.errors import InputError
from ema_model.estimation import Calibrated
from ema_model.estimation.calibrate import within
from ema_model.faults import BY_NAME
from ema_model.quantities import Quantity, amount, in_sentence, number
from ema_model.quantities import number as shown
from ema_model.text import COLOURS
from emaviz.figures import discovery
from emaviz.page.style import unseen
from emaviz.page.window_layout import NEXT_COLUMN
from emaviz.page.workspaces import Page
from emaviz.server.viser_private import id_of
from emaviz.session.discover import Discovering, Preview, Typed, typed
from emaviz.session.settings import number as setting_number
from emaviz.text.html import BOX, WAITS, Html, add_html, boxed, explained, html, joined, mathml, note, unescaped

# --- texts and styles of the Discover tab's cards: what each candidate would do, in one glance ------------------------

_CARD = (
    "height:auto!important;min-height:2em;padding:5px 9px;font-weight:400;font-size:12.5px;"
    "background-color:rgba(134,142,150,.10)!important;color:inherit!important;"
)
_LABEL = "display:block;height:auto;overflow:visible;white-space:pre-line;text-align:left;line-height:1.35;width:100%"
_BAR = "rgba(240,140,0,.28)"


def label(look: Look, one: Candidate) -> str:
    """The lines of a card; its first is the effect's or fault's name."""
    title = effect_title(one.name)
    if one.obstacle:
        return title
    lines = [title]
    if look.is_worth(one):
        lines.append(fall(look, one))
        lines += [strength(look, one), confidence(look, one)]
        same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
        if same:
            lines.append("≈ same as " + ", ".join(in_sentence(effect_title(name)) for name in same))
    return "\n".join(lines)


def fall(look: Look, one: Candidate) -> str:
    """'error 3.47 → ≈ 2.98 × floor'."""
    before, after = number(look.rmse), number(look.predicted_rmse(one))
    if before == after:
        return "explains a part, but hardly reduces the error by itself"
    known = look.assessment is not None and one.name in look.assessment.refitted
    return f"error {before} → {after} × floor, refitted" if known else f"error {before} → ≈ {after} × floor"


def strength(look: Look, one: Candidate) -> str:
    """'amplitude 20.4 ± 0.8 mN·m, order 14', as the residual suggests it; of a fault its size."""
    if one.name in BY_NAME:
        return size(one, look.found.actuator)
    first = find(one.name, look.found.actuator.axes).parameters[0]
    value, half = one.settings[first.name], look.uncertainty(one)
    shown = amount(value, first.unit)
    if half is not None:
        ends, cut = within(value, half, (first.low, first.high))
        shown = as_fitted(Calibrated(value, value, ends, first.unit, 0.0, False, cut=cut))
    told = f"{in_sentence(first.title)} {shown}"
    order = one.settings.get("order")
    return told if order is None else f"{told}, order {order:g}"


def confidence(look: Look, one: Candidate) -> str:
    """How probable it is that this is missing, and what it would take: '97 % probable, 62 % of the squared error'."""
    return f"{in_percent(look.probability(one))} probable, {share(look, one)}"


def share(look: Look, one: Candidate) -> str:
    """'62 % of the squared error'."""
    return f"{100.0 * look.share(one):.0f} % of the squared error"


def style(look: Look | None, shown: Sequence[tuple[str, Candidate | None]], opened: str | None) -> Html:
    """viser's buttons have one line and one colour; these become cards.  shown: (the button's id, its candidate)."""
    rules = []
    for uuid, one in shown:
        if one is None or look is None:
            continue
        button = f'[id="{uuid}"]'
        worth = look.is_worth(one)
        wide = 100.0 * look.probability(one) if worth else 0.0
        bar = f"background-image:linear-gradient(to right,{_BAR} {wide:.1f}%,transparent {wide:.1f}%)!important;"
        edge = "#f08c00" if one.name == opened else "rgba(134,142,150,.5)" if worth else "rgba(134,142,150,.25)"
        grey = "opacity:.55;" if one.obstacle else ""
        rules.append(f"{button}{{{_CARD}{bar}{grey}border-left:3px solid {edge}}}")
        rules.append(f"{button} .mantine-Button-inner{{justify-content:flex-start}}")
        rules.append(f"{button} .mantine-Button-label{{{_LABEL}}}{button} .mantine-Button-label::first-line")
        rules.append("{font-weight:600;font-size:13.5px}")
    return unescaped(f"<style>{''.join(rules)}</style>")


# --- the candidates that are worth a refit, large, in the order in which they are probable ----------------------------

MOST = 8  # cards
_UNLIKELY = 0.01  # a probability below which another candidate is the next
_BUTTON = (
    "font:inherit;color:inherit;cursor:pointer;border-radius:4px;border:1px solid rgba(134,142,150,.6);background:none;"
)
CARDS = unescaped(
    "<style>.emaviz-cards{padding:0 8px 2px;font-size:13px;line-height:1.4}"
    ".emaviz-card{position:relative;display:grid;grid-template-columns:minmax(0,1fr) minmax(120px,240px);gap:2px 12px;"
    "padding:7px 10px 9px;margin-bottom:7px;border-radius:6px;border:1px solid rgba(134,142,150,.35);"
    "border-left:4px solid rgba(134,142,150,.6);background:rgba(134,142,150,.08)}"
    ".emaviz-card.open{border-left-color:#f08c00}"
    ".emaviz-card header{grid-column:1/-1;display:flex;gap:8px;align-items:baseline;justify-content:space-between}"
    f".emaviz-card header button{{{_BUTTON}border:0;padding:0;font-weight:600;font-size:14.5px;text-align:left}}"
    ".emaviz-card header button:hover{text-decoration:underline}.emaviz-card b{font-weight:600}"
    ".emaviz-card i{grid-column:1/-1;height:4px;border-radius:2px;background:rgba(134,142,150,.25);overflow:hidden}"
    ".emaviz-card i>i{display:block;background:#f08c00}"
    f".emaviz-card .do{{{_BUTTON}padding:2px 12px;margin:5px 6px 0 0}}"
    ".emaviz-card .add{background:var(--mantine-primary-color-filled,#2f6fde);border-color:transparent;color:#fff;"
    "font-weight:600}.emaviz-card button:disabled{opacity:.45;cursor:default}"
    f".emaviz-card .alike{{color:{COLOURS['warning']}}}"
    ".emaviz-sketch{margin:0;display:flex;flex-direction:column;min-width:0}.emaviz-sketch svg{width:100%;height:auto}"
    ".emaviz-sketch span{white-space:nowrap}"
    ".emaviz-sketch small{font-size:11px;line-height:1.25;opacity:.75}"
    "</style>"
)
_PRESS = "window.emavizPress('{}')"
_OPENED = "emaviz-opened"  # the class of what an opened card shows
_SEE = f"setTimeout(()=>document.querySelector('.{_OPENED}')?.scrollIntoView({{block:'center',behavior:'smooth'}}),600)"
_MOVES = Html(
    '<span class="emaviz-job-share" style="display:inline-block;width:60px"><i class="emaviz-job-unknown"></i></span>'
)
_SMALL = "opacity:.8;font-size:12px;padding-bottom:5px"
_LEGEND = html(
    '<div style="opacity:.8;font-size:12px;padding-bottom:5px"><span style="color:{}">●</span> what the model lacks, '
    '<span style="color:{}">━</span> the candidate\'s signature: where they lie together, this is it. Bar: how '
    "probable it is that this, of all candidates, is the next to add, by how well it fits and what that takes, not by "
    "the fall alone. Each addition ranks the others anew.</div>",
    discovery.RESIDUAL,
    discovery.SIGNATURE,
)


class Cards:
    """A folder of the panel on the right: what a click adds, and what it would do."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._look: Look | None = None
        self._opened: str | None = None
        self._sketches: dict[str, Html] = {}  # of this look, by the candidate's name
        self._slots: dict[str, int] = {}  # of the buttons, which a card keeps while refits change its place
        self._running = False
        gui = page.server.gui
        self.folder = gui.add_folder("What may be missing", visible=False)
        with self.folder:
            add_html(gui, NEXT_COLUMN)
            self._all = gui.add_button(
                "Find all",
                icon=viser.Icon.WAND,
                hint="Adds, step by step, every effect and fault that the data support",
            )
            self._cards = add_html(gui)
            self._opens, self._adds = (  # which nobody sees: the cards press them
                [gui.add_button(f"{what} {place + 1}") for place in range(MOST)] for what in ("Open card", "Add card")
            )
            add_html(gui, unseen([id_of(one) for one in (*self._opens, *self._adds)]))

    def connect(self, ask: Callable[[Callable[[], bool], Any, str], None], open_card: Callable[[str], None]) -> None:
        """ask(begin, button, title) starts a step; open_card(name) shows all of a candidate, on the screen's thread."""
        page = self._page
        page.pressed(self._all, lambda: ask(self._discovering.find_all, self._all, ""))

        def add(slot: int) -> None:
            one = self._at(slot)
            if one is not None:
                ask(lambda: self._discovering.add(one.name), self._all, f"Adding {in_sentence(effect_title(one.name))}")

        def show(slot: int) -> None:
            one = self._at(slot)
            if one is not None:
                open_card(one.name)

        for slot, (opens, adds) in enumerate(zip(self._opens, self._adds)):
            page.pressed(opens, partial(show, slot))
            page.pressed(adds, partial(add, slot))

    def busy(self, busy: bool) -> None:
        """Whether a step runs that a click on a card has to wait for."""
        self._running = self._all.disabled = busy
        self._draw()

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        if look is None or self._look is None or look.found is not self._look.found:
            self._slots, self._sketches = {}, {}
        self._look = look
        self.folder.visible = look is not None
        self._draw()

    def open(self, name: str | None) -> None:
        """Marks the one that is opened."""
        if name != self._opened:
            self._opened = name
            self._draw()

    def _at(self, slot: int) -> Candidate | None:
        shown = self._look.promising[:MOST] if self._look is not None else []
        return next((one for one in shown if self._slots.get(one.name) == slot), None)

    def _take_slots(self, shown: Sequence[Candidate]) -> None:
        names = [one.name for one in shown]
        self._slots = {name: slot for name, slot in self._slots.items() if name in names}
        free = iter(sorted({*range(MOST)} - {*self._slots.values()}))
        self._slots |= {name: next(free) for name in names if name not in self._slots}

    def _draw(self) -> None:
        look = self._look
        if look is None:
            return
        shown = look.promising[:MOST]
        self._take_slots(shown)
        self._all.visible = bool(shown)
        if look.assessment is None:
            told = "Scoring every effect of the library and every fault of the actuator beside the residual …"
            content = html("<div>{}</div>{}", told, WAITS)
        elif shown:
            content = (
                _LEGEND
                + how_known(look, self._discovering.is_refining)
                + joined(self._card(look, place, one) for place, one in enumerate(shown))
            )
        else:
            content = html("<div>{}</div>", none_left(look))
        content = html('<div class="emaviz-cards">{}</div>', content)
        if self._cards.content != content:
            self._cards.content = content

    def _card(self, look: Look, place: int, one: Candidate) -> Html:
        if one.name not in self._sketches:
            self._sketches[one.name] = discovery.sketch(discovery.signature(look, one))
        title, slot = effect_title(one.name), self._slots[one.name]
        same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
        rivals = ", ".join(in_sentence(effect_title(name)) for name in same)
        against = look.assessment.spoken_against.get(one.name, "") if look.assessment else ""
        off = Html(" disabled") if self._running else ""
        opens = f"{_PRESS.format(id_of(self._opens[slot]))};{_SEE}"
        return html(
            '<article class="emaviz-card{}"><header><button onclick="{}" title="Its equation, cause, and what it is '
            'mistaken for">{}. {}</button><b>{}</b></header><i><i style="width:{:.1f}%;height:4px"></i></i>'
            '<div>{}{}{}<button class="do add" onclick="{}" aria-label="Add {}"{}>+ Add</button>'
            '<button class="do" onclick="{}" aria-label="Why {}">Why?</button></div>{}</article>',
            " open" if one.name == self._opened else "",
            opens,
            place + 1,
            title,
            chance(look, one),
            100.0 * look.probability(one),
            joined(
                html("<div>{}</div>", line)
                for line in (explained(fall(look, one)), strength(look, one), share(look, one))
            ),
            html('<div class="alike">▲ These recordings cannot tell it from {}.</div>', rivals) if rivals else "",
            html('<div class="alike">▲ Not to be claimed: {}.</div>', against) if against else "",
            _PRESS.format(id_of(self._adds[slot])),
            title,
            off,
            opens,
            title,
            self._sketches[one.name],
        )


def chance(look: Look, one: Candidate) -> str:
    """Of a candidate beside the others: that it is not the next says nothing of whether it is missing at all."""
    probable = look.probability(one)
    return f"{in_percent(probable)} probable" if probable >= _UNLIKELY else "not the next"


def how_known(look: Look, refining: bool) -> Html:
    """Whether the cards are as algebra ranks them, or as refits do."""
    assert look.assessment is not None
    done = len(look.assessment.refitted)
    if look.assessment.is_refined:
        return html('<div style="{}">Ranked by refits of the most probable; the rest by algebra.</div>', _SMALL)
    if refining:
        told = f"{done} refitted, more are being refitted" if done else "the most probable are being refitted"
        return html('<div style="{}" role="status">Ranked by algebra; {} … {}</div>', _SMALL, told, _MOVES)
    return html('<div style="{}">Ranked by algebra{}.</div>', _SMALL, f"; {done} refitted" if done else "")


def none_left(look: Look) -> str:
    """Why there is no card."""
    left = look.assessment.left.explanation if look.assessment else None
    if left is not None and not look.found.at_floor:
        return "No candidate explains the residual: try its curve, or an expression of your own, on the left."
    return "No candidate would reduce the error significantly."


# --- sliders for the parameters of a user's torque, and the ranges that they move in ----------------------------------

_REACH = 50.0  # times where a parameter begins, that its slider goes, as long as nobody has set another
_STEPS = 1000
_LONGEST_PHASE = 3.2  # rad, of a parameter that begins at 0


class ParameterSliders:
    """A folder with a slider for each name, and a folded one with the ranges.  moved() follows each change."""

    def __init__(self, page: Page, moved: Callable[[], None]) -> None:
        self._page, self._moved = page, moved
        self._sliders: dict[str, Any] = {}
        self._ranges: dict[str, Any] = {}
        self._begins: dict[str, Size] = {}
        self._own_values: set[str] = set()  # parameters whose value somebody has set
        self._own_ranges: set[str] = set()
        gui = page.server.gui
        self._folder = gui.add_folder("Its parameters", visible=False)
        with self._folder:
            self._said = add_html(gui)
        self._wide = gui.add_folder("Ranges of the parameters", visible=False, expand_by_default=False)

    def list(self, begins: Mapping[str, Size]) -> None:
        """These parameters, each from where it begins; what somebody has set stays."""
        if self._begins == dict(begins) and [*self._sliders] == [*begins]:
            return
        values = {name: self._sliders[name].value for name in self._own_values if name in self._sliders}
        ranges = {name: self._ranges[name].value for name in self._own_ranges if name in self._ranges}
        for control in (*self._sliders.values(), *self._ranges.values()):
            control.remove()
        self._sliders, self._ranges, self._begins = {}, {}, dict(begins)
        self._folder.visible = self._wide.visible = bool(begins)
        told = ", ".join(f"{name} {number(one.value)} {one.words}".replace(" –", "") for name, one in begins.items())
        self._said.content = note(f"They begin as the units and what is left suggest: {told}.") if begins else ""
        for name, begin in begins.items():
            value = min(max(begin.value, RANGE[0]), RANGE[1])
            low, high = ranges.get(name, reach(value))
            with self._folder:
                self._sliders[name] = self._slider(name, float(low), float(high), float(values.get(name, value)))
            with self._wide:
                entry = self._page.server.gui.add_vector2(
                    f"{name} from, to",
                    (float(low), float(high)),
                    step=_step(low, high),
                    hint=f"Of the slider, and of the fit, in {begin.words}",
                )
            self._page.changed(entry, partial(self._take_range, name))
            self._ranges[name] = entry

    @property
    def values(self) -> dict[str, float]:
        """As the sliders stand; a fit begins there."""
        return {name: setting_number(slider.value, name) for name, slider in self._sliders.items()}

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Those that somebody has set: a fit keeps to them."""
        return {name: _range(name, self._ranges[name].value) for name in self._own_ranges if name in self._ranges}

    def _slider(self, name: str, low: float, high: float, value: float) -> Any:
        value = min(max(value, low), high)
        unit = self._begins[name].words
        hint = f"In {unit}. What it does is drawn below; the fit begins here"
        slider = self._page.server.gui.add_slider(name, low, high, _step(low, high), value, hint=hint)
        slider.precision = 7
        self._page.changed(slider, partial(self._set, name), at_once=True)
        return slider

    def _set(self, name: str) -> None:
        self._own_values.add(name)
        self._moved()

    def _take_range(self, name: str) -> None:
        low, high = _range(name, self._ranges[name].value)
        self._own_ranges.add(name)
        slider = self._sliders[name]
        with self._page.server.atomic():
            slider.min, slider.max = low, high
            slider.step = _step(low, high)
            slider.precision = 7
            slider.value = min(max(float(slider.value), low), high)
        self._moved()


def reach(value: float) -> tuple[float, float]:
    """A slider's ends about where a parameter begins, as round numbers."""
    most = float(f"{_REACH * abs(value):.0e}") if value else _LONGEST_PHASE
    most = min(max(most, 1e-6), RANGE[1])
    return -most, most


def _step(low: float, high: float) -> float:
    return float(f"{(high - low) / _STEPS:.0e}")


def _range(name: str, limits: Any) -> tuple[float, float]:
    low, high = (setting_number(limit, f"the range of {name}") for limit in limits)
    if not RANGE[0] <= low < high <= RANGE[1]:
        raise InputError(f"the range of {name} must go from a number to a larger one within ±{RANGE[1]:g}")
    return low, high


# --- one candidate opened ---------------------------------------------------------------------------------------------
# One candidate opened: its signature beside what is left, its equation, cause, size, and what it is mistaken for.

CONFIG = {"displayModeBar": False, "responsive": False}


class EffectView:
    """A folder of the panel on the right, there while a card is open."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._name: str | None = None
        self._busy = self._untestable = False
        self._drawn: tuple[Any, str | None] = (None, None)
        gui = page.server.gui
        self._folder = gui.add_folder("Candidate", visible=False)
        with self._folder:
            self._head = add_html(gui)
            self._add = gui.add_button("Add it to the model", icon=viser.Icon.PLUS)
            self._plot: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.52, visible=False)
            self._text = add_html(gui)
            self._close = gui.add_button("Close", icon=viser.Icon.X, color="gray")

    def connect(self, ask: Callable[[Callable[[], bool], Any], None], close: Callable[[], None]) -> None:
        """ask(begin, button) starts a step; close() closes the card."""

        def add() -> None:
            name = self._name
            if name is not None:
                ask(lambda: self._discovering.add(name), self._add)

        self._page.pressed(self._close, close)
        self._page.pressed(self._add, add)

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._busy = busy
        self._enable()

    def _enable(self) -> None:
        self._add.disabled = self._busy or self._untestable

    def open(self, look: Look | None, name: str | None) -> None:
        """Shows a candidate, or none."""
        one = look.candidate(name) if look is not None and name is not None else None
        self._name = one.name if one is not None else None
        self._folder.visible = one is not None
        if look is None or one is None or self._drawn == (look, one.name):
            return
        self._drawn = (look, one.name)
        self._folder.label = effect_title(one.name)
        self._head.content = head(look, one)
        actuator = look.found.actuator
        is_fault = one.name in BY_NAME
        self._text.content = about_fault(one.name, actuator) if is_fault else about(find(one.name, actuator.axes))
        self._untestable = bool(one.obstacle)
        self._enable()
        self._plot.visible = not self._untestable
        if not self._untestable:
            self._plot.figure = discovery.signature(look, one)


def head(look: Look, one: Candidate) -> Html:
    """What adding it is expected to do."""
    if one.obstacle:
        why = one.obstacle[:1].upper() + one.obstacle[1:]
        return html('<div {}><span style="color:{}">▲ {}.</span></div>', BOX, COLOURS["warning"], why)
    if not look.is_worth(one):
        return html("<div {}>No evidence for it: adding it would not reduce the error significantly.</div>", BOX)
    lines: list[str] = [
        html(
            "The error would fall from <b>{}</b> to about <b>{} times the floor</b>: {}.",
            number(look.rmse),
            number(look.predicted_rmse(one)),
            confidence(look, one),
        ),
        f"Suggested: {strength(look, one)} (estimated; adding it fits it).",
    ]
    same = look.assessment.alike.get(one.name, ()) if look.assessment else ()
    if same:
        names = ", ".join(in_sentence(effect_title(name)) for name in same)
        lines.append(
            html('<span style="color:{}">▲ These recordings cannot tell it from {}.</span>', COLOURS["warning"], names)
        )
    return html('<div class="{}">{}</div>', _OPENED, boxed(joined(lines, "<br>")))


def about(effect: Effect, equation: bool = True) -> Html:
    """Equation (unless it stands elsewhere), cause, typical size, where it shows, what it is mistaken for."""
    rows = [
        ("Belongs to", FAMILIES[effect.family]),
        ("Why", effect.explanation),
        ("Typical", typical(effect)),
        ("Shows", effect.shows),
        ("Mistaken for", effect.mistaken_for),
        ("Source", effect.source),
    ]
    return _written(effect.equation if equation else "", rows)


def about_fault(name: str, actuator: Actuator) -> Html:
    """The same of a fault of the actuator."""
    page = page_of(name)
    rows = [
        ("Belongs to", "the actuator itself: a fault, and no missing physics"),
        ("Why", page.explanation),
        ("Typical", typical_fault(name, actuator)),
        ("Shows", page.shows),
        ("Mistaken for", page.mistaken_for),
    ]
    return _written(page.equation, rows)


def _written(equation: str, rows: list[tuple[str, str]]) -> Html:
    table = joined(
        html(
            '<tr><td style="opacity:.65;vertical-align:top;padding-right:8px;white-space:nowrap">{}</td>'
            "<td>{}</td></tr>",
            title,
            text,
        )
        for title, text in rows
        if text
    )
    shown = html('<div style="font-size:17px;padding:4px 0 6px">{}</div>', mathml(equation, "inline"))
    return html("<div {}>{}<table>{}</table></div>", BOX, shown if equation else "", table)


def typical(effect: Effect) -> str:
    """'Amplitude 6, 12, 24 mN·m: low, medium, high.'"""
    first = effect.parameters[0]
    shown = Quantity("", first.unit).scaled(effect.severities)
    values = ", ".join(number(shown.factor * one, 2) for one in effect.severities)
    return f"{first.title} {values} {shown.unit}".rstrip() + ": low, medium, high"


# --- your own effect --------------------------------------------------------------------------------------------------
# Your own effect: an expression checked as it is typed, a slider for each parameter, and the curve of what is left.

_EXAMPLE = "-c*sign(omega)*sqrt(abs(omega))"
_TYPED_S = 0.7  # after the last key, from which a text is taken for whole: its torque is compiled then
_CONFIG = {"displayModeBar": False, "responsive": False}


class OwnEffect:
    """A folder of the Discover tab."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._typed = Typed(None, "")
        self._running = False
        self._look: Look | None = None
        self._timer: threading.Timer | None = None
        gui = page.server.gui
        self._folder = gui.add_folder("Your own effect", visible=False, expand_by_default=False)
        with self._folder:
            add_html(gui, _help())
            self._text = gui.add_text("T [N·m] =", "", hint=f"For example {_EXAMPLE}")
            self._checked = add_html(gui)
            self._sliders = ParameterSliders(page, self._preview)
            self._said = add_html(gui)
            self._plot: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=0.7, visible=False)
            self._add = gui.add_button("Fit it in the model", icon=viser.Icon.PLUS, disabled=True)
            self._curve = gui.add_button(
                "From the curve",
                icon=viser.Icon.CHART_LINE,
                color="gray",
                disabled=True,
                hint="What is left, as a table of torque over the variable that explains it best",
            )
        page.changed(self._text, self._check)
        page.screen.hear(discovering.events.previewed, self._draw, kind=self)
        page.screen.hear(discovering.events.unpreviewed, self._hide, kind=self)

    def connect(self, ask: Callable[[Callable[[], bool], Any], None]) -> None:
        """ask(begin, button) starts a step."""
        self._page.pressed(self._add, lambda: ask(self._begin, self._add))
        self._page.pressed(self._curve, lambda: ask(self._discovering.add_curve, self._curve))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._running = busy
        self._enable()

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        changed = look is None or self._look is None or look.steps != self._look.steps or self._look.assessment is None
        self._look = look
        self._folder.visible = look is not None
        self._enable()
        if changed:
            self._hide("")
            if look is not None and look.assessment is not None and not self._is_in(look):
                self._list()
                self._preview()

    def _is_in(self, look: Look) -> bool:
        found = self._typed.expression
        return found is not None and any(one.key == user_torque(found.text).name for one in look.added)

    def _enable(self) -> None:
        left = self._look.assessment.left.explanation if self._look and self._look.assessment else None
        self._add.disabled = self._running or self._typed.expression is None
        self._curve.disabled = self._running or left is None

    def _check(self) -> None:
        """Reads the text as it stands; on the screen's thread."""
        self._typed = typed(str(self._text.value))
        colour = COLOURS["good" if self._typed.expression else "bad"]
        self._checked.content = html('<div {}><span style="color:{}">{}</span></div>', BOX, colour, self._typed.line)
        self._list()
        self._hide("")
        self._enable()
        if self._timer is not None:
            self._timer.cancel()
        if self._typed.expression is not None:
            self._timer = threading.Timer(_TYPED_S, lambda: self._page.screen.post("own effect typed", self._preview))
            self._timer.daemon = True
            self._timer.start()

    def _list(self) -> None:
        """The parameters, from where what is left now suggests."""
        found = self._typed.expression
        self._sliders.list(user_begins(self._look, found) if found is not None and self._look is not None else {})

    def _effect(self) -> UserEffect:
        if self._typed.expression is None:
            raise InputError("there is no expression that can be used yet; write one, for example " + _EXAMPLE)
        return user_torque(self._typed.expression.text, self._sliders.ranges)

    # --- what it would change ---------------------------------------------------------------------------------------

    def _preview(self) -> None:
        """Asks for what the torque would change with the sliders' values."""
        if self._typed.expression is None or self._look is None or self._is_in(self._look):
            return
        if not self._plot.visible:
            self._said.content = note("Simulating; a new expression is compiled first, for some seconds …")
        try:
            self._discovering.preview_own(self._effect(), self._sliders.values)
        except InputError as error:
            self._hide(str(error))

    def _draw(self, found: Preview) -> None:
        if self._look is None or found.look.steps != self._look.steps or self._typed.expression is None:
            return
        if found.candidate.name != self._effect().name:
            return  # of a text that was typed before
        with self._page.server.atomic():
            self._plot.figure = discovery.signature(found.look, found.candidate)
            self._plot.visible = True
            change = f"{shown(found.look.rmse)} → ≈ {shown(found.rmse)} × floor"
            self._said.content = html("<div {}>With these values, before any fit: error {}.</div>", BOX, change)

    def _hide(self, why: str) -> None:
        self._plot.visible = False
        self._said.content = (
            html('<div {}><span style="color:{}">{}</span></div>', BOX, COLOURS["warning"], why) if why else ""
        )

    def _begin(self) -> bool:
        return self._discovering.add_own(self._effect(), self._sliders.values)


def _help() -> Html:
    rows = joined(html("<div><code>{}</code> {}</div>", name, meaning) for name, meaning in VARIABLES.items())
    functions = ", ".join(FUNCTIONS)
    return html(
        "<div {}>A torque at the motor's shaft, in N·m; positive drives it on. Every other name is a "
        'parameter, and is fitted.<details><summary style="cursor:pointer">What can be used</summary>{}'
        "<div><code>pi</code>, + − * / ** and {}</div></details></div>",
        BOX,
        rows,
        functions,
    )
