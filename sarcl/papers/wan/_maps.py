"""Wan et al. 2004, figure 7: power sent back by each cell of the ground and of the slant plane."""

from __future__ import annotations

import numpy as np

from ...opencl.device import DeviceChoice
from ...scattering.facets import FacetSet
from ...scene.scene import Scene
from ...visibility.illumination import lit


def cut(scene: Scene, edge: float) -> Scene:
    """The scene with triangles whose edges are at most `edge`, m: small beside the cells of a map."""
    from trimesh.remesh import subdivide_to_size

    corners = scene.triangles.reshape(-1, 3)
    vertices, faces, origin = subdivide_to_size(
        corners, np.arange(len(corners)).reshape(-1, 3), edge, max_iter=20, return_index=True
    )
    return Scene.facets(
        vertices[faces], two_sided=scene.two_sided[origin], material=scene.material[origin], materials=scene.materials
    )


def backscatter(
    scene: Scene, position: np.ndarray, up: np.ndarray, frequency: float, device: DeviceChoice | None
) -> np.ndarray:
    """Expected power of each facet in HH towards an antenna at `position`, m (3,), over its lit share, m^2 (k,).

    up  (3,), unit vector: V lies in a plane with it;  frequency  Hz
    """
    k = len(scene.triangles)
    facets = FacetSet(
        scene.triangles, scene.reflectivity, scene.two_sided, scene.material, scene.materials, None, np.arange(k),
        np.ones(k, np.complex64),
    )  # fmt: skip
    amplitude = facets.amplitudes(position, position, np.array([frequency]), ("HH",), up)[0, :, 0]
    share = lit(scene.triangles, position[None], two_sided=scene.two_sided, device=device).fraction_at(0)
    return np.asarray(np.abs(amplitude) ** 2 * share)


def correlation(image: np.ndarray, power: np.ndarray, cells: int) -> float:
    """Correlation coefficient of the amplitudes of two maps of powers, averaged over squares of `cells` pixels."""
    n = [size // cells for size in image.shape]
    means = [
        np.sqrt(m[: n[0] * cells, : n[1] * cells].reshape(n[0], cells, n[1], cells).mean(axis=(1, 3))).ravel()
        for m in (image, power)
    ]
    return float(np.corrcoef(*means)[0, 1])
