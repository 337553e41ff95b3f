"""The Explore tab: faults, command, load, plant, and what is sealed."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import sentences
from ema_model.commands import COMMANDS
from ema_model.discovery.result import Experiment
from ema_model.effects import CATALOGUE, find
from ema_model.faults import FAULTS, HEALTHY, vector
from ema_model.identification.uncertainty import Suggestion
from ema_model.quantities import USER, labelled, of_signal
from ema_model.simulation import plant
from ema_model.simulation.run import SHAPES
from ema_model.text import COLOURS
from emaviz.page.explore_charts import WORKSPACE, ChartsPanel, ExportControls
from emaviz.page.panel import JobLine
from emaviz.page.style import LONG_LABELS
from emaviz.page.tab import Shared, Tab
from emaviz.page.workspaces import Bound, Page
from emaviz.session.discovery_source import Sealing
from emaviz.session.explore import Simulation
from emaviz.session.files import recovered
from emaviz.session.settings import MONITORS, Settings, Undo, limits
from emaviz.text.html import Html, add_html, html, said

# --- ready-made faults: those of the thesis's tables, each low and high, and its multi-fault case ---------------------

_MULTI_FAULT = np.array([0.0133, 0.05, 0.003, 0.0, 0.0, 0.012, 0.5, 0.35])  # T 5.3
CUSTOM = "custom"

PRESETS: dict[str, NDArray[np.float64]] = {
    "healthy": HEALTHY,
    **{
        f"{title}, {severity}": vector({name: value})
        for name, title in (
            ("k1", "friction"),
            ("k2", "backlash"),
            ("k3", "short circuit in phase A"),
            ("k6", "eccentricity"),
            ("k8", "proportional gain"),
        )
        for severity, value in (("low", 0.25), ("high", 0.75))
    },
    "several faults, as in the thesis": _MULTI_FAULT,
}


def name_of(k: NDArray[np.float64]) -> str:
    """The preset that k is, or that it is none."""
    return next((name for name, preset in PRESETS.items() if np.allclose(k, preset, atol=1e-9)), CUSTOM)


# --- a few words for the first visit, at the top of the Explore tab ---------------------------------------------------

_KEY = "emaviz started"
_FIRST_VISIT_TEXT = """
1. **Break it**: choose a preset, or drag a fault's slider. The 3D actuator and the charts show what changes.
2. **Watch it**: play, slow down or scrub below; the line in every chart is the same moment.
3. **Find it**: *Identify* recovers the faults from the current, each with an interval.
4. **Correct it**: *Compare* shows where the model fails on your own measurements, *Discover* which physics it lacks.
   New here? Begin with *Discover*'s guided challenge.
"""


class StartHere:
    """Shown until somebody says that it was read; a browser that has said so never sees it again."""

    def __init__(self, page: Page) -> None:
        gui = page.server.gui
        self._folder = gui.add_folder("Start here", visible=False)
        with self._folder:
            gui.add_markdown(_FIRST_VISIT_TEXT)
            read = gui.add_button("Got it", icon=viser.Icon.CHECK, color="gray")
        read.on_click(self._read)

        @page.server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            # A browser may have its storage blocked, or be gone again.
            with contextlib.suppress(RuntimeError, TimeoutError):
                if client.local_storage.get_item(_KEY, timeout=10.0) is None:
                    self._folder.visible = True

    def _read(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            kept = event.client.local_storage
            kept.set_item(_KEY, "1")
            # Gone only when the browser has kept it: a reload at once must not bring it back.
            with contextlib.suppress(RuntimeError, TimeoutError):
                kept.get_item(_KEY, timeout=2.0)
        self._folder.visible = False


# --- the load on the user shaft: its torque, and how it goes over time ------------------------------------------------

_SEEN_NM = 20.0  # that a profile begins with where there was no load
_WITH_TIME, _WITH_FREQUENCY = ("step", "chirp"), ("sine", "chirp")
Listen = Callable[[Any, Callable[[Any], Any], Callable[[], Any]], None]


class LoadControls:
    """Controls in the folder that is open."""

    def __init__(self, page: Page, listen: Listen) -> None:
        """listen(control, setter, read): has a control's new value simulated."""
        gui, settings = page.server.gui, page.session.settings
        self._settings = settings
        of = partial(limits, Settings)
        self._shape: Any = gui.add_dropdown("Profile", SHAPES, hint="How the load goes over time")
        self._torque: Any = gui.add_number(
            of_signal("load_torque_Nm", page.session.actuator.axes).label, 0.0, **of("load_torque_Nm"), step=1.0
        )
        self._time: Any = gui.add_number(
            "Step at [s]", settings.load_time_s, **of("load_time_s"), step=0.01, visible=False
        )
        self._frequency: Any = gui.add_number(
            "Frequency [Hz]", settings.load_frequency_Hz, **of("load_frequency_Hz"), step=0.5, visible=False
        )
        listen(self._shape, self._choose, lambda: settings.load_shape)
        listen(self._torque, partial(settings.set, "load_torque_Nm"), lambda: settings.load_torque_Nm)
        listen(self._time, partial(settings.set, "load_time_s"), lambda: settings.load_time_s)
        listen(self._frequency, partial(settings.set, "load_frequency_Hz"), lambda: settings.load_frequency_Hz)

    def _choose(self, shape: Any) -> None:
        self._settings.set("load_shape", shape)
        if shape != SHAPES[0] and not self._settings.load_torque_Nm:
            self._settings.set("load_torque_Nm", _SEEN_NM)
            self._torque.value = _SEEN_NM
        self.show()

    def show(self) -> None:
        """The fields that the profile has."""
        shape = self._settings.load_shape
        self._time.visible, self._frequency.visible = shape in _WITH_TIME, shape in _WITH_FREQUENCY
        self._time.label = "Step at [s]" if shape == "step" else "Sweep time [s]"
        self._frequency.label = "End frequency [Hz]" if shape == "chirp" else "Frequency [Hz]"


# --- what the plant has and the monitor does not know: sensor noise, the state at the start, hidden effects -----------

_NONE = "–"


class PlantControls:
    """Folders of the Explore tab, closed at first."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._bound: list[Bound] = []
        gui, settings, axes = page.server.gui, page.session.settings, page.session.actuator.axes
        of = partial(limits, Settings)
        away = "Distance" if axes.is_linear(USER) else "Angle"
        with gui.add_folder("Sensor noise", expand_by_default=False):
            self._listen(
                gui.add_number("Current noise [A]", 0.0, min=0.0, max=50.0, step=0.05, hint="White, rms"),
                partial(settings.set, "current_noise_A"),
                lambda: settings.current_noise_A,
            )
            self._listen(
                gui.add_number("Encoder [bit per turn]", 0, **of("encoder_bits"), step=1, hint="0: a perfect encoder"),
                partial(settings.set, "encoder_bits"),
                lambda: settings.encoder_bits,
            )
        with gui.add_folder("State at the start", expand_by_default=False):
            self._listen(
                gui.add_number(
                    f"{away} off the command [m{axes.unit('rad', USER)}]", 0.0, min=-500.0, max=500.0, step=1.0
                ),
                lambda value: settings.set("start_offset_rad", 1e-3 * float(value)),
                lambda: 1e3 * settings.start_offset_rad,
            )
            hint = "Of the plant; the monitor starts at rest.  An identification starts at rest, too."
            self._listen(
                gui.add_number(
                    of_signal("motor_speed_rad_s", axes).label, 0.0, **of("start_speed_rad_s"), step=10.0, hint=hint
                ),
                partial(settings.set, "start_speed_rad_s"),
                lambda: settings.start_speed_rad_s,
            )
            self._listen(
                gui.add_slider("Position in the backlash", -1.0, 1.0, 0.1, 0.0, hint="−1 and 1: at one of its walls"),
                partial(settings.set, "start_side"),
                lambda: settings.start_side,
            )
        self._folder = gui.add_folder("Hidden effects", expand_by_default=False)
        with self._folder:
            add_html(
                gui,
                Html(
                    '<div style="font-size:12px;opacity:.75;padding:0 10px">They act in the plant only, so the monitor '
                    "fails where they matter. The first use of each combination is compiled, which takes seconds.</div>"
                ),
            )
            self._titles = {effect.title: name for name, effect in CATALOGUE.items()}
            self._choice = gui.add_dropdown("Effect", (_NONE, *self._titles), initial_value=_NONE)
            self._about = add_html(gui, visible=False)
            self._add = gui.add_button("Hide it in the plant", icon=viser.Icon.PLUS, color="gray", disabled=True)
        self._shown: dict[str, Any] = {}
        page.changed(self._choice, self._chosen)
        page.pressed(self._add, self._hide)

    def _chosen(self) -> None:
        name = self._titles.get(str(self._choice.value))
        self._add.disabled = name is None
        self._about.visible = name is not None
        if name is not None:
            effect = CATALOGUE[name]
            self._about.content = said(html("{}<br><i>Shows:</i> {}", effect.explanation, effect.shows))

    def _hide(self) -> None:
        name = self._titles.get(str(self._choice.value))
        if name is None or name in self._shown:
            return
        if self._change(lambda: self._page.session.settings.set_effect(name, *self._clear(name))):
            self._show(name)
            self._choice.value = _NONE
            self._chosen()

    def _clear(self, name: str) -> tuple[str, float]:
        """The first parameter at its clear severity."""
        effect = find(name, self._page.session.actuator.axes)
        return effect.parameters[0].name, effect.severities[1]

    def _show(self, name: str) -> None:
        """The parameters of an effect that is in the plant now."""
        gui, session = self._page.server.gui, self._page.session
        effect = find(name, session.actuator.axes)
        with self._folder:
            folder = gui.add_folder(effect.title)
        self._shown[name] = folder
        with folder:
            for parameter in effect.parameters:
                read = partial(self._parameter, name, parameter.name)
                value = read()
                span = parameter.high - parameter.low
                entry = gui.add_number(
                    parameter.label,
                    int(value) if parameter.integer else value,
                    min=parameter.low,
                    max=parameter.high,
                    step=1 if parameter.integer else float(f"{span / 500.0:.0e}"),
                    hint=f"{parameter.meaning}, {parameter.low:g} … {parameter.high:g}",
                )

                def setter(value: Any, parameter: str = parameter.name) -> None:
                    if name in session.settings.effects:
                        session.settings.set_effect(name, parameter, value)

                self._bind(entry, setter, read)
            remove = gui.add_button("Remove the effect", icon=viser.Icon.X, color="gray")
        self._page.pressed(remove, lambda: self._remove(name))

    def _parameter(self, name: str, parameter: str) -> float:
        return self._page.session.settings.effects[name][parameter]

    def _remove(self, name: str) -> None:
        folder = self._shown.pop(name, None)
        if folder is not None:
            folder.remove()
            self._change(lambda: self._page.session.settings.remove_effect(name))

    def show_settings(self) -> None:
        """Sets every control to what the session holds; on the screen's thread."""
        for one in self._bound:
            one.show()
        for folder in self._shown.values():
            folder.remove()
        self._shown.clear()
        for name in self._page.session.settings.effects:
            self._show(name)

    def _listen(self, entry: Any, setter: Callable[[Any], None], read: Callable[[], Any]) -> None:
        self._bound.append(self._bind(entry, setter, read))

    def _bind(self, entry: Any, setter: Callable[[Any], None], read: Callable[[], Any]) -> Bound:
        def take(value: Any) -> None:
            setter(value)
            self._page.session.refresh()

        return self._page.bind(entry, read, take, at_once=True)

    def _change(self, change: Callable[[], Any]) -> bool:
        good = self._page.checked(change)
        if good:
            self._page.session.refresh()
        return good


# --- a suggested run into Explore: its command, duration and load, as if a person had set them ------------------------


def take_experiment(explore: ExplorePanel, one: Experiment) -> None:
    """Sets the session and Explore's controls, and simulates; InputError where Explore does not take a value."""
    explore.take(
        command=one.command, settings=one.settings, duration_s=one.duration_s, load_torque_Nm=one.load_torque_Nm
    )


def take_separating(explore: ExplorePanel, one: Suggestion) -> None:
    """As `take_experiment`; the load stays what it is."""
    explore.take(command=one.command, settings=one.settings, duration_s=one.duration_s)


# --- a button of Explore: what is hidden in its plant becomes a sealed challenge for somebody else --------------------

_SEAL_TEXT = (
    "The plant as it is set here, its hidden effects and faults, is recorded four times: a chirp, a small step, a slow "
    "sine, and a sine to hold out. Its parameters are off within their tolerances, at random. The load and the noise "
    "are those set here; perfect sensors are replaced by those of a usual rig. The story and the measurements can be "
    "read, the answer only by *Reveal* on the Discover tab."
)


class SealControls:
    """The button, the questions, and the file that is sent to who has asked."""

    def __init__(self, page: Page, sealing: Sealing) -> None:
        self._page, self._sealing = page, sealing
        self._asked: viser.ClientHandle | None = None
        gui = page.server.gui
        self._button = gui.add_button(
            "Seal as a challenge…", icon=viser.Icon.LOCK, color="gray", hint="One file for a colleague to solve"
        )
        JobLine(page, sealing.job, WORKSPACE)
        page.pressed_by(self._button, self._ask)
        page.disable_while(sealing.job, self._button)
        page.screen.hear(sealing.sealed, self._sealed)

    def _ask(self, client: viser.ClientHandle | None) -> None:
        if client is None:
            return
        modal = client.gui.add_modal("Seal as a challenge")
        with modal:
            client.gui.add_markdown(_SEAL_TEXT)
            title = client.gui.add_text("Challenge title", "")
            story = client.gui.add_text("Its story", "", multiline=True, hint="What a colleague should know, not more")
            seal = client.gui.add_button("Seal it", icon=viser.Icon.LOCK)
            client.gui.add_button("Cancel", color="gray").on_click(lambda _: modal.close())

        def begin() -> None:
            self._begin(client, str(title.value), str(story.value), seal, modal.close)

        self._page.pressed(seal, begin)

    def _begin(
        self, client: viser.ClientHandle, title: str, story: str, button: Any, close: Callable[[], None]
    ) -> None:
        if self._page.begins(lambda: self._sealing.seal(title, story), button):
            self._asked = client
            close()

    def _sealed(self, path: Path) -> None:
        self._page.notify("Challenge sealed", f"{path.name}: Discover lists it among the measurements.", "green")
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)


# --- the Explore tab: break the actuator with sliders and see both models answer --------------------------------------

_DECIMALS = 6  # that a command's settings may have


class ExplorePanel:
    """Presets and sliders of the faults, the command and its settings, the load, and what the plant hides."""

    def __init__(self, page: Page, fan: Callable[[int], None]) -> None:
        """fan(fault): shows five severities of it."""
        self._page = page
        session = page.session
        self._undo = Undo(session.settings, lambda: session.plant, session.choose_plant)
        self._touched = 0  # the fault that was moved last
        self._bound: list[Bound] = []
        gui = page.server.gui
        self.status = add_html(gui, said("Starting…"))
        self._note = add_html(gui)
        self._model = add_html(gui)
        self.start = StartHere(page)
        with gui.add_folder("Faults of the plant"):
            add_html(gui, LONG_LABELS)
            known = name_of(page.session.settings.k)
            self._preset = gui.add_dropdown("Preset", (*PRESETS, CUSTOM), initial_value=known)
            self._sliders = [self._fault(i) for i in range(len(FAULTS))]
            reset = gui.add_button("Reset to healthy", icon=viser.Icon.HEART)
            self._back: Any = gui.add_button(
                "Undo", icon=viser.Icon.ARROW_BACK_UP, color="gray", disabled=True, hint="The last change here; Ctrl+Z"
            )
            fanned = gui.add_button(
                "Fan of severities",
                icon=viser.Icon.CHART_AREA_LINE,
                color="gray",
                hint="Five severities of the fault that was moved last, beside each other",
            )
        page.pressed(reset, lambda: self._move_all(HEALTHY))
        page.pressed(self._back, self.undo)
        page.pressed(fanned, lambda: fan(self._touched))
        with gui.add_folder("Command"):
            self._command = gui.add_dropdown(
                "Command", [cls.title for cls in COMMANDS.values()], initial_value=COMMANDS["chirp"].title
            )
            self._groups = {name: self._command_settings(name) for name in COMMANDS}
            self._show_group()
            duration = gui.add_number("Duration [s]", 0.5, **limits(Settings, "duration_s"), step=0.01)
        with gui.add_folder("Load"):
            self._load = LoadControls(page, self._listen)
        self._plant = PlantControls(page)
        self._own = gui.add_dropdown(
            "Plant's model", tuple(page.session.plants), visible=False, hint="What Discover has improved may play it"
        )
        with gui.add_folder("Monitor model"):
            self.monitor = gui.add_dropdown(
                "Its faults", MONITORS, initial_value="healthy", hint="The faults that the monitor model has here"
            )
        settings = page.session.settings
        page.changed(self._preset, self._take_preset)
        page.changed(self._command, self._choose_command, at_once=True)
        self._listen(duration, partial(settings.set, "duration_s"), lambda: settings.duration_s)
        # Set by the session as well, after which nothing is to be simulated again.
        page.changed(self.monitor, self._take_monitor, at_once=True)
        page.bind(self._own, lambda: page.session.plant, self._take_plant)
        page.screen.hear(page.session.events.plants, self._plant_taken)

    def _take_monitor(self) -> None:
        self._change(lambda: self._page.session.settings.set("monitor", self.monitor.value))

    def note(self, text: str) -> None:
        """What is to be read once, and stays: below the status."""
        self._note.content = said(text) if text else ""

    def show_model(self, simulation: Simulation) -> None:
        """Says which model is drawn beside which plant; on the screen's thread."""
        plant = html(" · plant: <b>{}</b>", simulation.plant) if simulation.plant else ""
        line = said(html("Monitor model: <b>{}</b>{}", simulation.model, plant))
        if self._model.content != line:
            self._model.content = line

    def _take_plant(self, name: str) -> None:
        self._change_plant(lambda: self._page.session.choose_plant(name))

    def take_plant(self, name: str, actuator: Actuator) -> None:
        """An improved model plays the plant, on the screen's thread; InputError where Explore cannot simulate it."""
        self._change_plant(lambda: self._page.session.take_plant(name, actuator))

    def _change_plant(self, change: Callable[[], None]) -> None:
        """With what it does to the sliders said, and a step back."""
        settings = self._page.session.settings
        before = settings.k.copy()
        self._keep(None)
        change()
        if not np.array_equal(before, settings.k):
            text = (
                "They are now the faults that this model has; Undo brings back the model and the sliders from before."
            )
            self._page.notify("The sliders of Explore have moved", text, "yellow")

    def _plant_taken(self) -> None:
        session = self._page.session
        self._own.options, self._own.value = tuple(session.plants), session.plant
        self._own.visible = len(session.plants) > 1
        self.set_faults(session.settings.k)

    def _take_preset(self) -> None:
        k = PRESETS.get(str(self._preset.value))
        if k is not None:
            self._move_all(k)

    def _move_all(self, k: Any) -> None:
        moved = np.flatnonzero(np.asarray(k) != HEALTHY)
        self._touched = int(moved[0]) if len(moved) else self._touched
        self._keep(None)
        self.set_faults(k)

    def undo(self) -> None:
        """Takes the last change of a control back; on the screen's thread."""
        if self._undo.back():
            self.show_settings()
        self._back.disabled = not self._undo

    def _keep(self, control: Any) -> None:
        self._undo.keep(control)
        if self._back.disabled:
            self._back.disabled = False

    def show_preset(self) -> None:
        """Names the preset that the sliders make; on the screen's thread."""
        name = name_of(self._page.session.settings.k)
        if self._preset.value != name:
            self._preset.value = name

    def set_faults(self, k: Any) -> None:
        """Moves every slider, and simulates once."""
        settings = self._page.session.settings
        for i, value in enumerate(k):
            settings.set_fault(i, value)
        with self._page.server.atomic():
            for i, slider in enumerate(self._sliders):
                slider.value = float(k[i])
                slider.label = self._label(i)
        self._page.session.refresh()

    def take(
        self,
        *,
        command: str | None = None,
        settings: Mapping[str, Any] | None = None,
        duration_s: float | None = None,
        load_torque_Nm: float | None = None,
    ) -> None:
        """Sets what is given as if a person had, and simulates once; on the screen's thread.

        settings: of the command (the present one without it).  InputError, and nothing is changed, for a value that
        makes no sense.
        """
        tried = copy.deepcopy(self._page.session.settings)
        given = {"command": command, "duration_s": duration_s, "load_torque_Nm": load_torque_Nm}
        for name, value in given.items():
            if value is not None:
                tried.set(name, value)
        for name, value in (settings or {}).items():
            tried.set_command_setting(tried.command, name, value)
        self._keep(None)
        self._page.session.settings.restore(tried.saved())
        self.show_settings()

    def show_settings(self) -> None:
        """Sets every control to what the session holds, and simulates; on the screen's thread."""
        settings = self._page.session.settings
        with self._page.server.atomic():
            self._command.value = COMMANDS[settings.command].title
            self._show_group()
            self._load.show()
            for one in self._bound:
                one.show()
        self._plant.show_settings()
        self.show_monitor(settings.monitor)
        self.set_faults(settings.k)

    def show_monitor(self, monitor: str) -> None:
        """Sets the dropdown to what the session has chosen."""
        self.monitor.value = next(name for name in MONITORS if name == monitor)

    def _fault(self, index: int) -> Any:
        fault, value = FAULTS[index], float(self._page.session.settings.k[index])
        slider = self._page.server.gui.add_slider(
            self._label(index), 0.0, 1.0, 0.005, value, hint=f"{fault.name}: {fault.title}, 0 … 1"
        )
        self._page.changed(slider, partial(self._slide, index), at_once=True)
        return slider

    def _label(self, index: int) -> str:
        settings = self._page.session.settings
        return f"{FAULTS[index].name} {sentences(settings.k, self._page.session.actuator)[index]}"

    def _slide(self, index: int) -> None:
        slider = self._sliders[index]
        settings = self._page.session.settings
        self._touched = index
        if self._change(lambda: settings.set_fault(index, slider.value), slider):
            label = self._label(index)
            if slider.label != label:
                slider.label = label

    def _command_settings(self, name: str) -> list[Any]:
        inputs = []
        for f in fields(COMMANDS[name]):
            read = partial(self._command_setting, name, f.name, f.default)
            default = read()
            label = labelled(self._page.session.actuator.axes.name(f.name, USER))
            if isinstance(default, str):
                entry = self._page.server.gui.add_text(label, default)
            else:
                entry = self._page.server.gui.add_number(label, float(default), step=_step(float(default)))
                entry.precision = _DECIMALS  # the step's own would show 0.448 Hz as 0
            setter = partial(self._page.session.settings.set_command_setting, name, f.name)
            self._listen(entry, setter, read)
            inputs.append(entry)
        return inputs

    def _command_setting(self, name: str, setting: str, usual: Any) -> Any:
        return _written(self._page.session.settings.command_settings[name].get(setting, usual))

    def _listen(self, entry: Any, setter: Callable[[Any], None], read: Callable[[], Any]) -> None:
        """A control's new value goes through its setter, then both models run; read() is what the session holds."""

        def take(value: Any) -> None:
            self._keep(entry)
            setter(value)
            self._page.session.refresh()

        self._bound.append(self._page.bind(entry, read, take, at_once=True))

    def _choose_command(self) -> None:
        name = next((n for n, cls in COMMANDS.items() if cls.title == self._command.value), None)
        if self._change(lambda: self._page.session.settings.set("command", name), self._command):
            self._show_group()

    def _show_group(self) -> None:
        chosen = self._page.session.settings.command
        for name, inputs in self._groups.items():
            for entry in inputs:
                entry.visible = name == chosen

    def _change(self, change: Callable[[], Any], control: Any = None) -> bool:
        self._keep(control)
        good = self._page.checked(change, control)
        if good:
            self._page.session.refresh()
        return good


def _written(value: Any) -> Any:
    """As it stands in its control: the numbers of a list are joined by plus signs."""
    return "+".join(f"{one:g}" for one in value) if isinstance(value, (list, tuple)) else value


def _step(default: float) -> float:
    return 0.1 if default == 0.0 else 10.0 ** int(f"{abs(default):e}".split("e")[1]) / 10.0


# --- the Explore tab: the plant's faults and command, and its run beside the model's ----------------------------------

_NOTE = f"padding:6px 12px;font-size:13px;line-height:1.45;border-left:3px solid {COLOURS['warning']}"


class ExploreTab(Tab):
    """Runs are drawn as they come."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.charts = ChartsPanel(
            self.page,
            shared.slow_screen,
            right,
            shared.strip,
            lambda charts: ExportControls(self.page, shared.strip, charts, shared.comparing.folder),
        )

    def build(self) -> None:
        """A note where the actuator needs one, the controls, and sealing."""
        if text := plant.note(self.page.session.actuator):
            add_html(self.page.server.gui, html('<div style="{}">{}</div>', _NOTE, text))
        self.panel = ExplorePanel(self.page, self.charts.fan.ask_for)
        SealControls(self.page, self.shared.discovering.sealing)
        self.panel.note("\n".join(recovered(self.shared.comparing.folder.recordings)))
        self.page.screen.hear(self.page.session.events.simulated, self._draw)
        self.page.screen.hear(self.page.session.events.status, self._status)

    def show_settings(self) -> None:
        """On the sliders and the command."""
        self.panel.show_settings()

    def _draw(self, simulation: Simulation) -> None:
        self.charts.show(simulation)
        self.shared.strip.playback.show(simulation)
        self.shared.strip.say()
        self.panel.show_preset()
        self.panel.show_model(simulation)

    def _status(self, text: str) -> None:
        self.panel.status.content = said(text)
