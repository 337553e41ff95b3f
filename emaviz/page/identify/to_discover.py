"""From an identification that does not fit to Discover: the same recording, opened there."""

from __future__ import annotations

from ema_model.errors import InputError
from ema_model.recordings import write_measurement
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.session.identify.race import Race

_NAME = "identified plant.csv"  # of the sliders' plant, which has no file yet


def take_to_discover(page: Page, discovering: Discovering, race: Race) -> None:
    """Opens the race's recording on Compare, alone, and chooses Compare's recordings on Discover.

    The sliders' plant is written into the data folder first.
    Raises InputError if that cannot be done; on the screen's thread.
    """
    comparing = discovering.comparing
    if discovering.running:
        raise InputError("Discover is busy with a step; stop it there first")
    name = race.settings.source
    if not name:
        path = comparing.folder.place(_NAME)
        try:
            write_measurement(race.measurement, path)
        except OSError as error:
            raise InputError(f"{path.name}: cannot be written ({error.strerror}); check the disk") from None
        name = comparing.folder.name_of(path)
    actuator = comparing.session.actuator.name
    if comparing.actuator_name != actuator:
        comparing.choose_actuator(actuator)
    for other in [other for other in comparing.opened if other != name]:
        comparing.remove(other)
    comparing.add(name)
    discovering.choose("")
    page.notify("Discover has the measurement", f"{name}: press Start.", "green")
