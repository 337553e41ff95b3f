"""Which physics several units of one type lack: all of them, or one alone; and what differs beside it."""

from ema_model.units.discovery.discover import discover_units
from ema_model.units.discovery.result import Lack, UnitsDiscovered
from ema_model.units.discovery.summary import as_dict

__all__ = ["Lack", "UnitsDiscovered", "as_dict", "discover_units"]
