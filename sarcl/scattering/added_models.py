"""Scattering models that installed packages add (docs/developers/extensions.md), in place of Fresnel's coefficients.

A model gives S in a_rt = k/(2 sqrt(pi)) S_rt I of physical_optics.py. All else stays; sums are in float64 on the host.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence

import numpy as np

from ..base import validation
from ..base.errors import NotApplicable
from ..io import entry_points
from ..scene.material import Material
from ..scene.scene import Scene
from .physical_optics import lit_share


def refuse(scene: Scene, what: str, instead: str) -> None:
    """NotApplicable where facets scatter by a model of an installed package, which `what` does not compute."""
    for name in scene.scattering_models:
        text = f"the scene has facets of the scattering model {name!r} of an installed package, not computed with"
        raise NotApplicable(f"{text} {what}: {instead}")


@functools.lru_cache(maxsize=64)
def _model(name: str, path: tuple[str, ...]) -> Callable[..., np.ndarray]:
    """The model of this name; path  sys.path, in which packages are looked for."""
    model = entry_points.added("scattering", name)
    if not callable(model):
        raise TypeError(f"the entry point {name!r} of sarcl.scattering is {model!r:.60}; wanted a function")
    return model


def put_into(
    out: np.ndarray, factor: np.ndarray, kinds: tuple[Sequence[Material], np.ndarray], looks: Sequence[np.ndarray],
    frequencies: np.ndarray, up: np.ndarray, sides: list[tuple[int, int]], *, forward: bool,
) -> None:  # fmt: skip
    """Write amplitudes (n, k, n_polarizations) of the facets whose material has a model; the others stay.

    factor  what S is multiplied by (n, k);  kinds  materials, and the number of each facet's (k,)
    looks   unit normals on the side that is seen, and unit vectors to transmitter and receiver, (k, 3) each
    up      direction that H is perpendicular to (3,);  sides  [received, sent] of the polarisations, 0 is H
    ValueError, with the name of the model, for S of another shape, or that is not finite.
    """
    for number, material in enumerate(kinds[0]):
        facets, name = np.flatnonzero(kinds[1] == number), material.scattering
        if not name or not len(facets):
            continue
        normal, to_tx, to_rx = (a[facets] for a in looks)
        s = np.asarray(_model(name, tuple(sys.path))(normal, to_tx, to_rx, frequencies, up, material))
        if s.shape != (len(frequencies), len(facets), 2, 2):
            wanted = (len(frequencies), len(facets), 2, 2)
            raise ValueError(f"the scattering model {name!r} gave an array of shape {s.shape}, wanted {wanted}")
        validation.finite(f"values of the scattering model {name!r}", s)
        lit = factor[:, facets] * lit_share(normal, to_tx, to_rx, forward)
        for i, (r, t) in enumerate(sides):
            out[:, facets, i] = lit * s[..., r, t]
