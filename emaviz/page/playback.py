"""The strip below the page: play, speed, the moment; how the actuator and the page look."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import msgspec
import viser

from ema_model.actuator import Actuator
from emaviz.colours import rgb
from emaviz.figures.theme import DARK, LIGHT
from emaviz.page.page import Page
from emaviz.page.picture import send_picture
from emaviz.page.style import STRIP, caption, figures
from emaviz.page.style import page as style
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.motion import Motion
from emaviz.scene.playback import SPEEDS, Playback
from emaviz.session.described import checked, limits, setting, taken
from emaviz.session.signal import Signal
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

    theme(dark) sets the page's, of which `themed` tells.  moves: called with the reel's name, the moment and from–to, s
    of the recording's own time, on the screen's thread.
    """

    def __init__(self, page: Page, scene: ActuatorScene, actuator: Actuator, theme: Callable[[bool], None]) -> None:
        self._page, self._scene, self._theme = page, scene, theme
        self._span_s = (0.0, 0.5)
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
        self._panel.float(x=0, y=-1, width=480)
        self._play.on_click(lambda _: self.play(not self.playback.playing))
        self._speed.on_update(lambda _: self._set_speed())
        self._moment.on_update(lambda event: event.client and self._scrub())
        self._opacity.on_update(lambda _: self._scene.set_opacity(min(max(float(self._opacity.value), 0.0), 1.0)))
        self._labels.on_update(lambda _: self._scene.show_labels(bool(self._labels.value)))
        self._dark.on_update(lambda _: self._set_dark())
        page.workspaces.entered.connect(self._enter)

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
        with self._page.server.atomic():
            self._show_playing()
            self.say()

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

    def _moved(self, time_s: float, duration_s: float) -> None:
        """The scene shows another moment; called on the playback's thread."""
        on, shown = self.playback.on, self.playback.motion
        start = shown.start_s if shown is not None else 0.0
        self._page.screen.post("play-head", lambda: self._draw(on, start + time_s, (start, start + duration_s)))

    def _draw(self, on: str, time_s: float, span_s: tuple[float, float]) -> None:
        with self._page.server.atomic():
            if span_s != self._span_s:
                self._span_s = span_s
                self._moment.min, self._moment.max = (round(edge, 4) for edge in span_s)
            self._moment.value = round(time_s, 4)
            self.moves(on, time_s, span_s)

    def _scrub(self) -> None:
        self.play(False)
        self.playback.seek(float(self._moment.value) - self._span_s[0])

    def _set_speed(self) -> None:
        self.playback.speed = SPEEDS.get(str(self._speed.value), self.playback.speed)

    def _set_dark(self) -> None:
        dark = bool(self._dark.value)
        self._theme(dark)
        self._figures.content = figures(dark)
        self.themed(dark)
