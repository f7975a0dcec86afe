"""One task of rcs: its arguments, checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...base import validation
from ...base.text import shown
from ...opencl.choose_device import open_device
from ...opencl.device import Device
from ...scattering.facet_kinds import random
from ...scene.scene import Scene
from ._rcs_options import RcsOptions

MOST_AZIMUTH = 4 * np.pi  # rad: larger angles are degrees
UP = np.array([0.0, 0.0, 1.0])  # H is perpendicular to it


@dataclass(frozen=True, eq=False)
class RcsTask:
    """Radar cross sections to be computed.

    to_tx, to_rx  unit vectors from the scene to transmitter and receiver (n, 3): the same array where these are alike
    frequencies   Hz (m,);  shape  of the result;  polarizations  their names
    """

    options: RcsOptions
    scene: Scene
    to_tx: np.ndarray
    to_rx: np.ndarray
    frequencies: np.ndarray
    polarizations: tuple[str, ...]
    shape: tuple[int, ...]

    @property
    def ends(self) -> list[np.ndarray]:
        """Directions of the transmitter, and of the receiver where they differ."""
        return [self.to_tx] if self.to_rx is self.to_tx else [self.to_tx, self.to_rx]

    @property
    def is_forward(self) -> bool:
        """Whether forward scatter was asked for, and the receiver is another antenna."""
        return self.options.forward and self.to_rx is not self.to_tx

    @property
    def shading_device(self) -> Device | None:
        """The device that looks for shadows; None: nothing shades."""
        return self.device if self.options.shadows else None

    @cached_property
    def device(self) -> Device:
        """The device that finds lit parts, opened when it is first needed."""
        return open_device(self.options.device)


def rcs_task(
    scene: Scene, azimuth: ArrayLike, elevation: ArrayLike, frequency: ArrayLike, options: RcsOptions
) -> RcsTask:
    """The task of these arguments."""
    validation.instance("scene", scene, Scene)
    _refuse_random(scene)
    angles = [_angle("azimuth", azimuth), _angle("elevation", elevation)]
    if options.receiver is not None:
        pair = options.receiver
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise ValueError(f"receiver is {shown(pair)}; give (azimuth, elevation), rad")
        angles += [_angle("receiver azimuth", pair[0]), _angle("receiver elevation", pair[1])]
    try:
        angles = list(np.broadcast_arrays(*angles))
    except ValueError:
        shapes = ", ".join(str(angle.shape) for angle in angles)
        raise ValueError(f"azimuth, elevation and receiver have shapes {shapes}, which do not broadcast") from None
    frequencies = validation.values("frequency", frequency)
    validation.finite("frequency", frequencies)
    if not (frequencies > 0).all():
        raise ValueError(f"frequency reaches {frequencies.min():g} Hz; it must be greater than 0")
    validation.carriers("frequency", frequencies)
    if frequencies.ndim > 1:
        raise ValueError(f"frequency has shape {frequencies.shape}; give one, or a list of them (n,)")
    if not angles[0].size or not frequencies.size:
        raise ValueError("rcs was given no directions or no frequencies; give at least one of each")
    to_tx = _directions(*angles[:2])
    to_rx = to_tx if options.receiver is None else _directions(*angles[2:])
    asked = options.polarization
    names = (asked,) if isinstance(asked, str) else tuple(asked)
    shape = (*angles[0].shape, *frequencies.shape, *(() if isinstance(asked, str) else (len(names),)))
    if np.array_equal(to_tx, to_rx):
        to_rx = to_tx
    return RcsTask(options, scene, to_tx, to_rx, np.atleast_1d(frequencies), names, shape)


def _directions(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    """Unit vectors (n, 3) from azimuth and elevation, rad."""
    a, e = azimuth.ravel(), elevation.ravel()
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)


def _angle(name: str, value: ArrayLike) -> np.ndarray:
    """Angles, rad, of any shape; ValueError for degrees."""
    angle = validation.values(name, value)
    validation.finite(name, angle)
    most = np.pi / 2 * (1 + 1e-9) if name.endswith("elevation") else MOST_AZIMUTH
    if angle.size and not np.abs(angle).max() <= most:
        raise ValueError(
            f"{name} reaches {angle.flat[np.abs(angle).argmax()]:g} rad, beyond {most:.4g}; angles are in radians: "
            "give np.radians(...) of degrees"
        )
    return angle


def _refuse_random(scene: Scene) -> None:
    """ValueError for surfaces whose echo is random: its cells follow from a radar's resolution."""
    if scene.has_random_points:
        raise ValueError("the scene has point_roughness; call scene.realized(seed) first")
    if len(scene.triangles) and random(scene).any():
        row = int(np.argmax(random(scene)))
        raise ValueError(
            f"facet {row} has a random echo (roughness, or a diagram of its material): its cells follow from the "
            "resolution of a radar, which rcs has not; use echo, or give roughness=0 and a smooth material"
        )
