"""Wan et al. 2004, section 7: frustum, cuboid and cylinder on rough ground, from orbit to image (figures 6 to 8)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...base import wgs84
from ...imaging.backproject import backproject
from ...imaging.range_doppler.range_doppler import range_doppler
from ...model.image_grid import ImageGrid
from ...model.orbit import Orbit
from ...model.waveform import Waveform
from ...opencl.device import DeviceChoice
from ...scattering.facets import FacetSet
from ...scene import shapes
from ...scene.material import Material
from ...scene.scene import Scene
from ...scene.triangles import centroids
from ...simulation.echo import echo
from ...visibility.illumination import lit
from ..far_radar import ground
from ..lab import Lab
from ..paper import Section

AVERAGED, ALIKE = 6, 0.7  # pixels along the sides of squares; least correlation that counts as very close
STONE = Material(eps_r=3.0, diagram="cos2")
CHIRP = Waveform.chirp(center=5.4e9, bandwidth=40e6, duration=10e-6)
SLANT, PRF = 1.05e6, 1700.0  # m: 45 deg of incidence; Hz
SCALE = 8.0  # of the solids; the paper gives no sizes
FOOT, CUBOID, TOP = (18.0, 12.0, 4.0), (14.0, 14.0, 6.0), (5.0, 6.0)  # radii and height; sides; radius and height
SIDES = (34.0, 50.0)  # half the ground along azimuth and range
LOOK: dict[str, Any] = {"floor_db": -30.0, "percentile": 99.5, "unit": "dB re the median", "equal": True}  # of pictures
PULSES, LOOKS, CELL = {True: 900, False: 1400}, {True: 2, False: 8}, 2.5  # m, cells of the ground


def section(lab: Lab) -> Section:
    """Figures 6 to 8."""
    out = Section.of("wan", "orbit")
    orbit = Orbit.kepler(7.17e6, 1e-3, 1.72, span=(-60.0, 60.0))  # m, rad: 800 km high
    origin = orbit.geolocate(0.0, SLANT, side="right")
    axes = _axes(orbit, origin)
    n = PULSES[lab.quick]
    track = orbit.trajectory(start=-(n / 2) / PRF, prf=PRF, n_pulses=n)
    seen = orbit.view(0.0, origin)
    height = SCALE * (FOOT[2] + CUBOID[2] + TOP[1])
    window = SCALE * (SIDES[1] + 5) + height
    grid = ImageGrid.plane(
        center=origin,
        shape=(int(2 * SCALE * SIDES[0] / 3), int(2 * SCALE * SIDES[1] / 3)),
        spacing=3.0,
        normal=axes[2],
        x_axis=axes[0],
    )
    power, first = np.zeros(grid.shape), None
    for seed in range(LOOKS[lab.quick]):
        scene = _scene(axes, origin, seed)
        raw = echo(
            scene, CHIRP, track, reference=origin, range_window=(-window, window), seed=seed,
            tolerance=1e-2, check=False, device=lab.device,
        )  # fmt: skip
        options: dict[str, Any] = {"window": "hamming", "tolerance": 1e-2, "device": lab.device}
        power += np.abs(np.asarray(backproject(raw, grid, check=False, **options).data)) ** 2
        if first is None:
            first, drawn = range_doppler(raw, side="right", check=True, **options), scene
    assert first is not None and first.report is not None and first.report.measured_error is not None
    apart = float(first.report.measured_error)
    out.states("range-Doppler image and backprojection of the same echoes", apart, apart < 1e-2)
    local = (np.asarray(first.grid.positions) - origin) @ axes.T
    _shadow(out, power, grid, float(np.tan(seen.incidence)))
    rate = float(seen.doppler_rate(CHIRP.center))
    out.keep(incidence_deg=float(np.degrees(seen.incidence)), doppler_rate_hz_per_s=rate, range_doppler_error=apart)
    out.say(incidence_deg=np.degrees(seen.incidence), rate=rate, width=2 * SCALE * FOOT[0])
    half = SCALE * SIDES[0], SCALE * SIDES[1]
    out.words = {"looks": LOOKS[lab.quick], "averaged": AVERAGED, "alike": ALIKE, "n_averaged": AVERAGED**2}
    ends = (-half[1], half[1]), (-half[0], half[0])
    out.picture("Backprojected on the ground", _db(power), *ends, **LOOK)
    rows = np.abs(local[:, local.shape[1] // 2, 1]) < half[0]
    columns = np.abs(local[local.shape[0] // 2, :, 0]) < half[1]
    image = np.abs(np.asarray(first.data)[rows][:, columns]) ** 2
    along, across = local[rows, local.shape[1] // 2, 1], local[local.shape[0] // 2, columns, 0]
    _maps_of_cells(out, lab, orbit, axes, origin, drawn, image, (along, across))
    out.picture("Range-Doppler image", _db(image), (across[0], across[-1]), (along[0], along[-1]), **LOOK)
    return out


def _maps_of_cells(
    out: Section, lab: Lab, orbit: Orbit, axes: np.ndarray, origin: np.ndarray, scene: Scene, image: np.ndarray,
    ground_places: tuple[np.ndarray, np.ndarray],
) -> None:  # fmt: skip
    """Figure 7: power of the facets in cells of the ground and of the slant plane, and figure 8 beside the latter.

    image          power of the range-Doppler image (rows, columns), whose pixels see the ground at
    ground_places  azimuth (rows,) and ground range (columns,), m
    """
    scene = cut(scene, CELL)
    middles = centroids(scene.triangles)
    power = backscatter(scene, orbit.positions(0.0), axes[2], CHIRP.center, lab.device)
    time, slant = orbit.locate(middles)
    on_flat = [origin + np.outer(x, axis) for x, axis in zip(ground_places, (axes[1], axes[0]), strict=True)]
    edges = _edges(orbit.locate(on_flat[0])[0]), _edges(orbit.locate(on_flat[1])[1])
    slant_map = np.histogram2d(time, slant, bins=edges, weights=power)[0]
    along, across = ((middles - origin) @ axes[i] for i in (1, 0))
    ground_map = np.histogram2d(along, across, bins=[_edges(places) for places in ground_places], weights=power)[0]
    ends = [(float(places[0]), float(places[-1])) for places in ground_places]
    for key, cells in (("on the ground", ground_map), ("in the slant plane", slant_map)):
        out.picture(f"Power of the facets in cells {key}", _db(cells), ends[1], ends[0], **LOOK)
    alike, unlike = (correlation(image, cells, AVERAGED) for cells in (slant_map, ground_map))
    holds = alike > max(ALIKE, unlike)
    out.states("range-Doppler image and the map of the slant plane", [alike, unlike], holds)


def _edges(places: np.ndarray) -> np.ndarray:
    """Edges of cells about places that increase or decrease (n,), increasing (n + 1,)."""
    places = np.sort(places)
    middles = (places[1:] + places[:-1]) / 2
    return np.concatenate([[2 * places[0] - middles[0]], middles, [2 * places[-1] - middles[-1]]])


def _axes(orbit: Orbit, origin: np.ndarray) -> np.ndarray:
    """Rows (3, 3): ground range away from the satellite, azimuth, up."""
    longitude, latitude, _ = wgs84.geodetic(origin)
    up = wgs84.up(longitude, latitude)
    away = origin - orbit.positions(0.0)
    away = away - (away @ up) * up
    away /= np.linalg.norm(away)
    return np.stack([away, np.cross(up, away), up])


def _scene(axes: np.ndarray, origin: np.ndarray, seed: int) -> Scene:
    """Solids on rough ground, Earth-fixed."""
    y, x = ((-SCALE * side, SCALE * side) for side in SIDES)
    cells = [round((end[1] - end[0]) / CELL) for end in (y, x)]
    plain = ground(y, x, cells, material=STONE, point_roughness=0.15)
    scene = plain.realized(seed)
    foot = shapes.frustum(SCALE * FOOT[0], SCALE * FOOT[1], SCALE * FOOT[2], sections=120, material=STONE)
    middle = shapes.box(tuple(SCALE * side for side in CUBOID), material=STONE).moved((0, 0, SCALE * FOOT[2]))
    base = SCALE * (FOOT[2] + CUBOID[2])
    top = shapes.cylinder(SCALE * TOP[0], SCALE * TOP[1], sections=120, material=STONE).moved((0, 0, base))
    triangles = np.concatenate([part.triangles for part in (scene, foot, middle, top)])
    two_sided = np.concatenate([part.two_sided for part in (scene, foot, middle, top)])
    return Scene.facets(triangles @ axes + origin, two_sided=two_sided, material=STONE)


def _shadow(out: Section, power: np.ndarray, grid: ImageGrid, tangent: float) -> None:
    """End of the cylinder's shadow behind the frustum."""
    assert grid.spacing is not None
    x = (np.arange(grid.shape[1]) - grid.shape[1] // 2) * grid.spacing[1]
    y = (np.arange(grid.shape[0]) - grid.shape[0] // 2) * grid.spacing[0]
    profile = power[np.abs(y) < 0.5 * SCALE * TOP[0]].mean(axis=0)
    end = SCALE * (TOP[0] + (FOOT[2] + CUBOID[2] + TOP[1]) * tangent)
    lit = profile[(x > end + 60) & (x < SCALE * SIDES[1] - 20)].mean()
    below = profile < lit / 2
    inside = np.flatnonzero(below & (x < end + 30))
    measured_end = float(x[inside[-1]] + grid.spacing[1] / 2)
    out.number("end of the cylinder's shadow", measured_end, expected=end)
    out.plot("Profile through the solids", [("mean over azimuth", x, 10 * np.log10(profile / lit))])


def _db(power: np.ndarray) -> np.ndarray:
    """dB over the median pixel, which is ground: the scale that figures 6 to 8 have in common."""
    return np.asarray(10 * np.log10(np.maximum(power, 1e-9 * power.max()) / np.median(power)))


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
