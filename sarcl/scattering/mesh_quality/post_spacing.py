"""Spacing of posts with random heights, beside the resolution: coarser posts show as a grid in an image.

Facets between posts are planes whose brightness differs. Their edges show where one coordinate of the image resolves
them: on terrain of 0.05 m at X band, with cells of 0.5 m x 0.81 m, the image's spectrum has a line at the spacing of
posts 0.8 m apart, a hundred times its median or more, and none at 0.5 m (tests/scattering/test_mesh_quality.py).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base import constants
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import PulseGeometry
from ...scene.scene import Scene
from ...scene.triangles import edges


@dataclass(frozen=True)
class PostSpacing:
    """Posts of a terrain with point_roughness, beside the resolution.

    spacing  m, median distance of neighbouring posts;  cell  m (2,): resolution in slant range and cross range
    needed   m, spacing at which facets between posts extend over one cell, in the coordinate that resolves them better
    """

    spacing: float = 0.0
    cell: tuple[float, float] = (np.inf, np.inf)
    needed: float = np.inf

    def describe(self) -> dict[str, Any]:
        """For a report's plan."""
        return {}

    def warnings(self) -> list[str]:
        """A warning for a user, where posts show."""
        if self.spacing <= self.needed:
            return []
        return [
            f"point_roughness moves posts {self.spacing:.2g} m apart, and the resolution cell is {self.cell[0]:.2g} x "
            f"{self.cell[1]:.2g} m (slant range x cross range): the posts will show as a grid in an image. Give posts "
            f"at most {self.needed:.2g} m apart, or roughness= (of facets, without correlation) in place of it"
        ]


def judge(scene: Scene, antennas: PulseGeometry, waveform: Waveform) -> PostSpacing:
    """Spacing of the posts of a scene that is not yet realized; none to warn of without point_roughness.

    With an antenna at the scene's centre, forward scattering, or a single direction there is no resolution cell and no
    verdict.
    """
    if not scene.has_random_points:
        return PostSpacing()
    look = antennas.mean_direction(scene.center)
    if look is None:
        return PostSpacing()
    middle = look[len(look) // 2]
    along = float(np.linalg.norm(middle))
    if not along > 1e-6 or np.isnan(look).any():
        return PostSpacing()
    turn = look - look[0]
    turn = turn[np.linalg.norm(turn, axis=1).argmax()]
    turn = turn - middle * (turn @ middle) / along**2
    if not turn.any():
        return PostSpacing()
    axes = 2 / constants.SPEED_OF_LIGHT * np.stack([waveform.bandwidth * middle, waveform.center * turn])  # cells/m
    moved = scene.triangles[scene.point_roughness.any(axis=(1, 2))]
    resolved = float(np.median(np.ptp(moved @ axes.T, axis=1), axis=0).max())
    spacing = float(np.median(edges(moved).min(axis=0)))
    range_cell, cross_cell = (float(width) for width in 1 / np.linalg.norm(axes, axis=1))
    return PostSpacing(spacing, (range_cell, cross_cell), spacing / max(resolved, 1e-300))
