"""What can be taken away from Explore: the run's data, a picture of the plot, the moving scene."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser

from ema_model.recordings import write_measurement
from emaviz.figures import run_signals
from emaviz.page.explore.charts import ChartsPanel
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import WIDE_MODAL
from emaviz.server.safe_server import SCENES
from emaviz.session.data_folder import DataFolder
from emaviz.session.session import Simulation
from emaviz.text.html import add_html, html, said

_FRAMES, _FRAME_S = 120, 0.04  # of an exported scene
_NAME = "emaviz-run"


class ExportControls:
    """Buttons; what each makes is sent to the browser that has asked."""

    def __init__(self, page: Page, strip: PlaybackStrip, charts: ChartsPanel, folder: DataFolder) -> None:
        self._folder = folder
        self._page, self._playback, self._charts = page, strip.playback, charts
        gui = page.server.gui
        gui.add_markdown("The run as it stands, in the format that *Compare* reads.")
        self._whose = gui.add_dropdown("Signals of", ("plant", "monitor"), initial_value="plant")
        self._button("Data as CSV", viser.Icon.FILE_SPREADSHEET, lambda client: self._send_data(client, ".csv"))
        self._button("Data as Parquet", viser.Icon.TABLE, lambda client: self._send_data(client, ".parquet"))
        gui.add_markdown("Any chart saves itself: **PNG** at its corner. All four as one figure:")
        self._button("Plot (PNG)…", viser.Icon.PHOTO, self._show_plot)
        gui.add_markdown(
            "The actuator with its motion, in one **HTML** file that opens offline, and a link to it here."
        )
        self._scene = self._button("Scene as HTML", viser.Icon.CUBE, self._send_scene)
        self._link = add_html(gui)

    def _button(self, label: str, icon: viser.IconName, act: Callable[[viser.ClientHandle], None]) -> Any:
        button = self._page.server.gui.add_button(label, icon=icon, color="gray")

        @button.on_click
        def _(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            client = event.client
            if client is None:
                return
            if self._page.session.simulation is None:
                self._page.say_beside(button, "Nothing has been simulated yet.")
                return
            self._page.say_beside(button, "")
            self._page.screen.post(f"export {label}", lambda: act(client))

        return button

    def _run(self) -> Simulation:
        simulation = self._page.session.simulation
        assert simulation is not None, "the buttons act once there is a run"
        return simulation

    def _send_data(self, client: viser.ClientHandle, suffix: str) -> None:
        whose = "monitor" if self._whose.value == "monitor" else "plant"
        run = self._run()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{_NAME}-{whose}{suffix}"
            write_measurement(run.monitor if whose == "monitor" else run.reference, path)
            client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _show_plot(self, client: viser.ClientHandle) -> None:
        run, ghost = self._run(), self._charts.ghost
        figure = run_signals.figure(
            run.reference,
            run.monitor,
            ghost.reference if ghost is not None else None,
            self._charts.window_s,
            axes=self._page.session.actuator.axes,
        )
        saved = {"format": "png", "filename": _NAME, "width": 1200, "height": 1000, "scale": 2}
        modal = client.gui.add_modal("Plot")
        with modal:
            add_html(client.gui, WIDE_MODAL)
            client.gui.add_plotly(
                figure,
                config={"displayModeBar": True, "displaylogo": False, "toImageButtonOptions": saved},
                aspect=0.75,
            )
            client.gui.add_button("Close", color="gray").on_click(lambda _: modal.close())

    def _send_scene(self, client: viser.ClientHandle) -> None:
        with self._playback.still() as motion:
            if motion is None:
                return
            serializer = self._page.server.get_scene_serializer()
            for time_s in np.linspace(0.0, motion.duration_s, _FRAMES, endpoint=False):
                motion.pose(self._playback.scene, float(time_s))
                serializer.insert_sleep(_FRAME_S)
            page = serializer.as_html().replace("<title>Viser</title>", "<title>Actuator – emaviz</title>", 1)
        client.send_file_download("emaviz-actuator.html", page.encode(), save_immediately=True)
        path = self._folder.fresh(self._folder.scenes, "actuator", ".html")
        try:
            path.write_bytes(page.encode())
        except OSError as error:
            text = f"No link to the scene: {path.name} cannot be written ({error.strerror})"
            self._page.say_beside(self._scene, text)
            return
        self._link.content = said(html('<a href="{}{}" target="_blank">Open {} ↗</a>', SCENES, path.name, path.name))
