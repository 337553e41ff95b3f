"""emaviz: break, watch and identify the model of an electromechanical actuator.

The app, the recordings and the command line; the science is in `ema_model`.
"""

import os

# Matrices here are small: threads of the linear algebra would wait for each other and take the kernels' cores.
# Said before numpy is imported, and only where the user has not.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def __getattr__(name: str) -> str:
    """`__version__`, sought when it is asked for, as that takes a while."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("emaviz")
    except PackageNotFoundError:  # run from the sources without an installation
        return "0+source"
