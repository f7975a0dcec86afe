"""From a scene to what a kernel adds up: points, and facets cut, moved, lit and weighed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import scene as scenes
from .check import SPEED_OF_LIGHT, number
from .geometry import Antennas
from .scene import Scene
from .shadow import visible
from .waveform import Waveform


@dataclass(frozen=True, eq=False)
class Scatterers:
    """Points, m (n, 3), with complex amplitudes (n,), or with normals (n, 3), strengths and two_sided (n,)."""

    positions: np.ndarray
    amplitudes: np.ndarray | None = None
    normals: np.ndarray | None = None
    strengths: np.ndarray | None = None
    two_sided: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def has_normals(self) -> bool:
        """True for facets."""
        return self.normals is not None

    def largest(self) -> float:
        """Largest amplitude there can be."""
        values = self.amplitudes if self.amplitudes is not None else self.strengths
        assert values is not None
        return float(np.abs(values).max())

    def planes(self, order: np.ndarray) -> np.ndarray:
        """Rows of numbers as kernels/echo.cl reads them, float32, in `order`; repeats at its end are blank."""
        if self.amplitudes is not None:
            out = np.stack([self.amplitudes.real, self.amplitudes.imag])[:, order]
        else:
            assert self.strengths is not None and self.normals is not None
            out = np.concatenate([[self.strengths, self.two_sided], self.normals.T])[:, order]
        out[0, len(self) :] = 0
        if self.amplitudes is not None:
            out[1, len(self) :] = 0
        return out.astype(np.float32)

    def seen_by(self, tx: np.ndarray, rx: np.ndarray) -> np.ndarray:
        """Complex amplitudes for one antenna pair, m (3,): the float64 twin of the kernel's."""
        if self.amplitudes is not None:
            return self.amplitudes
        from .reference.echo import facet_amplitudes

        assert self.normals is not None and self.strengths is not None and self.two_sided is not None
        return facet_amplitudes(self.positions, self.normals, self.strengths, self.two_sided, tx, rx)


def prepare(
    scene: Scene,
    waveform: Waveform,
    antennas: Antennas,
    *,
    shadows: bool,
    seed: int,
    skips: set[str],
    max_edge: float | str | None,
    device: Any,
    tell: Callable[[int], object] | None = None,
) -> tuple[list[Scatterers], dict[str, int]]:
    """The scene's points and facets, ready to spread, and what was left out: reason -> pairs with pulses.

    tell is called with 1, 2, 3 when facets are cut, culled and lit.
    """
    step = tell or (lambda n: None)
    n_pulses = len(antennas.tx)
    left_out = {"zero reflectivity": 0, "facing away": 0, "shadowed": 0}
    parts = []
    if len(scene.positions):
        keep = scene.amplitudes != 0 if "zero reflectivity" in skips else np.ones(len(scene.positions), bool)
        left_out["zero reflectivity"] += int((~keep).sum()) * n_pulses
        if keep.any():
            parts.append(Scatterers(scene.positions[keep], amplitudes=scene.amplitudes[keep]))
    if len(scene.triangles):
        edge = resolution_edge(waveform, antennas, scene) if max_edge == "auto" else max_edge
        if edge is not None:
            scene = scene.split(number("max_edge", edge, above=0))
        step(1)
        normals = scenes.normals(scene.triangles)
        centers = scenes.centroids(scene.triangles)
        centers += (random_heights(centers, seed) * scene.roughness)[:, None] * normals
        keep = np.ones(len(centers), bool)
        if "zero reflectivity" in skips:
            keep &= scene.reflectivity != 0
            left_out["zero reflectivity"] += int((~keep).sum()) * n_pulses
        if "facing away" in skips:
            away = keep & ~scene.two_sided & faces_away(centers, normals, antennas)
            left_out["facing away"] = int(away.sum()) * n_pulses
            keep &= ~away
        step(2)
        if shadows:
            dark = keep & ~_seen(scene.triangles, antennas, device)
            left_out["shadowed"] = int(dark.sum()) * n_pulses
            keep &= ~dark
        step(3)
        if keep.any():
            strength = 2 * np.sqrt(np.pi) * waveform.center / SPEED_OF_LIGHT
            parts.append(
                Scatterers(
                    centers[keep],
                    normals=normals[keep],
                    strengths=strength * (scene.reflectivity * scenes.areas(scene.triangles))[keep],
                    two_sided=scene.two_sided[keep],
                )
            )
    return parts, left_out


def random_heights(centers: np.ndarray, seed: int) -> np.ndarray:
    """Standard normal numbers (k,) that depend on the seed and each facet's own place, m (k, 3), alone.

    Neither order nor neighbours matter: adding a facet to a scene leaves the others as they were. Two hashes of the
    place to a micrometre (splitmix64, Steele, Lea and Flood 2014) give one number by Box and Muller.
    """
    with np.errstate(over="ignore"):
        state = np.full(len(centers), (seed + 1) * 0x9E3779B97F4A7C15 % 2**64, np.uint64)
        for axis in np.rint(centers.T * 1e6).astype(np.int64).view(np.uint64):
            state = _mix(state ^ axis)
        first, second = _mix(state), _mix(state + np.uint64(0x9E3779B97F4A7C15))
    radius = np.sqrt(-2 * np.log((first >> np.uint64(11)).astype(np.float64) * 2.0**-53 + 2.0**-54))
    return radius * np.cos(2 * np.pi * (second >> np.uint64(11)).astype(np.float64) * 2.0**-53)


def _mix(x: np.ndarray) -> np.ndarray:
    """One step of splitmix64."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


def resolution_edge(waveform: Waveform, antennas: Antennas, scene: Scene) -> float:
    """Half the finer of range and cross-range resolution at the scene's centre, m."""
    look = np.zeros_like(antennas.tx)  # (u_T + u_R)/2, the gradient of half the path
    for ends in (antennas.tx, antennas.tx if antennas.rx is None else antennas.rx):
        distance = np.linalg.norm(ends - scene.center, axis=1, keepdims=True)
        if not distance.all():
            raise ValueError(
                f"an antenna stands at the scene's centre at pulse {int(np.argmin(distance))}, where no resolution can "
                "be told to cut facets to; pass max_edge=... in metres, or None"
            )
        look += (ends - scene.center) / distance / 2
    along = float(np.linalg.norm(look, axis=1).max())
    turn = float(np.linalg.norm(look - look[0], axis=1).max())
    range_cell = SPEED_OF_LIGHT / (2 * waveform.bandwidth * along) if along else np.inf
    cross_cell = SPEED_OF_LIGHT / (2 * waveform.center * turn) if turn else np.inf
    edge = min(range_cell, cross_cell) / 2
    if not np.isfinite(edge):
        raise ValueError("forward scattering resolves nothing to cut facets to; pass max_edge=... in metres, or None")
    return edge


def faces_away(centers: np.ndarray, normals: np.ndarray, antennas: Antennas) -> np.ndarray:
    """True (k,) for facets that face away from the transmitter, or from the receiver, at every pulse.

    n.u(p, x) <= n.u_mean + |u(p, x) - u_mean|: the last term is bounded over all pulses and the whole scene.
    """
    corners = scenes.box(centers)
    middle, radius = corners.mean(axis=0), float(np.linalg.norm(corners[1] - corners[0])) / 2
    out = np.zeros(len(centers), bool)
    for ends in (antennas.tx, antennas.tx if antennas.rx is None else antennas.rx):
        look = ends - middle
        distance = np.linalg.norm(look, axis=1)
        if distance.min() <= radius:
            continue  # inside the scene every direction is possible
        look = look / distance[:, None]
        mean = look.mean(axis=0)
        # a shift of the point by `radius` turns the direction by at most asin(radius/distance)
        spread = np.linalg.norm(look - mean, axis=1).max() + np.pi / 2 * radius / distance.min()
        out |= normals @ mean + spread < 0
    return out


def _seen(triangles: np.ndarray, antennas: Antennas, device: Any) -> np.ndarray:
    """Facets that both antennas see at mid-aperture."""
    middle = len(antennas.tx) // 2
    seen = visible(triangles, antennas.tx[middle], device=device)
    if antennas.rx is not None:
        seen &= visible(triangles, antennas.rx[middle], device=device)
    return seen
