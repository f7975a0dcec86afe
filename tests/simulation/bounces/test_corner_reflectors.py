"""Echoes of corner reflectors and of a wall on ground against closed forms of geometrical optics."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl

CENTER = 9.6e9
WAVELENGTH = 299_792_458.0 / CENTER
CHIRP = sarcl.Waveform.chirp(center=CENTER, bandwidth=20e6, duration=1e-6)
FAR = 1e6  # m


def toward(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """Unit vector from the origin to a radar."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def plates(*corners: list[tuple[float, float, float]]) -> sarcl.Scene:
    """Conducting quadrilaterals."""
    quads = np.array(corners, float)
    return sarcl.Scene.facets(np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def dihedral(a: float) -> sarcl.Scene:
    """Two square plates, z = 0 and x = 0, with the fold along y."""
    low, high = -a / 2, a / 2
    return plates(
        [(0, low, 0), (a, low, 0), (a, high, 0), (0, high, 0)], [(0, low, 0), (0, high, 0), (0, high, a), (0, low, a)]
    )


def square_trihedral(a: float) -> sarcl.Scene:
    return plates(
        [(0, 0, 0), (a, 0, 0), (a, a, 0), (0, a, 0)],
        [(0, 0, 0), (0, a, 0), (0, a, a), (0, 0, a)],
        [(0, 0, 0), (0, 0, a), (a, 0, a), (a, 0, 0)],
    )


def triangular_trihedral(a: float) -> sarcl.Scene:
    x, y, z = a * np.eye(3)
    zero = np.zeros(3)
    return sarcl.Scene.facets(np.array([[zero, x, y], [zero, y, z], [zero, z, x]]))


def seen(scene: sarcl.Scene, look: np.ndarray, bounces: int = 3, **options: object) -> np.ndarray:
    """Amplitudes HH, HV, VH, VV at the centre frequency, about the origin, m."""
    track = sarcl.Trajectory(None, FAR * look[None])
    options = {"tolerance": 1e-3, "polarization": "all", "reference": (0, 0, 0), "range_window": (-30, 30)} | options
    raw = sarcl.echo(scene, CHIRP, track, bounces=bounces, **options)
    assert raw.n_samples % 2  # one sample stands at the centre
    return np.asarray(raw.samples)[:, raw.n_samples // 2]


def db(amplitude: np.ndarray) -> np.ndarray:
    return 20 * np.log10(np.abs(amplitude))


# totals of one, two and three reflections, dBsm: HH and VV of an independent beam tracer, and geometrical optics
DIHEDRALS = [
    (0.5, 45, 32.118, 32.023, 32.070),
    (0.5, 35, 30.187, 30.319, 30.252),
    (0.5, 25, 27.622, 27.583, 27.599),
    (0.5, 60, 29.079, 29.040, 29.060),
    (1.0, 45, 44.082, 44.141, 44.111),
    (1.0, 35, 42.317, 42.270, 42.294),
    (1.0, 25, 39.615, 39.666, 39.641),
    (1.0, 60, 41.093, 41.109, 41.101),
]
BORESIGHT = (45.0, np.degrees(np.arctan(np.sqrt(0.5))))
TRIHEDRALS = [
    (square_trihedral, 0.5, *BORESIGHT, 33.831, 0.1),
    (square_trihedral, 0.5, 45, 15, 26.862, 0.2),
    (square_trihedral, 0.5, 45, 55, 27.157, 0.2),
    (square_trihedral, 0.5, 25, BORESIGHT[1], 28.504, 0.2),
    (square_trihedral, 0.5, 30, 20, 26.854, 0.2),
    (triangular_trihedral, 0.5, *BORESIGHT, 24.289, 0.1),
    (triangular_trihedral, 0.5, 45, 15, 20.969, 0.2),
    (triangular_trihedral, 0.5, 45, 55, 21.179, 0.2),
    (triangular_trihedral, 0.5, 25, BORESIGHT[1], 22.303, 0.2),
    (triangular_trihedral, 0.5, 30, 20, 21.001, 0.2),
    (square_trihedral, 1.0, *BORESIGHT, 45.872, 0.1),
    (triangular_trihedral, 1.0, *BORESIGHT, 36.330, 0.1),
]


@pytest.mark.parametrize(("side", "angle", "hh", "vv", "optics"), quick_of(DIHEDRALS[1:5:3], DIHEDRALS))
def test_a_dihedral_has_its_closed_form_at_every_aspect(side, angle, hh, vv, optics):
    amplitude = seen(dihedral(side), toward(0, angle))
    assert np.allclose(db(amplitude[[0, 3]]), [hh, vv], atol=0.01)
    assert np.allclose(db(amplitude[[0, 3]]), optics, atol=0.1)
    assert (db(amplitude[[1, 2]]) < hh - 60).all()
    # H lies along y, across neither plate: HH against a plate's sign, VV with it
    assert abs(np.angle(-amplitude[0] / amplitude[3], deg=True)) < 5
    assert abs(np.angle(amplitude[3], deg=True)) < 5


@pytest.mark.parametrize(
    ("reflector", "side", "azimuth", "elevation", "optics", "gate"), quick_of(TRIHEDRALS[4:7], TRIHEDRALS)
)
def test_a_trihedral_has_its_closed_form_at_every_aspect(reflector, side, azimuth, elevation, optics, gate):
    amplitude = seen(reflector(side), toward(azimuth, elevation))
    assert np.allclose(db(amplitude[[0, 3]]), optics, atol=gate)
    assert abs(np.angle(-amplitude[[0, 3]], deg=True)).max() < 5


@pytest.mark.parametrize("roll", [0, 10, 22.5, 45])
def test_two_reflections_of_a_rolled_dihedral_turn_the_polarisation(roll):
    look, psi = toward(0, 45), np.radians(roll)
    k = np.array([[0, -look[2], look[1]], [look[2], 0, -look[0]], [-look[1], look[0], 0]])
    turn = np.eye(3) + np.sin(psi) * k + (1 - np.cos(psi)) * k @ k
    scene = sarcl.Scene.facets(dihedral(1.0).triangles @ turn.T)
    two = seen(scene, look, 2, tolerance=1e-5) - seen(scene, look, 1, tolerance=1e-5)
    peak = 10 ** (44.111 / 20)
    expected = peak * np.array([-np.cos(2 * psi), np.sin(2 * psi), np.sin(2 * psi), np.cos(2 * psi)])
    two = two * np.sign((two[1] * np.conj(expected[1])).real or 1) if roll == 0 else two
    nulls = np.abs(expected) < 1e-9 * peak
    assert np.abs(20 * np.log10(np.abs(two[~nulls] / expected[~nulls]))).max() < 0.1
    assert (np.abs(two[nulls]) < 1e-2 * peak).all()
    assert np.isclose(two[1], two[2], atol=1e-3 * peak)


def fresnel_two_way(eps: complex, incidence: float) -> tuple[complex, complex]:
    """Coefficients of the electric field of H and V at an angle of incidence, rad."""
    cosine = np.cos(incidence)
    root = np.sqrt(eps - np.sin(incidence) ** 2)
    return (cosine - root) / (cosine + root), (eps * cosine - root) / (eps * cosine + root)


@pytest.mark.parametrize("incidence", quick_of([25, 45], [25, 35, 45, 55]))
@pytest.mark.parametrize("ground_eps", [3.0 - 0.05j, 12.0 - 1.9j])
def test_a_wall_on_ground_has_both_fresnel_factors(incidence, ground_eps):
    height, width, wall_eps = 5.0, 3.0, 5.24 - 0.53j
    angle = np.radians(incidence)
    wall = [[(0, -width / 2, 0), (0, width / 2, 0), (0, width / 2, height), (0, -width / 2, height)]]
    ground = [[(0, -10, 0), (20, -10, 0), (20, 10, 0), (0, 10, 0)]]
    quads = np.array(wall + ground, float)
    scene = sarcl.Scene.facets(
        np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]),
        material=[0, 1, 0, 1],
        materials=[sarcl.Material(wall_eps), sarcl.Material(ground_eps)],
    )
    look = np.array([np.sin(angle), 0, np.cos(angle)])
    two = seen(scene, look, 2) - seen(scene, look, 1)
    lit = min(1.0, 20 / (height * np.tan(angle)))
    area = 2 * width * height * lit * np.sin(angle)
    factors = np.array(fresnel_two_way(wall_eps, np.pi / 2 - angle)) * fresnel_two_way(ground_eps, angle)
    expected = 10 * np.log10(4 * np.pi * area**2 / WAVELENGTH**2 * np.abs(factors) ** 2)
    assert np.allclose(db(two[[0, 3]]), expected, atol=0.5)


def test_roughness_of_the_ground_attenuates_two_reflections():
    angle, h = np.radians(40), 0.004
    corner = dihedral(1.0).triangles  # plates in the order ground, wall, ground, wall
    look = np.array([np.sin(angle), 0, np.cos(angle)])
    rough = sarcl.Material(height=h, diagram="isotropic")
    scenes = [
        sarcl.Scene.facets(corner, material=[0, 1, 0, 1], materials=[ground, "metal"])
        for ground in (sarcl.Material(), rough)
    ]
    smooth, less = (seen(scene, look, 2) - seen(scene, look, 1) for scene in scenes)
    fall = np.exp(-((2 * 2 * np.pi / WAVELENGTH * h * np.cos(angle)) ** 2) / 2)
    assert np.allclose(less[[0, 3]] / smooth[[0, 3]], fall, rtol=2e-3)


def test_a_dihedral_appears_on_its_fold_and_a_trihedral_at_its_vertex():
    chirp = sarcl.Waveform.chirp(center=CENTER, bandwidth=600e6, duration=1e-6)
    track = sarcl.Trajectory.circle(radius=7e3, height=5e3, start=np.pi / 4 - 0.02, arc=0.04, n_pulses=48)
    grid = sarcl.ImageGrid.plane(shape=(41, 41), spacing=(0.1, 0.1))
    raw = sarcl.echo(triangular_trihedral(1.0), chirp, track, bounces=3, range_window=(-10, 10), reference=(0, 0, 0))
    image = np.abs(sarcl.backproject(raw, grid, tolerance=1e-2).data)
    assert np.unravel_index(image.argmax(), image.shape) == (20, 20)
    track = sarcl.Trajectory.circle(radius=7e3, height=7e3, start=-0.02, arc=0.04, n_pulses=48)
    raw = sarcl.echo(dihedral(1.0), chirp, track, bounces=2, range_window=(-10, 10), reference=(0, 0, 0))
    image = np.abs(sarcl.backproject(raw, grid, tolerance=1e-2).data)
    row, column = np.unravel_index(image.argmax(), image.shape)
    assert column == 20  # x = 0
    assert abs(row - 20) <= 6  # along the fold, 1 m long


@pytest.mark.parametrize(("azimuth", "elevation"), [(25, 35), (65, 12), (8, 70)])
def test_cross_polarisation_is_reciprocal_at_every_aspect(azimuth, elevation):
    """HV = VH of one antenna, off the main lobe too."""
    hh, hv, vh, _ = seen(triangular_trihedral(0.5), toward(azimuth, elevation))
    assert abs(hv - vh) < 1e-5 * abs(hv) + 1e-7 * abs(hh)
    assert abs(hv) > 1e-4 * abs(hh)


def rolled_dihedral(degrees: float) -> tuple[sarcl.Scene, sarcl.Trajectory]:
    """A dihedral rolled about the line of sight along which it looks, at 10 km, and a track of one pulse."""
    look = np.array([1.0, 0, 1]) / np.sqrt(2)
    k, angle = np.cross(np.eye(3), look), np.radians(degrees)
    roll = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return sarcl.shapes.dihedral((1, 1), rotation=roll), sarcl.Trajectory(None, 1e4 * look[None])


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3])
def test_a_polarisation_that_is_dark_after_one_reflection_and_bright_after_two(tolerance):
    scene, track = rolled_dihedral(45)
    both = sarcl.echo(scene, CHIRP, track, bounces=2, polarization=("HH", "HV"), tolerance=tolerance / 10)
    raw = sarcl.echo(scene, CHIRP, track, bounces=2, polarization="HV", tolerance=tolerance)
    wanted = both.select(polarization="HV").samples
    assert np.linalg.norm(wanted) > 10 * np.linalg.norm(both.select(polarization="HH").samples)
    assert np.linalg.norm(raw.samples - wanted) <= (raw.report.predicted_error + tolerance / 10) * np.linalg.norm(
        wanted
    )
    assert raw.report.predicted_error <= tolerance


def test_a_dark_polarisation_without_a_second_reflection_is_refused():
    _, track = rolled_dihedral(0)
    plate = sarcl.shapes.plate((0.2, 0.3), rotation=(0.3, -0.7, 0.1))
    with pytest.raises(ValueError, match=r"in which single reflections .* rounding alone.*\('HH', 'HV'\)"):
        sarcl.echo(plate, CHIRP, track, bounces=2, polarization="HV", tolerance=1e-2)


def test_many_pulses_in_a_dark_polarisation_are_refused_with_the_remedy():
    scene, track = rolled_dihedral(45)
    many = sarcl.Trajectory(None, np.repeat(track.positions, 20_000, axis=0))
    with pytest.raises(sarcl.ToleranceUnreachable, match=r"dB less than in HH and VV; ask for \('HH', 'HV'\)"):
        sarcl.echo(scene, CHIRP, many, bounces=2, polarization="HV", tolerance=1e-2)
