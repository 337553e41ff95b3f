"""emaviz: break, watch and identify the model of an electromechanical actuator.

The app, the recordings and the command line; the science is in `ema_model`.
"""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("emaviz")
except PackageNotFoundError:  # run from the sources without an installation
    __version__ = "0+source"
