"""Warnings with figures: the effect of flat facets in place of curves in dB, and the contrast of speckle."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference.facet import facet_amplitude
from sarcl.scattering.mesh_quality import facet_error, post_spacing, speckle_contrast
from sarcl.scattering.mesh_quality._adjacency import adjacency_of, uncut
from sarcl.scattering.mesh_quality._curvature import curvature_of
from sarcl.scene import triangles as geometry
from sarcl.scene.material import MATERIALS
from sarcl.scene.scene import Scene

CONDUCTOR = np.array(np.inf + 0j)
POLE, SIDE, OBLIQUE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.3, 0.5, 0.8124)
ISOTROPIC = sarcl.Material(4.0, diagram="isotropic")


def antennas(tx, rx=None, near=-1e9, far=1e9):
    tx = np.atleast_2d(np.asarray(tx, float))
    n = len(tx)
    return PulseGeometry(
        tx=tx, rx=tx if rx is None else rx, reference_range=np.linalg.norm(tx, axis=1), frequency=np.full(n, 1e10),
        frequency_step=np.full(n, 1e6), near=np.full(n, near), far=np.full(n, far),
    )  # fmt: skip


def from_afar(direction):
    return antennas(1e7 * np.asarray(direction) / np.linalg.norm(direction))


def arc(elevation, first, last, n=64, distance=1e5):
    azimuth = np.linspace(first, last, n)
    cosine = np.cos(elevation)
    return distance * np.stack(
        [cosine * np.cos(azimuth), cosine * np.sin(azimuth), np.full(n, np.sin(elevation))], axis=1
    )


def narrow(frequency):
    return sarcl.Waveform.chirp(center=frequency, bandwidth=1e-6 * frequency, duration=1e-6)


def at_size(ka):
    """A wave whose wavenumber is ka, for bodies of radius 1 m."""
    return narrow(ka * SPEED_OF_LIGHT / (2 * np.pi))


X_BAND = sarcl.Waveform.chirp(center=9.6e9, bandwidth=3e8, duration=1e-6)


def grid_of(surface):
    """Triangles of a grid of points (n, m, 3), without those that have no area."""
    triangles = geometry.of_grid(surface)
    return triangles[geometry.solid(triangles)]


def latitudes(n):
    """A sphere of radius 1 m, n latitudes by 2 n longitudes, poles on z."""
    theta, phi = np.linspace(0, np.pi, n + 1)[:, None], np.linspace(0, 2 * np.pi, 2 * n + 1)
    phi[-1] = 0
    surface = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi], axis=-1)
    surface[0], surface[-1] = POLE, (0.0, 0.0, -1.0)
    return grid_of(surface)[:, ::-1]


def sphere(mesh, n):
    return Scene.facets(latitudes(n), two_sided=False) if mesh == "latitudes" else shapes.sphere(1.0, facets=4 * n * n)


def exact_sphere(ka):
    """Radar cross section of a conducting sphere of 1 m by physical optics, m^2 (test_sphere_echo.py)."""
    b = 2 * ka
    return np.pi * abs(1 + 1j / b * (1 - np.exp(-1j * b))) ** 2


def facet_sum(triangles, frequency, to_tx, to_rx=None):
    """Radar cross section of facets in plane waves, m^2, by the reference."""
    to_tx = np.asarray(to_tx) / np.linalg.norm(to_tx)
    to_rx = to_tx if to_rx is None else np.asarray(to_rx) / np.linalg.norm(to_rx)
    a = facet_amplitude(triangles, CONDUCTOR, frequency, to_tx, to_rx)[:, 0, 0]
    q = 2 * np.pi * frequency / SPEED_OF_LIGHT * (to_tx + to_rx)
    return abs((a * np.exp(1j * triangles.mean(axis=1) @ q)).sum()) ** 2


def test_the_sphere_of_truth_warns_with_what_it_errs():
    # ka 50, 50 latitudes, seen pole-on: -3.85 dB, though its facets are within 0.004 wavelengths of it: edges of half a
    # wavelength towards the rim add up in phase
    body, wave = sphere("latitudes", 50), at_size(50)
    actual = 10 * np.log10(facet_sum(body.triangles, wave.center, POLE) / exact_sphere(50))
    found = facet_error.judge(body, from_afar(POLE), wave)
    assert actual == pytest.approx(-3.85, abs=0.01)
    assert found.error_db == pytest.approx(abs(actual), rel=0.05)
    assert found.edge == pytest.approx(np.pi / 50, rel=0.01) and found.radius == pytest.approx(1, rel=1e-3)
    assert found.standoff == pytest.approx(1 - np.cos(np.pi / 100), rel=0.01)
    (text,) = found.warnings()
    assert "up to 3.8 dB" in text and "0.063 m" in text and f"at most {found.needed:.2g} m" in text
    assert found.describe() == {"flat for curved, dB": pytest.approx(3.84, abs=0.1)}


@pytest.mark.parametrize("mesh", ["latitudes", "geodesic"])
@pytest.mark.parametrize("ka", [10, 20, 50, 100])
def test_what_spheres_err_is_predicted(ka, mesh):
    # 4 numbers of latitudes from the coarse to the fine, each from three sides: within 0.15 dB and 15 %
    for n in (10, 20, 36, 72):
        body, wave = sphere(mesh, n), at_size(ka)
        for direction in (POLE, SIDE, OBLIQUE):
            actual = abs(10 * np.log10(facet_sum(body.triangles, wave.center, direction) / exact_sphere(ka)))
            predicted = facet_error.judge(body, from_afar(direction), wave).error_db
            if predicted:
                assert abs(predicted - actual) < 0.15 + 0.15 * actual or min(predicted, actual) > 5
            else:  # edges so fine that no test is needed
                assert actual < 0.1


def test_a_fine_sphere_does_not_warn():
    for ka, n in ((10, 36), (50, 100)):
        for mesh in ("latitudes", "geodesic"):
            found = facet_error.judge(sphere(mesh, n), from_afar(POLE), at_size(ka))
            assert found.error_db < 0.2 and found.warnings() == []


def test_edges_as_advised_do_not_warn():
    for ka in (20, 50, 100):
        wave = at_size(ka)
        coarse = facet_error.judge(sphere("latitudes", 20), from_afar(POLE), wave)
        assert coarse.warnings()
        fine = sphere("latitudes", int(np.ceil(np.pi / coarse.needed)))
        assert facet_error.judge(fine, from_afar(POLE), wave).warnings() == []


def tube(sections, top=0.5):
    phi = np.linspace(0, 2 * np.pi, sections + 1)
    phi[-1] = 0
    rings = [np.stack([r * np.cos(phi), r * np.sin(phi), 0 * phi + z], axis=-1) for r, z in ((0.5, 0.0), (top, 1.0))]
    return grid_of(np.stack(rings))


def ellipsoid(n, random):
    """n points spread over an ellipsoid, evenly or not, and the triangles of their hull."""
    from scipy.spatial import ConvexHull

    i = np.arange(n) + 0.5
    phi, cosine = np.pi * (1 + 5**0.5) * i, 1 - 2 * i / n
    sine = np.sqrt(1 - cosine**2)
    points = np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)
    points += random * np.random.default_rng(1).normal(size=points.shape) / np.sqrt(n)
    points /= np.linalg.norm(points, axis=1)[:, None]
    triangles = points[ConvexHull(points).simplices] * (1.0, 0.6, 0.4)
    inwards = (geometry.normals(triangles) * triangles.mean(axis=1)).sum(axis=1) < 0
    triangles[inwards] = triangles[inwards, ::-1]
    return triangles


BODIES = {
    "cylinder, 16 sections": (tube(16), tube(1440), 0.0),
    "cylinder, 36 sections": (tube(36), tube(1440), 0.0),
    "cylinder, 288 sections": (tube(288), tube(1440), 0.0),
    "frustum, 36 sections": (tube(36, 0.2), tube(1440, 0.2), np.arctan(0.3)),
    "cone, 36 sections": (tube(36, 0.0), tube(1440, 0.0), np.arctan(0.5)),
    "ellipsoid, 600 even facets": (ellipsoid(302, 0), ellipsoid(20000, 0), 0.5),
    "ellipsoid, 2000 uneven facets": (ellipsoid(1002, 0.5), ellipsoid(20000, 0), 0.5),
}


@pytest.mark.parametrize("name", BODIES)
def test_what_other_bodies_err_is_predicted(name):
    # where they are specular: the facet sum against that of a body ten times as fine, within 0.3 dB or 25 %
    coarse, fine, elevation = BODIES[name]
    for azimuth in (0.05, 0.12):
        way = arc(elevation, azimuth, azimuth, 1)
        levels = [facet_sum(t, 10e9, way[0]) for t in (coarse, fine)]
        predicted = facet_error.judge(Scene.facets(coarse, two_sided=False), antennas(100 * way), narrow(10e9)).error_db
        assert predicted == pytest.approx(abs(10 * np.log10(levels[0] / levels[1])), rel=0.25, abs=0.3)


def test_every_pulse_of_a_short_track_is_looked_from():
    # from the pole and from two sides: rms of 3.84, 0.7 and 0.7 dB by their powers, and the worst of them
    looks = 1e7 * np.array([POLE, SIDE, (0.0, 1.0, 0.0)])
    found, alone = (facet_error.judge(sphere("latitudes", 50), antennas(a), at_size(50)) for a in (looks, looks[:1]))
    assert alone.worst_db == pytest.approx(alone.error_db, rel=1e-3)
    assert found.worst_db == pytest.approx(alone.error_db, rel=1e-3)
    assert 1.8 < found.error_db < 2.4


def test_bistatic_and_aperture_errors_are_weighted_means():
    way, other = arc(0.5, 0.0, 0.2, 16, 1e7), arc(0.3, 0.9, 1.0, 16, 1e7)
    coarse, fine = ellipsoid(302, 0.5), ellipsoid(20000, 0)
    pairs = [[facet_sum(t, 10e9, a, b) for t in (coarse, fine)] for a, b in zip(way, other, strict=True)]
    flat, curved = np.array(pairs).T
    actual = np.sqrt(((flat + curved) * (10 * np.log10(flat / curved)) ** 2).sum() / (flat + curved).sum())
    found = facet_error.judge(Scene.facets(coarse, two_sided=False), antennas(way, other), narrow(10e9))
    assert found.error_db == pytest.approx(actual, rel=0.25)


def roof(pitch):
    x, y = np.array([0.0, 1.0, 2.0]), np.linspace(0, 4, 9)
    return Scene.from_heights(x, y, np.tile(pitch * np.array([0.0, 1.0, 0.0]), (9, 1)))


def rounded_box():
    """A box with corners rounded off in three steps: its sides are planes, however the corners tilt their edges."""
    turn = np.linspace(0, np.pi / 2, 4)
    middles = ((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))
    ring = [
        (x + 0.02 * np.cos(i * np.pi / 2 + t), y + 0.02 * np.sin(i * np.pi / 2 + t), z)
        for z in (0.0, 2.0) for i, (x, y) in enumerate(middles) for t in turn
    ]  # fmt: skip
    rings = np.array(ring).reshape(2, 16, 3)
    return Scene.facets(grid_of(np.concatenate([rings, rings[:, :1]], axis=1)), two_sided=False)


FLAT = {
    "plate": shapes.plate((2.0, 1.0), edge=0.1), "box": shapes.box((1.0, 2.0, 3.0)), "pyramid":
    shapes.frustum(1.0, 0.2, 1.0, sections=4), "hexagonal prism": shapes.cylinder(1.0, 2.0, sections=6),
    "disc": shapes.disc(1.0), "flat roof": roof(0.1), "roof": roof(0.5), "cut box": shapes.box((1, 1, 1), edge=0.05),
    "dihedral": shapes.plate((1.0, 1.0)) + shapes.plate((1.0, 1.0), rotation=(0.0, np.pi / 2, 0.0),
                                                        position=(0.5, 0.0, 0.5)),
}  # fmt: skip


@pytest.mark.parametrize("name", FLAT)
def test_flat_bodies_with_edges_are_what_they_are(name):
    for elevation in (0.0, 0.5, 1.5):
        assert facet_error.judge(FLAT[name], antennas(arc(elevation, -0.2, 0.2)), X_BAND) == facet_error.FacetError()


def test_a_plane_between_rounded_corners_stays_a_plane():
    triangles = rounded_box().triangles
    found = curvature_of(triangles, np.zeros(len(triangles), bool), adjacency_of(triangles))
    wide = np.abs(found.edge[:, :, :2]).max(axis=(1, 2)) > 1
    assert wide.sum() == 8 and (found.height[wide] == 0).all()
    # of three steps of 30 deg the middle one has neighbours like itself: 0.02 m (1 - cos 15 deg)
    np.testing.assert_allclose(found.height.max(), 0.02 * (1 - np.cos(np.pi / 12)), rtol=0.02)


def test_relief_is_not_taken_for_curves():
    x, rng = np.arange(0.0, 640.0, 10.0), np.random.default_rng(3)
    k = np.hypot(*np.meshgrid(*[np.fft.fftfreq(64)] * 2))
    k[0, 0] = 1
    for fall in (0, 1, 2):  # white noise, and mountains
        z = np.fft.ifft2(np.fft.fft2(rng.normal(size=k.shape)) * k**-fall).real
        for slope in (0.02, 0.2, 0.6):
            ground = Scene.from_heights(x, x, z * 10 * slope / np.diff(z).std())
            assert facet_error.judge(ground, antennas(arc(1.3, -0.1, 0.1)), X_BAND).judged == 0


def test_cutting_flat_facets_hides_nothing():
    for body, direction in ((sphere("latitudes", 20), POLE), (sphere("geodesic", 8), OBLIQUE)):
        whole, cut = (facet_error.judge(b, from_afar(direction), at_size(50)) for b in (body, body.split(0.05)))
        assert cut.error_db == pytest.approx(whole.error_db, rel=0.02) and cut.edge == pytest.approx(
            whole.edge, rel=0.3
        )
    plain, cut = shapes.cylinder(1.0, 2.0, sections=24), shapes.cylinder(1.0, 2.0, sections=24).split(0.1)
    levels = [facet_error.judge(b, antennas(arc(0.0, -0.1, 0.1)), X_BAND).error_db for b in (plain, cut)]
    assert levels[0] > 0.5 and levels[1] == pytest.approx(levels[0], rel=0.02)


def test_uncut_keeps_the_surface():
    # corners on a rim stay
    for body, least in (
        (shapes.box((1.0, 2.0, 3.0)), 12),
        (shapes.cylinder(1.0, 1.0), 284),
        (shapes.plate((1, 1)), 24),
    ):
        cut = body.split(0.2).triangles
        made, stands = uncut(cut, adjacency_of(cut), np.zeros(len(cut), int))
        assert len(made) == least
        assert geometry.areas(made).sum() == pytest.approx(geometry.areas(cut).sum())
        np.testing.assert_allclose(geometry.normals(made), geometry.normals(cut)[stands], atol=1e-9)
    x = np.arange(6.0)
    both = shapes.plate((1.0, 1.0)).split(0.1).triangles
    halves = (both.mean(axis=1)[:, 0] > 0).astype(int)  # of two kinds
    made, stands = uncut(both, adjacency_of(both), halves)
    areas = np.bincount(halves[stands], geometry.areas(made))
    np.testing.assert_allclose(areas, np.bincount(halves, geometry.areas(both)))
    hole = Scene.from_heights(x, x, np.zeros((6, 6))).triangles
    middle = hole.mean(axis=1)
    hole = hole[(np.abs(middle[:, :2] - 2.5) > 0.5).any(axis=1)]  # no convex outline
    kept = uncut(hole, adjacency_of(hole), np.zeros(len(hole), int))
    assert kept is None or geometry.areas(kept[0]).sum() == pytest.approx(24)


def test_order_winding_and_rubbish_do_not_matter():
    rng, body = np.random.default_rng(5), sphere("geodesic", 8).triangles
    judge = lambda t, two: facet_error.judge(Scene.facets(t, two_sided=two), from_afar(OBLIQUE), at_size(50))  # noqa: E731
    plain = judge(body, True).error_db
    assert plain > 0.3
    mixed = body[rng.permutation(len(body))]
    mixed[::2] = mixed[::2, ::-1]  # half of them turned round
    needle = np.array([[[0.0, 0.0, 3.0], [0.1, 0.0, 3.0], [0.05, 1e-9, 3.0]]])
    fin = np.array([body[0] * 1.0, body[0] * 1.0])
    fin[1, 2] *= 2  # an edge of three facets
    for rubbish in (body[:0], needle, body[3:4], fin[1:]):
        assert judge(np.concatenate([mixed, rubbish]), True).error_db == pytest.approx(plain, rel=0.5, abs=0.1)
    assert judge(mixed, True).error_db == pytest.approx(plain, rel=1e-3)
    shaken = mixed + 1e-10 * rng.normal(size=mixed.shape)  # corners that are one but for rounding
    assert judge(shaken, True).error_db == pytest.approx(plain, rel=1e-3)


def test_only_what_the_radar_sees_counts():
    body, wave = sphere("latitudes", 50), at_size(50)
    inside_out = Scene.facets(body.triangles[:, ::-1], two_sided=False)
    far_side = body.part(body.triangles.mean(axis=1)[:, 2] < -0.1)
    assert (
        facet_error.judge(inside_out.part(inside_out.triangles.mean(axis=1)[:, 2] > 0), from_afar(POLE), wave).judged
        == 0
    )
    assert facet_error.judge(far_side, from_afar(POLE), wave).judged == 0
    out_of_window = antennas([0.0, 0.0, 1e7], near=10.0, far=20.0)
    assert facet_error.judge(body, out_of_window, wave).judged == 0
    beam = {"beam": np.array([[0.0, 0.0, -1.0]]), "beam_angle": 1e-5}
    assert facet_error.judge(body, replace(from_afar(POLE), **beam), wave).error_db == pytest.approx(3.84, abs=0.05)
    beside = {"beam": np.array([[0.0, 1.0, 0.0]]), "beam_angle": 1e-5}
    assert facet_error.judge(body, replace(from_afar(POLE), **beside), wave).judged == 0
    assert facet_error.judge(Scene.points([[0.0, 0, 0]]), from_afar(POLE), wave) == facet_error.FacetError()
    black = replace(body, reflectivity=np.zeros(len(body.triangles)))
    assert facet_error.judge(black, from_afar(POLE), wave) == facet_error.FacetError()
    # cylinders without a specular echo from their sides are not judged by the remaining echo
    assert facet_error.judge(shapes.cylinder(1.0, 2.0), antennas(arc(0.7, 0, 0.2)), X_BAND).warnings() == []


def test_rough_surfaces_lose_their_mirror_and_its_error():
    wave = at_size(50)
    wavelength = SPEED_OF_LIGHT / wave.center

    def judged(**options):
        return facet_error.judge(Scene.facets(latitudes(50), two_sided=False, **options), from_afar(POLE), wave)

    smooth = judged()
    assert judged(material="concrete").error_db == pytest.approx(smooth.error_db, rel=1e-3)
    root = np.sqrt(complex(MATERIALS["concrete"].permittivity(wave.center)))
    share = judged(material="concrete").rcs / smooth.rcs
    assert share == pytest.approx(abs((1 - root) / (1 + root)) ** 2, rel=1e-3)
    assert judged(material=ISOTROPIC) == facet_error.FacetError()
    rough = [judged(material=sarcl.Material(diagram="isotropic", height=h * wavelength)).error_db
             for h in (0.0, 0.1, 1.0)]  # fmt: skip
    assert rough[0] == pytest.approx(smooth.error_db) and rough[0] > rough[1] > rough[2] and rough[2] < 0.05
    assert judged(roughness=wavelength).error_db < 0.3  # towards the rim q.n is small, and some mirror is left
    corners = geometry.normals(latitudes(50))[:, None] * np.full((1, 3, 1), wavelength)
    assert judged(point_roughness=corners).error_db < 0.3


def test_incoherent_power_of_a_rough_sphere_is_lambert():
    body = Scene.facets(latitudes(40), two_sided=False, material=sarcl.Material(diagram="isotropic", height=10.0))
    found = facet_error.judge(body, from_afar(POLE), at_size(50))
    # sigma0 = 4 cos^2 per area: integral over the lit half of 4 cos^2 2 pi sin = 8 pi/3
    assert found.rcs == pytest.approx(8 * np.pi / 3, rel=0.01) and found.error_db < 0.01


def test_meshes_of_every_kind_are_judged(data_folder):
    files = sorted((data_folder / "meshes" / "gazebo_vehicles_CC-BY-3.0").glob("*.obj"))
    assert files
    for file in files[:3]:
        body = Scene.from_mesh(file, scale=0.0254)
        found = facet_error.judge(body, antennas(arc(0.5, 1.5, 1.6, distance=1e4)), X_BAND)
        # wheels and wings of 10 to 30 cm facets at 3 cm: a large error is expected
        assert found.warnings() and found.radius < 10 and 0.02 < found.edge < 2


def test_invalid_arguments_are_named():
    body, wave, here = sphere("geodesic", 4), at_size(10), from_afar(POLE)
    for judge in (facet_error.judge, speckle_contrast.judge):
        with pytest.raises(TypeError, match=r"scene is a ndarray; wanted a sarcl\.Scene"):
            judge(body.triangles, here, wave)
        with pytest.raises(TypeError, match="antennas is a NoneType"):
            judge(body, None, wave)
        with pytest.raises(TypeError, match="waveform is a float"):
            judge(body, here, 1e10)


def added_up(s1, s2, rayleigh, runs=1000, pixels=100):
    """Intensities (pixels, runs) of sums of sinc responses of triangles, two to a parallelogram of s1 x s2 cells."""
    rng = np.random.default_rng(2)
    reach = [max(7.0, 3 * s) for s in (s1, s2)]
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-r, r + s, s) for r, s in zip(reach, (s1, s2), strict=True)]))
    x, y = np.concatenate([x, x + s1 / 3]), np.concatenate([y, y - s2 / 3])
    px, py = rng.random((2, pixels, 1)) * [[[s1]], [[s2]]]
    a = np.exp(2j * np.pi * rng.random((len(x), runs)))
    if rayleigh:
        a = rng.normal(size=a.shape) + 1j * rng.normal(size=a.shape)
    return np.abs((np.sinc(px - x) * np.sinc(py - y)) @ a) ** 2


def ground(pitch, half=15.0, **options):
    x = np.arange(-half, half + pitch / 2, pitch)
    return Scene.from_heights(x, x, np.zeros((len(x), len(x))), **options)


SIGHT = arc(0.6, -0.015, 0.015, 161, 2e4)
GROUND_CELL = (  # m: of the ground, per resolution cell
    SPEED_OF_LIGHT / (2 * X_BAND.bandwidth * np.cos(0.6)),
    SPEED_OF_LIGHT / (2 * X_BAND.center * np.cos(0.6) * 2 * np.sin(0.015)),
)


@pytest.mark.parametrize("rayleigh", [False, True])
@pytest.mark.parametrize("cells", [0.5, 0.9, 1.4, 2.5])
def test_the_contrast_is_that_of_facets_added_up(cells, rayleigh):
    # squares of `cells` resolution cells on the ground; the error of a contrast from 28000 pixels is about 0.02 to 0.04
    intensity = added_up(cells, cells, rayleigh)
    pitch = cells * np.array(GROUND_CELL)
    x, y = (np.arange(-16.0, 17.0) * p for p in pitch)
    options = {"material": ISOTROPIC} if rayleigh else {"roughness": 0.05}
    found = speckle_contrast.judge(Scene.from_heights(x, y, np.zeros((33, 33)), **options), antennas(SIGHT), X_BAND)
    assert found.contrast == pytest.approx(intensity.std() / intensity.mean(), rel=0.04)
    assert found.per_cell == pytest.approx(2 / cells**2, rel=0.01)


def test_few_facets_a_cell_warn_with_number_and_remedy():
    for pitch, options in ((0.7, {"roughness": 0.05}), (1.5, {"material": ISOTROPIC})):
        scene = ground(pitch, **options)
        (text,) = speckle_contrast.judge(scene, antennas(SIGHT), X_BAND).warnings()
        found = speckle_contrast.judge(scene, antennas(SIGHT), X_BAND)
        assert f"{found.per_cell:.2g} rough ones per resolution cell" in text and f"{found.contrast:.2f}" in text
        assert ("holes" in text) == ("material" in options)
        assert found.describe() == {"rough facets per resolution cell": pytest.approx(found.per_cell, rel=0.05)}
        cut = speckle_contrast.judge(scene.split(found.needed), antennas(SIGHT), X_BAND)
        assert cut.warnings() == [] and cut.contrast == pytest.approx(1, abs=0.05)


def test_smooth_and_hidden_facets_make_no_speckle_to_judge():
    assert speckle_contrast.judge(ground(1.5), antennas(SIGHT), X_BAND) == speckle_contrast.Speckle()
    assert speckle_contrast.judge(ground(1.5, roughness=5e-4), antennas(SIGHT), X_BAND) == speckle_contrast.Speckle()
    below = replace(ground(1.5, roughness=0.05), two_sided=np.zeros(800, bool))
    assert speckle_contrast.judge(below, antennas(SIGHT), X_BAND).facets == 800
    assert speckle_contrast.judge(below, antennas(SIGHT * (1, 1, -1)), X_BAND) == speckle_contrast.Speckle()
    assert speckle_contrast.judge(Scene.points([[0.0, 0, 0]]), antennas(SIGHT), X_BAND) == speckle_contrast.Speckle()
    assert speckle_contrast.Speckle().warnings() == [] and speckle_contrast.Speckle().describe() == {}


def test_without_resolution_every_facet_shares_a_cell():
    scene = ground(1.5, roughness=0.05)
    once = speckle_contrast.judge(scene, antennas(SIGHT[:1]), X_BAND)  # one pulse: rows of cells
    rows = 30 * np.cos(0.6) / once.cell[0]
    assert once.cell[1] == np.inf and once.per_cell == pytest.approx(800 / rows, rel=0.02)
    assert once.contrast == pytest.approx(np.sqrt(1 - 2 / 3 / once.per_cell)) and once.warnings() == []
    small = speckle_contrast.judge(ground(0.1, 0.15, roughness=0.05), antennas(SIGHT), X_BAND)
    assert small.per_cell == small.facets == 18 and small.contrast == pytest.approx(np.sqrt(1 - 1 / 18))
    lone = speckle_contrast.judge(ground(0.1, 0.05, roughness=0.05), antennas(SIGHT), X_BAND)
    assert lone.contrast == pytest.approx(np.sqrt(1 / 2)) and lone.warnings()
    at_centre, forward = np.zeros((1, 3)), antennas([[1e4, 0, 0]], np.array([[-1e4, 0.0, 0]]))
    assert speckle_contrast.judge(scene, antennas(at_centre), X_BAND) == speckle_contrast.Speckle()
    assert speckle_contrast.judge(scene, forward, X_BAND) == speckle_contrast.Speckle()


def test_echo_warns_of_a_coarse_mesh_and_reports_its_error():
    body, wave = sphere("latitudes", 50), at_size(50)
    track = sarcl.Trajectory([0.0], [[0.0, 0.0, 1e7]])
    with pytest.warns(sarcl.SarclWarning, match="mesh too coarse for the wavelength") as found:
        raw = sarcl.echo(body, wave, track, shadows=False, tolerance=1e-2)
    assert found[0].filename == __file__
    assert raw.report.plan["flat for curved, dB"] == pytest.approx(3.84, abs=0.1)
    level = 20 * np.log10(np.abs(raw.samples).mean()) - 10 * np.log10(exact_sphere(50))
    assert level == pytest.approx(-3.85, abs=0.05)


def test_echo_warns_of_too_few_facets_only_where_it_may_not_cut_them():
    coarse = ground(2.0, material=ISOTROPIC)
    track = sarcl.Trajectory(np.arange(len(SIGHT)) / 100.0, SIGHT)
    with pytest.warns(sarcl.SarclWarning, match="too few facets for speckle"):
        sarcl.echo(coarse, X_BAND, track, max_edge=None, tolerance=1e-2, shadows=False)
    raw = sarcl.echo(coarse, X_BAND, track, tolerance=1e-2, shadows=False)
    assert raw.report.plan["rough facets per resolution cell"] >= 2


@pytest.mark.parametrize(("spacing", "is_shown"), [(2.0, True), (0.8, True), (0.5, False)])
def test_posts_that_are_resolved_show_as_a_grid_and_are_told(spacing, is_shown):
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=300e6, duration=1e-6)
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, arc=0.024, n_pulses=64)  # cells of 0.5 m x 0.65 m
    x = np.arange(-16, 16.01, spacing)
    scene = sarcl.Scene.from_heights(x, x, np.zeros((len(x), len(x))), point_roughness=0.05)
    judged = post_spacing.judge(scene, PulseGeometry(track.positions, track.positions), chirp)
    assert judged.cell == pytest.approx((0.5, 0.81), rel=0.05) and judged.spacing == pytest.approx(spacing)
    with pytest.warns(sarcl.SarclWarning, match="posts will show as a grid") if is_shown else nullcontext():
        raw = sarcl.echo(scene, chirp, track, tolerance=1e-1)
    power = np.abs(sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=128, spacing=0.2), tolerance=1e-2).data) ** 2
    spectrum = np.abs(np.fft.fft2(power / power.mean() - 1)) ** 2
    line = spectrum[0, round(128 * 0.2 / spacing)]  # along x, the coordinate of range
    assert (line > 100 * np.median(spectrum)) == is_shown
