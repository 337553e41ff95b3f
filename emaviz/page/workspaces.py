"""The workspaces: a window's tab, its panel on the right, its address; and what all panels share."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import viser

from ema_model.errors import InputError
from emaviz.page import charts, window_layout
from emaviz.page.charts import ChartHeights, Measuring
from emaviz.page.style import unseen
from emaviz.page.window_layout import Docked
from emaviz.server.access import say_beside
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.explore import Session
from emaviz.session.jobs import Job, Signal, Waiting, Worker
from emaviz.text.html import add_html
from emaviz.text.verdicts import begun, within

# --- presses of buttons that nobody sees, by which a page tells the server of itself ----------------------------------

# A page sends one message of its controls each 50 ms, the latest: of three presses at once it would drop the second,
# and the server would never know of the tab or the size that it stands for.  They go one after another.
_PRESS_SCRIPT = """
window.emavizPress ??= (() => {
  const waiting = [];
  let resting = false;
  const next = () => {
    resting = waiting.length > 0;
    if (!resting) return;
    document.getElementById(waiting.shift())?.click();
    setTimeout(next, 60);
  };
  return (button) => { waiting.push(button); if (!resting) next(); };
})();
"""


# --- which of the tabs on the right a window has in front, where what they show is drawn for those who see it ---------

# On the page: the button of the title in front among those given, or that of none of them, is pressed at each change.
_IN_FRONT_SCRIPT = """
(() => {
  const buttons = BUTTONS;
  window.emavizFront?.end();
  let told = null;
  const look = () => {
    const all = [...document.querySelectorAll('[role=tab]')];
    const tabs = all.filter(tab => tab.offsetParent && tab.textContent.trim() in buttons);
    if (!tabs.length) return;
    const front = tabs.find(t => t.getAttribute('aria-selected') === 'true')?.textContent.trim() ?? '';
    if (!document.getElementById(buttons[front]) || front === told) return;
    told = front;
    window.emavizPress(buttons[front]);
  };
  const seen = new MutationObserver(look);
  seen.observe(document.body, { subtree: true, attributes: true, attributeFilter: ['aria-selected'] });
  const timer = setInterval(() => { if (told === null) look(); }, 250);
  window.emavizFront = { end: () => { seen.disconnect(); clearInterval(timer); } };
})();
"""


class InFront:
    """Titles of tabs whose content waits until a window has it in front.

    came: called with a title when that is so, on the screen's thread.
    """

    def __init__(self, server: viser.ViserServer, screen: Worker) -> None:
        self._server, self._screen = server, screen
        self._titles: list[str] = []
        self._at: dict[int, str] = {}  # by window, once it has told
        self.came: Signal[[str]] = Signal()
        server.on_client_disconnect(self._left)

    def add(self, *titles: str) -> None:
        """Before `connect`; no other tab of the page has such a title."""
        self._titles += titles

    def connect(self) -> None:
        """Begins to follow the windows; to be called where the unseen buttons may stand."""
        gui = self._server.gui
        buttons: dict[str, str] = {}
        for title in ("", *self._titles):
            button: Any = gui.add_button(f"front:{title}")
            button.on_click(lambda event, title=title: event.client and self._came(event.client.client_id, title))
            buttons[title] = id_of(button)
        add_html(gui, unseen(list(buttons.values())))
        Inside(self._server).run(_IN_FRONT_SCRIPT.replace("BUTTONS", json.dumps(buttons)))

    def anywhere(self, title: str) -> bool:
        """Whether it is in front of a window, or may be: one that has not told, or nobody knows what is read next."""
        windows = list(self._server.get_clients())
        return not windows or any(self._at.get(one, title) == title for one in windows)

    def _came(self, client: int, title: str) -> None:
        self._at[client] = title
        if title:
            self._screen.post(f"front:{title}", lambda: self.came(title))

    def _left(self, client: viser.ClientHandle) -> None:
        self._at.pop(client.client_id, None)


# --- the workspaces: a window's tab, its panel on the right, its address and the actuator's run change together -------
# Each window has its own: the server is told which tab is in front there, and how large the window is, by buttons that
# nobody sees, and shows that window alone the panel that belongs to it.

# On the page: the tab in front goes into the address and to the server, as does the window's size; `go` and a reload's
# address choose a tab.
_SCRIPT = """
(() => {
  const views = VIEWS, sizes = SIZES, titles = Object.fromEntries(views.map(v => [v.title, v]));
  window.emavizViews?.end();
  const asked = new URLSearchParams(location.search).get('view');
  let wanted = views.some(v => v.name === asked) ? asked : FIRST, told = null, pressed = 0, at = null;
  const fitted = {}, passing = {};
  const tabs = () => [...document.querySelectorAll('[role=tab]')].filter(t => t.textContent.trim() in titles);
  const view = (tab) => titles[tab.textContent.trim()];
  const press = (tab) => {
    const at = tab.getBoundingClientRect();
    const where = { bubbles: true, cancelable: true, button: 0, pointerId: 1, isPrimary: true,
                    clientX: at.x + at.width / 2, clientY: at.y + at.height / 2 };
    for (const type of ['pointerdown', 'mousedown', 'pointerup', 'mouseup', 'click'])
      tab.dispatchEvent(new (type.startsWith('p') ? PointerEvent : MouseEvent)(type, where));
  };
  const look = () => {
    const all = tabs(), front = all.find(t => t.getAttribute('aria-selected') === 'true');
    const now = front && view(front);
    if (!now || !document.getElementById(now.button)) return;
    if (wanted !== null && now.name !== wanted) {
      const tab = all.find(t => view(t).name === wanted);
      if (tab && Date.now() - pressed > 300) { pressed = Date.now(); press(tab); }
      return;
    }
    wanted = null;
    at = front;
    if (now.name === told) return;
    told = now.name;
    window.emavizInset?.enter(now.inset, now.lower);
    document.title = `${now.title} – emaviz`;
    const address = new URL(location.href);
    address.searchParams.set('view', told);
    history.replaceState(history.state, '', address);
    window.emavizPress(now.button);
  };
  const fit = () => {
    for (const [side, steps] of Object.entries(sizes)) {
      const step = steps.filter(s => s.px <= window[side]).pop() ?? steps[0];
      const rests = step.px === passing[side];
      passing[side] = step.px;  // while an edge is dragged, sizes would overtake each other on their way
      if (!document.getElementById(step.button) || !rests || step.px === fitted[side]) continue;
      fitted[side] = step.px;
      window.emavizPress(step.button);
    }
  };
  const seen = new MutationObserver(look);
  seen.observe(document.body, { subtree: true, attributes: true, attributeFilter: ['aria-selected'] });
  const timer = setInterval(() => {
    if (at && !at.isConnected) {  // a window that was narrow, however shortly, has tabs and panels anew
      [wanted, at, fitted.innerWidth] = [told, null, sizes.innerWidth[0].px];
      window.emavizPress(sizes.innerWidth[0].button);
    }
    if (told === null || wanted !== null) look();
  }, 100);
  const sizing = setInterval(fit, 250);
  window.emavizViews = {
    go: (name) => { wanted = name; look(); },
    front: (before, after) => {
      for (const from of document.querySelectorAll('[role=tab][aria-selected=true]')) {
        const to = [...from.parentElement.children].find(t => t.textContent.trim() === after);
        if ((!before || from.textContent.trim() === before) && to && to.offsetParent) press(to);
      }
    },
    end: () => { seen.disconnect(); clearInterval(timer); clearInterval(sizing); },
  };
})();
"""


@dataclass(frozen=True)
class Workspace:
    """What a tab's folder says of itself; place: among the tabs, name: in the address (`/?view=compare`)."""

    name: str
    title: str
    icon: viser.IconName
    place: int
    share: float = 0.58  # of what the left panel leaves of a window, that its results have beside the actuator
    inset: bool = True  # whether the actuator is small there until it is clicked, and results have the width
    lower: bool = False  # whether the small actuator leaves more of the height to the controls above it
    waiting: tuple[str, ...] = ()  # tabs on its right whose content is drawn when a window has them in front


class Workspaces:
    """Which windows are where.  entered: called with the name, on the screen's thread, when a window comes there."""

    def __init__(self, server: viser.ViserServer, screen: Worker, panels: Docked, first: str) -> None:
        self._server, self._inside, self._screen, self._docked = server, Inside(server), screen, panels
        self.heights = ChartHeights(self._inside)
        self.in_front = InFront(server, screen)
        self.first = first  # where a window without a place in its address begins
        self.entered: Signal[[str]] = Signal()
        self._members: dict[str, Workspace] = {}
        self._at: dict[int, str] = {}  # by window
        self._changing = threading.Lock()
        server.on_client_disconnect(self._left)

    def add(self, one: Workspace) -> viser.PanelHandle:
        """A workspace; returns its panel on the right."""
        self._members[one.name] = one
        self.in_front.add(*one.waiting)
        return self._docked.add(one.name, one.share, in_front=one.name == self.first)

    def connect(self) -> None:
        """Begins to follow the windows; to be called where the unseen buttons may stand, once all are added."""
        gui = self._server.gui
        buttons: dict[str, Any] = {}
        for name in self._members:
            buttons[name] = button = gui.add_button(f"view:{name}")
            button.on_click(lambda event, name=name: event.client and self._came(event.client, name))
        sizes: dict[str, list[dict[str, Any]]] = {}
        fits: list[tuple[str, Sequence[int], Callable[[int, int], None]]] = [
            ("innerWidth", window_layout.WINDOWS_PX, self._fit_width),
            ("innerHeight", charts.WINDOWS_PX, self.heights.fit),
        ]
        for side, steps, fit in fits:
            sizes[side] = []
            for px in steps:
                button = gui.add_button(f"{side}:{px}")
                button.on_click(lambda event, px=px, fit=fit: event.client and fit(event.client.client_id, px))
                sizes[side].append({"px": px, "button": id_of(button)})
        every = [id_of(button) for button in buttons.values()]
        every += [step["button"] for steps in sizes.values() for step in steps]
        add_html(gui, unseen(every))
        views = [
            {"name": name, "title": one.title, "inset": one.inset, "lower": one.lower, "button": id_of(buttons[name])}
            for name, one in self._members.items()
        ]
        self._inside.run(_PRESS_SCRIPT)
        self._inside.run(window_layout.script())
        script = _SCRIPT.replace("VIEWS", json.dumps(views)).replace("SIZES", json.dumps(sizes))
        self._inside.run(script.replace("FIRST", json.dumps(self.first)))
        self.in_front.connect()

    def go(self, name: str, client: viser.ClientHandle | None) -> None:
        """Takes one window there, as a click on the tab would; without a window, nothing happens."""
        if client is not None and name in self._members:
            self._inside.run(f"window.emavizViews?.go({json.dumps(name)})", client.client_id)

    def bring_forward(self, name: str, before: str, after: str) -> None:
        """In windows at this workspace whose tab `before` is in front (any, for none), puts `after` there."""
        with self._changing:
            there = [client for client, at in self._at.items() if at == name]
        for client in there:
            self._inside.run(f"window.emavizViews?.front({json.dumps(before)}, {json.dumps(after)})", client)

    def places(self) -> dict[int, str]:
        """The workspace's name by window."""
        with self._changing:
            return dict(self._at)

    def anyone(self, name: str) -> bool:
        """Whether a window shows this workspace."""
        return name in self._at.values()

    def _came(self, client: viser.ClientHandle, name: str) -> None:
        with self._changing:
            self._at[client.client_id] = name
        self._docked.show(client.client_id, name)
        self._screen.post("workspace", lambda: self.entered(name))

    def _fit_width(self, client: int, window_px: int) -> None:
        self._docked.fit(client, window_px)
        self.heights.fit_width(client, max(window_px, window_layout.LEAST_WIDTH_PX))

    def _left(self, client: viser.ClientHandle) -> None:
        self.heights.forget(client.client_id)
        with self._changing:
            self._at.pop(client.client_id, None)


# --- what panels share: the server, the session, the screen's thread, the workspaces, and messages to the user --------

_CHOICES = viser.GuiDropdownHandle, viser.GuiCheckboxHandle  # in which nothing is typed that is to be corrected


@dataclass(frozen=True)
class Bound:
    """A control, and what the session holds for it."""

    control: Any
    get: Callable[[], Any]

    def show(self) -> None:
        """Sets the control to what the session holds."""
        self.control.value = self.get()


@dataclass(frozen=True)
class Page:
    """Handed to every panel."""

    server: viser.ViserServer
    session: Session
    screen: Worker  # draws, at a pace that browsers can follow
    workspaces: Workspaces  # which windows are where
    measuring: Measuring  # of charts over time
    folder: Path | None = None  # of the data, whose files messages name without it
    job_tabs: dict[Job, str] = field(default_factory=dict)  # where each long run is asked for, by the workspace's name
    _refused: set[str] = field(default_factory=set)  # controls beside which something is said
    _asked_by: dict[str, int] = field(default_factory=dict)  # the number of the run that each button has begun
    _in_line: dict[str, Waiting] = field(default_factory=dict)  # what each button has asked for, and waits

    def notify(self, title: str, text: str, colour: Any = "red") -> None:
        """A message in every open browser."""
        for client in self.server.get_clients().values():
            client.add_notification(title, begun(self.local(text)), auto_close_seconds=8.0, color=colour)

    def local(self, text: str) -> str:
        """A message that names files relative to the data folder, not by where the server has it."""
        return text if self.folder is None else within(text, self.folder)

    def checked(self, change: Callable[[], Any], control: Any = None) -> bool:
        """Applies a change of settings; a bad value becomes a message and leaves the old one.

        control: beside which that stands until it is changed; a message that goes away is for what has no place.
        """
        if control is not None:
            self.say_beside(control, "")  # before: the change itself may say something there
        try:
            change()
        except InputError as error:
            self._refuse(error, control)
            return False
        return True

    def _refuse(self, error: InputError, control: Any) -> None:
        if control is None:
            self.notify("Input refused", str(error))
        else:
            self.say_beside(control, str(error))

    def ask(self, kind: Hashable, asked: Callable[[], Any], control: Any = None) -> None:
        """Does what was asked soon, on the screen's thread; what is refused stands beside the control that asked."""
        self.screen.post(kind, lambda: self.checked(asked, control))

    # --- what a person does with a control --------------------------------------------------------------------------
    # It is answered on the screen's thread, or on another one; an answer that still waits gives way to a later one of
    # the same control.  An InputError is told beside the control, until that is used again.

    def pressed(self, button: Any, act: Callable[[], object], on: Worker | None = None) -> None:
        """Calls act when a button is pressed."""
        self.pressed_by(button, lambda _: act(), on)

    def pressed_by(
        self, button: Any, act: Callable[[viser.ClientHandle | None], object], on: Worker | None = None
    ) -> None:
        """Calls act with the window in which a button is pressed."""

        def pressed(event: viser.GuiEvent[Any]) -> None:
            (on or self.screen).post(id_of(button), lambda: self.checked(lambda: act(event.client), button))

        button.on_click(pressed)

    def changed(
        self, control: Any, act: Callable[[], object], on: Worker | None = None, *, at_once: bool = False
    ) -> None:
        """Calls act when a person changes a control, not when the program does.

        at_once: on the server's thread, without waiting for what is drawn, as for a slider that is dragged.
        """
        self.changed_to(control, lambda _: act(), on, at_once=at_once)

    def changed_to(
        self, control: Any, act: Callable[[Any], object], on: Worker | None = None, *, at_once: bool = False
    ) -> None:
        """The same with the value that the person gave, even where the program has set another one since."""

        def changed(event: viser.GuiEvent[Any]) -> None:
            if event.client is None:
                return
            value = control.value
            if at_once:
                self.checked(lambda: act(value), control)
            else:
                (on or self.screen).post(id_of(control), lambda: self.checked(lambda: act(value), control))

        control.on_update(changed)

    def bind(
        self, control: Any, get: Callable[[], Any], take: Callable[[Any], object], *, at_once: bool = False
    ) -> Bound:
        """A control of what the session holds: get() is that, take(value) what a person chooses or types instead.

        Of a value that take refuses, a choice is taken back, while a text or a number stays to be corrected.
        """
        bound = Bound(control, get)

        def change() -> None:
            try:
                take(control.value)
            except InputError:
                if isinstance(control, _CHOICES):
                    bound.show()
                raise

        self.changed(control, change, at_once=at_once)
        return bound

    def disable_while(self, job: Job, *controls: Any) -> None:
        """Controls cannot be used while a job runs."""

        def show(running: bool) -> None:
            with self.server.atomic():
                for control in controls:
                    control.disabled = running

        self.screen.follow(job, show)

    def say_beside(self, control: Any, text: str, *, calm: bool = False) -> None:
        """Stands below a control until it is used again; no text takes it away.  calm: it is no error."""
        if text or id_of(control) in self._refused:
            (self._refused.add if text else self._refused.discard)(id_of(control))
            say_beside(Inside(self.server), control, self.local(text), calm=calm)

    def begins(self, begin: Callable[[], bool], button: Any = None, title: str = "", of: str = "") -> bool:
        """Begins a long run, or lets it wait for the one that goes on; else says why not, below the button that asks.

        begin(): whether nothing else runs; InputError: what is missing.  It takes what is chosen once it begins.
        title: of what waits, by default the button's label; of: what the button asks for, where that is not always
        the same.
        """
        try:
            if not self.session.ready.is_set():
                self._wait("One moment", "The models are still being compiled.", button)
                return False
            if not self._begin(begin, button, of):
                self._line_up(begin, button, title, of)
                return True
        except InputError as error:
            self._refuse(error, button)
            return False
        if button is not None:
            self.say_beside(button, "")
        return True

    def _begin(self, begin: Callable[[], bool], button: Any, of: str) -> bool:
        jobs = self.session.worker.jobs
        before, begun = jobs.begun, begin()
        if begun and button is not None and jobs.begun != before:
            self._asked_by[id_of(button) + of] = jobs.begun
        return begun

    def _line_up(self, begin: Callable[[], bool], button: Any, title: str, of: str) -> None:
        """Waits behind what goes on, once for each thing that is asked for; InputError where that is what goes on."""
        jobs = self.session.worker.jobs
        running, uuid = jobs.running, of if button is None else id_of(button) + of
        if running is not None and self._asked_by.get(uuid) == jobs.begun:
            raise InputError(f"{running.job.title} goes on already; stop it first")

        def begins() -> bool:
            """Whether it has begun, or cannot, which is said."""
            try:
                return self._begin(begin, button, of)
            except InputError as error:
                self._in_line.pop(uuid, None)
                self._refuse(error, button)
                return True

        def gone() -> None:
            if self._in_line.pop(uuid, None) is not None and button is not None:
                self.say_beside(button, "")

        one = Waiting(title or (button.label if button is not None else "Another run"), begins, gone=gone)
        before = self._in_line.get(uuid)
        self._in_line[uuid] = one
        text = f"in line: begins after {running.job.title if running else 'the run before'}"
        if button is None:
            self.notify(one.title, text, "blue")
        else:
            self.say_beside(button, text, calm=True)
        jobs.add(one, before)

    def _wait(self, title: str, text: str, button: Any) -> None:
        if button is not None:
            raise InputError(text)
        self.notify(title, text, "yellow")
