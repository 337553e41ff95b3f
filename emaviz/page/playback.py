"""The strip below the page: play, speed, the moment; how the actuator and the page look."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Annotated, Any

import msgspec
import viser

from ema_model.actuator import Actuator
from emaviz.colours import rgb
from emaviz.figures.theme import DARK, LIGHT
from emaviz.page.charts import send_picture
from emaviz.page.style import STRIP, caption, figures
from emaviz.page.style import page as style
from emaviz.page.workspaces import Page
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.playback import SPEEDS, Motion, Playback
from emaviz.session.jobs import Signal
from emaviz.session.settings import checked, limits, setting, taken
from emaviz.text.html import add_html

_SLOWEST_STEP_S = 1e-4


class Looks(msgspec.Struct, frozen=True):
    """How the actuator and the page look; as a session's file has it."""

    speed: Annotated[str, setting("the speed", one_of=SPEEDS)] = "1 : 10"
    opacity: Annotated[float, setting("the housing", 0.0, 1.0)] = 0.35
    labels: Annotated[bool, setting("labels")] = True
    dark: Annotated[bool, setting("dark")] = False


class PlaybackStrip:
    """One strip for all workspaces: it shows the clock of the one that was used last.

    A window at another one has an actuator of its own, and is the one that was used last once it uses the strip.

    theme(dark) sets the page's, of which `themed` tells.  moves: called with the reel's name, the moment and from–to, s
    of the recording's own time, on the screen's thread.
    """

    def __init__(
        self,
        page: Page,
        scene: ActuatorScene,
        actuator: Actuator,
        theme: Callable[[bool], None],
        unseen: Callable[[], object] = lambda: None,
    ) -> None:
        """unseen(): adds what scripts press and fill, where nobody sees it."""
        self._page, self._scene, self._theme = page, scene, theme
        self._span_s = (0.0, 0.5)
        self._placed: set[int] = set()  # windows with an actuator of their own
        self._placing = threading.Lock()
        self.themed: Signal[[bool]] = Signal()
        self.moves: Signal[[str, float, tuple[float, float]]] = Signal()
        self.playback = Playback(scene, actuator, self._moved)
        gui, usual = page.server.gui, Looks()
        self._panel = gui.add_panel()
        with self._panel.add_tab("Playback", viser.Icon.PLAYER_PLAY):
            add_html(gui, STRIP + style())
            self._play = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
            self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value=usual.speed)
            self._moment = gui.add_slider("Moment [s]", *self._span_s, _SLOWEST_STEP_S, 0.0)
            self._opacity = gui.add_slider(
                "Housing", **limits(Looks, "opacity"), step=0.05, initial_value=usual.opacity
            )
            self._labels = gui.add_checkbox("Labels", usual.labels)
            self._dark = gui.add_checkbox("Dark", usual.dark)
            self._view = gui.add_button("Reset view", icon=viser.Icon.FOCUS_CENTERED, color="gray")
            self._picture = gui.add_button(
                "Picture", icon=viser.Icon.CAMERA, color="gray", hint="Saves what is seen of the actuator as PNG"
            )
            self._figures = add_html(gui)
            self._caption = add_html(gui)
            page.workspaces.connect()
            unseen()
        self._panel.float(x=0, y=-1, width=480)
        self._play.on_click(self._pressed)
        self._speed.on_update(lambda _: self._set_speed())
        self._moment.on_update(lambda event: event.client and self._scrub(event.client))
        self._opacity.on_update(lambda _: self._scene.set_opacity(min(max(float(self._opacity.value), 0.0), 1.0)))
        self._labels.on_update(lambda _: self._scene.show_labels(bool(self._labels.value)))
        self._dark.on_update(lambda _: self._set_dark())
        page.workspaces.entered.connect(self._enter)
        page.server.on_client_disconnect(lambda client: self._forget(client.client_id))

        @self._picture.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                dark = DARK.paper if self._dark.value else LIGHT.paper
                send_picture(event.client, rgb(dark))

        @self._view.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                self._scene.reset_view(event.client)

    def play(self, playing: bool) -> None:
        """Lets the picture move or rest."""
        self.playback.play(playing)
        self._show_playing()

    def _pressed(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        wanted = not self.playback.playing  # as the button says
        self._use(event.client)
        self.play(wanted)

    def _use(self, client: viser.ClientHandle | None) -> None:
        """A window uses the strip, which then shows the clock of its workspace."""
        at = self._page.workspaces.places().get(client.client_id) if client is not None else None
        if at is not None and at != self.playback.on:
            self._enter(at)

    def step(self, steps: int) -> None:
        """Rests so many hundredths of the run later."""
        self.play(False)
        shown = self.playback.motion
        if shown is not None:
            self.playback.seek(min(self.playback.time_s + 0.01 * steps * shown.duration_s, shown.duration_s))

    def _show_playing(self) -> None:
        playing = self.playback.playing
        self._play.label = "Pause" if playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def _enter(self, workspace: str) -> None:
        self.playback.enter(workspace)
        self._place_windows()
        with self._page.server.atomic():
            self._show_playing()
            self.say()

    def _place_windows(self) -> None:
        """A window that is at another workspace than the one used last has its own actuator, from then on."""
        places, clients = self._page.workspaces.places(), self._page.server.get_clients()
        if self.playback.on not in places.values():
            return  # the window has gone on, which will be told
        with self._placing:
            for window, on in places.items():
                if (on != self.playback.on or window in self._placed) and window in clients:
                    self._placed.add(window)
                    self.playback.show_in(window, self._scene.own(clients[window]), on)

    def _forget(self, window: int) -> None:
        with self._placing:
            self._placed.discard(window)
            self.playback.forget(window)
            self._scene.forget(window)

    def put(self, shown: Motion | None, on: str, time_s: float | None = None) -> None:
        """Puts a run on a workspace's reel, or takes it off; time_s: where it is to rest, in its own time."""
        self.playback.put(shown, on)
        if time_s is not None:
            self.rest_at(time_s, on)
        self.say()

    def rest_at(self, time_s: float, on: str) -> None:
        """Stops a workspace's reel at a moment, s of the recording's own time."""
        shown = self.playback.reels[on].motion if on in self.playback.reels else None
        if on == self.playback.on:
            self.play(False)
        self.playback.seek(time_s - (shown.start_s if shown is not None else 0.0), on)

    def saved(self) -> dict[str, Any]:
        """How the actuator and the page look, for a session's file."""
        return {name: entry.value for name, entry in self._looks().items()}

    def restore(self, saved: Any) -> None:
        """Takes what `saved` gave, InputError if it makes no sense; on the screen's thread."""
        looks = taken(Looks, saved, "look")
        values = {name: checked(Looks, name, getattr(looks, name)) for name in Looks.__struct_fields__}
        for name, entry in self._looks().items():
            entry.value = values[name]

    def _looks(self) -> dict[str, Any]:
        controls = (self._speed, self._opacity, self._labels, self._dark)
        return dict(zip(Looks.__struct_fields__, controls, strict=True))

    def say(self) -> None:
        """The small print: what of the picture is not to scale."""
        motion = self.playback.motion
        line = caption("" if motion is None else motion.sentence())
        if self._caption.content != line:
            self._caption.content = line

    def _moved(self, on: str, time_s: float, duration_s: float) -> None:
        """A scene shows another moment; called on the playback's thread."""
        shown = self.playback.motion if on == self.playback.on else self.playback.reels[on].motion
        start = shown.start_s if shown is not None else 0.0
        span_s = start, start + duration_s
        self._page.screen.post(f"play-head {on}", lambda: self._draw(on, start + time_s, span_s))

    def _draw(self, on: str, time_s: float, span_s: tuple[float, float]) -> None:
        with self._page.server.atomic():
            if on != self.playback.on:  # of another window, whose clock the strip does not show
                self.moves(on, time_s, span_s)
                return
            if span_s != self._span_s:
                self._span_s = span_s
                self._moment.min, self._moment.max = (round(edge, 4) for edge in span_s)
            self._moment.value = round(time_s, 4)
            self.moves(on, time_s, span_s)

    def _scrub(self, client: viser.ClientHandle) -> None:
        self._use(client)
        self.play(False)
        self.playback.seek(float(self._moment.value) - self._span_s[0])

    def _set_speed(self) -> None:
        self.playback.speed = SPEEDS.get(str(self._speed.value), self.playback.speed)

    def _set_dark(self) -> None:
        dark = bool(self._dark.value)
        self._theme(dark)
        self._figures.content = figures(dark)
        self.themed(dark)
