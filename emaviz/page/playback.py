"""The strip below the page: play, speed, the moment; how the actuator and the page look."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from emaviz.page.page import Page
from emaviz.page.style import STRIP, caption, figures, play_head
from emaviz.page.style import page as style
from emaviz.scene.actuator import ActuatorScene
from emaviz.scene.playback import SPEEDS, Playback
from emaviz.text.html import add_html

_SLOWEST_STEP_S = 1e-4


class PlaybackStrip:
    """window_s(): from and to when the charts show the run, which the play-head needs; theme(dark) sets the page's."""

    def __init__(
        self,
        page: Page,
        scene: ActuatorScene,
        window_s: Callable[[], tuple[float, float]],
        theme: Callable[[bool], None],
    ) -> None:
        self._page, self._scene, self._window_s, self._theme = page, scene, window_s, theme
        self._playback: Playback | None = None
        self._duration_s = 0.5
        gui = page.server.gui
        self._panel = gui.add_panel()
        with self._panel.add_tab("Playback", viser.Icon.PLAYER_PLAY):
            add_html(gui, STRIP + style())
            self._play = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
            self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1 : 10")
            self._moment = gui.add_slider("Moment [s]", 0.0, self._duration_s, _SLOWEST_STEP_S, 0.0)
            self._opacity = gui.add_slider("Housing", 0.0, 1.0, 0.05, 0.35)
            self._labels = gui.add_checkbox("Labels", False)
            self._dark = gui.add_checkbox("Dark", False)
            self._view = gui.add_button("Reset view", icon=viser.Icon.FOCUS_CENTERED, color="gray")
            self._head = add_html(gui)
            self._figures = add_html(gui)
            self._caption = add_html(gui)
        self._panel.float(x=0, y=-1, width=480)

    def connect(self, playback: Playback) -> None:
        """Its controls act from now on."""
        self._playback = playback
        self._play.on_click(lambda _: self.play(not playback.playing))
        self._speed.on_update(lambda _: self._set_speed(playback))
        self._moment.on_update(lambda event: event.client and self._scrub(playback))
        self._opacity.on_update(lambda _: self._scene.set_opacity(min(max(float(self._opacity.value), 0.0), 1.0)))
        self._labels.on_update(lambda _: self._scene.show_labels(bool(self._labels.value)))
        self._dark.on_update(lambda _: self._set_dark())

        @self._view.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                self._scene.reset_view(event.client)

    def play(self, playing: bool) -> None:
        """Lets the picture move or rest."""
        if self._playback is not None:
            self._playback.play(playing)
        self._play.label = "Pause" if playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def saved(self) -> dict[str, object]:
        """How the actuator and the page look, for a session's file."""
        return {name: entry.value for name, entry in self._looks().items()}

    def restore(self, saved: object) -> None:
        """Takes what `saved` gave, as far as it makes sense; on the screen's thread."""
        for name, entry in self._looks().items():
            value = saved.get(name) if isinstance(saved, dict) else None
            if type(value) is type(entry.value) and (name != "speed" or value in SPEEDS):
                entry.value = value

    def _looks(self) -> dict[str, Any]:
        looks = {"speed": self._speed, "opacity": self._opacity, "labels": self._labels, "dark": self._dark}
        return dict(looks)

    def say(self, text: str) -> None:
        """The small print: what of the picture is not to scale."""
        line = caption(text)
        if self._caption.content != line:
            self._caption.content = line

    def moved(self, time_s: float, duration_s: float) -> None:
        """The scene shows another moment; called on the playback's thread."""
        self._page.screen.post("play-head", lambda: self._draw(time_s, duration_s))

    def _draw(self, time_s: float, duration_s: float) -> None:
        low, high = self._window_s()
        with self._page.server.atomic():
            if duration_s != self._duration_s:
                self._duration_s = duration_s
                self._moment.max = duration_s
            self._moment.value = round(time_s, 4)
            self._head.content = play_head((time_s - low) / (high - low) if high > low else None)

    def _scrub(self, playback: Playback) -> None:
        self.play(False)
        playback.seek(float(self._moment.value))

    def _set_speed(self, playback: Playback) -> None:
        playback.speed = SPEEDS.get(str(self._speed.value), playback.speed)

    def _set_dark(self) -> None:
        dark = bool(self._dark.value)
        self._theme(dark)
        self._figures.content = figures(dark)
