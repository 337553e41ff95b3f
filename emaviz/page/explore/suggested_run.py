"""A suggested run into Explore: its command, duration and load, as if a person had set them."""

from __future__ import annotations

from ema_model.discovery.result import Experiment
from ema_model.identification.next_experiment import Suggestion
from emaviz.page.explore.controls import ExplorePanel


def take_experiment(explore: ExplorePanel, one: Experiment) -> None:
    """Sets the session and Explore's controls, and simulates; InputError where Explore does not take a value."""
    explore.take(
        command=one.command, settings=one.settings, duration_s=one.duration_s, load_torque_Nm=one.load_torque_Nm
    )


def take_separating(explore: ExplorePanel, one: Suggestion) -> None:
    """As `take_experiment`; the load stays what it is."""
    explore.take(command=one.command, settings=one.settings, duration_s=one.duration_s)
