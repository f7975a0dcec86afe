"""sarcl: synthetic-aperture-radar echoes and images on any OpenCL device.

Two equations carry everything::

    echo     s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p)))
    image    I(x)   = sum_p v_p(x) sum_n s_p(f_n) exp(+j 2 pi f_n (tau(x, p) - tau_ref(p)))

    tau      (|T_p - x| + |x - R_p|)/c        Trajectory (T, R), ImageGrid and Scene (x)
    tau_ref  2 reference_range/c              PhaseHistory.reference_range
    a_k      amplitude, |a|^2 = RCS in m^2    Scene
    W        matched-filter spectrum          Waveform.matched_spectrum
    s_p      samples, one row p               PhaseHistory
    v_p      1 inside the range window        |tau - tau_ref| <= 1/(2 frequency_step)
    I        data                             Image

Examples of the docstrings continue from these lines:

    >>> import numpy as np
    >>> import sarcl
    >>> chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)  # Hz, s
    >>> track = sarcl.Trajectory.circle(radius=5e3, height=5e3, arc=0.05, n_pulses=64, speed=100)  # m, rad, m/s
    >>> scene = sarcl.Scene.points([[0, 0, 0], [5, -4, 0]])  # m
    >>> raw = sarcl.echo(scene, chirp, track)
    >>> grid = sarcl.ImageGrid.plane(shape=(128, 128), spacing=0.25)  # rows, columns; m
    >>> image = sarcl.backproject(raw, grid)

Public names, with the file that defines each: sarcl/__init__.pyi. Rooms and the direction of their imports:
docs/developers/architecture.md.
"""

import ast
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from .base.version import __version__ as __version__


def _public_names() -> dict[str, tuple[str, str]]:
    """Public name -> (module, name in it), as __init__.pyi lists them."""
    path = os.path.join(os.path.dirname(__file__), "__init__.pyi")
    try:
        stub = ast.parse(__loader__.get_data(path))  # as pkgutil.get_data does: in a zip file too
    except OSError:
        raise ImportError(
            f"sarcl cannot start without {path}, the list of its public names. That file is missing: an installer has "
            "left out type stubs (.pyi). Install all files of sarcl: pip install --force-reinstall --no-deps sarcl"
        ) from None
    return {
        alias.asname or alias.name: (f".{node.module or ''}", alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name != "__version__"
    }


_PUBLIC = _public_names()
__all__ = sorted(_PUBLIC)


# Names are imported on first use: `sarcl --help` must not wait for numpy, and no device is probed at import.
def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'sarcl' has no attribute {name!r}; dir(sarcl) lists the public names")
    home, attribute = _PUBLIC[name]
    # of a public module the package that holds it is imported first, then the module itself
    package = import_module(home, __name__)
    value = vars(package).get(attribute) if home == "." else getattr(package, attribute, None)
    if value is None:
        value = import_module(f"{home.rstrip('.')}.{attribute}", __name__)
    globals()[name] = value
    return value


class _PublicModules(MetaPathFinder, Loader):
    """`import sarcl.shapes` gives the module that `from sarcl import shapes` gives, wherever its file is."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """A spec for a public module in one of the rooms; None for all other names."""
        prefix, _, name = fullname.rpartition(".")
        public = prefix == __name__ and name in _PUBLIC and isinstance(__getattr__(name), ModuleType)
        return ModuleSpec(fullname, self) if public else None

    def exec_module(self, module: ModuleType) -> None:
        """Put the module of the room in the place of the new, empty one."""
        sys.modules[module.__name__] = __getattr__(module.__name__.rpartition(".")[2])


sys.meta_path.append(_PublicModules())


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
