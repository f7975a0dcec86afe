"""Antennas about a scene: the range window that holds its echoes, the sphere that they are outside of, their angles."""

from __future__ import annotations

import numpy as np

from ...base.boxes import corners
from ...model.waveform import Waveform
from ...numerics.pulse_geometry import half_path
from ...scene.scene import Scene
from ...simulation import echo_sampling


def angle_along(directions: np.ndarray) -> np.ndarray:
    """Angle along a path of unit vectors (P, 3), rad (P,)."""
    first, second = directions[:-1], directions[1:]
    turn = np.arctan2(np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(turn)])


def check_outside(scene: Scene, antennas: dict[str, np.ndarray]) -> None:
    """ValueError where an antenna is so near that the sphere about the scene's box holds it."""
    radius = float(np.linalg.norm(scene.bounds[1] - scene.bounds[0])) / 2
    for name, places in antennas.items():
        distance = np.linalg.norm(places - scene.center, axis=1)
        if not (distance > radius).all():
            nearest = int(np.argmin(distance))
            raise ValueError(
                f"{name} position {nearest} is {distance[nearest]:.4g} m from the scene's centre, and the scene "
                f"reaches {radius:.4g} m from it; fullwave_echo takes the wave at the scene as plane: give antennas "
                "outside"
            )


def window_of(
    scene: Scene, waveform: Waveform, tx: np.ndarray, rx: np.ndarray, reference_range: np.ndarray, asked: object
) -> tuple[float, float]:
    """The range window, m: as asked, or the smallest that holds the scene's box, and waves that creep round it, plus
    10 %.

    A wave that touches a body at its sides, creeps over its back and returns has gone a quarter of the box's girth
    farther than the box's centre: pi/2 radii for a sphere, less than the 2 radii of its box.
    """
    box = echo_sampling.window(scene, waveform, tx, rx, reference_range, None)
    if asked is None:
        size = np.sort(scene.bounds[1] - scene.bounds[0])
        late = float(size[1] + size[2]) / 2
        late += float((half_path(tx, rx, scene.center) - reference_range).max())
        half = max(box[1], 1.1 * late)
        return -half, half
    near, far = echo_sampling.window(scene, waveform, tx, rx, reference_range, asked)
    ends = np.array([half_path(tx, rx, corner) - reference_range for corner in corners(scene.bounds)])
    if near > ends.min() or far < ends.max():
        raise ValueError(
            f"range_window ({near:g}, {far:g}) m does not hold the scene, from {ends.min():.4g} to {ends.max():.4g} m "
            "about the reference: echoes outside would appear at a wrong range, because fullwave_echo leaves out no "
            "part of a body; give a wider window, or none"
        )
    return near, far
