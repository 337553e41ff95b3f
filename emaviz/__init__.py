"""emaviz: break, watch and identify the model of an electromechanical actuator.

The app, the recordings and the command line; the science is in `ema_model`.
"""

import os
from importlib.metadata import PackageNotFoundError, version

# Matrices here are small: threads of the linear algebra would wait for each other and take the kernels' cores.
# Said before numpy is imported, and only where the user has not.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

try:
    __version__ = version("emaviz")
except PackageNotFoundError:  # run from the sources without an installation
    __version__ = "0+source"
