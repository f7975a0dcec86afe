"""Calibration targets: their shapes, and their radar cross sections in closed form against rays that are counted."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.scene.triangles import areas, centroids, normals

FREQUENCY = 9.6e9
WAVELENGTH = 299_792_458.0 / FREQUENCY
BORESIGHT = np.degrees(np.arcsin(1 / np.sqrt(3)))
ASPECTS = [(45, BORESIGHT), (45, 15), (45, 55), (25, BORESIGHT), (30, 20)]  # azimuth, elevation, degrees
TOLERANCE = {
    "printed": 1.5e-3,  # dB: printed to three digits
    "counted": 0.1,  # dB: 301^2 rays, of which at least 2 % return: 1 % of an area, at its outline
    "summed": 0.05,  # dB: 4e6 rays; at 70 degrees the outline of those that return cuts the steps
    "stationary phase": 0.1,  # dB: k r cos e is above 60
    "echo": 1e-3,  # relative: the tolerance of the echo
}


def towards(azimuth, elevation):
    azimuth, elevation = np.radians(azimuth), np.radians(elevation)
    east = np.cos(elevation) * np.cos(azimuth)
    return np.stack([east, np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=-1)


def decibels(sigma):
    return 10 * np.log10(sigma)


@pytest.mark.parametrize(
    ("form", "side", "printed"),
    [
        ("square", 0.5, [33.831, 26.862, 27.157, 28.504, 26.854]),
        ("triangular", 0.5, [24.289, 20.969, 21.179, 22.303, 21.001]),
        ("square", 1.0, [45.872]),
        ("triangular", 1.0, [36.330]),
    ],
)
def test_trihedrals_have_the_printed_cross_sections(form, side, printed):
    sigma = shapes.trihedral_rcs(side, towards(*np.transpose(ASPECTS))[: len(printed)], FREQUENCY, form=form)
    assert decibels(sigma) == pytest.approx(printed, abs=TOLERANCE["printed"])


@pytest.mark.parametrize(
    ("side", "printed"), [(0.5, [32.070, 30.252, 27.599, 29.060]), (1.0, [44.111, 42.294, 39.641, 41.101])]
)
def test_dihedrals_have_the_printed_cross_sections(side, printed):
    sigma = shapes.dihedral_rcs((side, side), towards(0, np.array([45, 35, 25, 60])), FREQUENCY)
    assert decibels(sigma) == pytest.approx(printed, abs=TOLERANCE["printed"])


def returned_area(scene, direction, reflections, n=301):
    """Area across `direction` of the beams that leave `scene` after so many reflections by other plates, by rays."""
    corners = scene.triangles
    u = direction / np.linalg.norm(direction)
    across = [[0.8, 0.6], [-0.6, 0.8]] @ np.linalg.svd(u[None])[2][1:]  # oblique to the outlines
    reach = np.abs(corners.reshape(-1, 3) @ across.T).max() * 1.01
    cells = (np.arange(n) + 0.5) / n * 2 - 1
    start = reach * np.stack(np.meshgrid(cells, cells), axis=-1).reshape(-1, 2) @ across + 10 * u
    n = len(start)
    way, count, last = np.broadcast_to(-u, (n, 3)).copy(), np.zeros(n, int), np.full(n, -1)
    for _ in range(reflections + 1):
        nearest, hit = np.full(n, np.inf), np.full(n, -1)
        for k, (a, b, c) in enumerate(corners):
            normal = np.cross(b - a, c - a)
            with np.errstate(divide="ignore", invalid="ignore"):
                distance = (a - start) @ normal / (way @ normal)
                point = start + distance[:, None] * way
                sides = [np.cross(q - p, point - p) @ normal for p, q in ((a, b), (b, c), (c, a))]
            ok = (np.min(sides, axis=0) >= 0) & (distance > 1e-9) & (distance < nearest)
            nearest, hit = np.where(ok, distance, nearest), np.where(ok, k, hit)
        ray = hit >= 0
        count += ray
        normal = normals(corners)[hit[ray]]
        start[ray] += nearest[ray, None] * way[ray]
        way[ray] -= 2 * (way[ray] * normal).sum(axis=1)[:, None] * normal
        last = hit
    assert (last >= 0).mean() < 1e-3  # all have left
    return (2 * reach) ** 2 * (count == reflections).mean()


DIRECTIONS = [towards(*a) for a in [*ASPECTS, (20, 20), (10, 40)]]


@pytest.mark.parametrize("form", ["triangular", "square"])
@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_the_area_of_a_trihedral_is_that_of_the_rays_that_three_plates_reflect(form, direction):
    area = returned_area(shapes.trihedral(0.8, form=form), direction, 3)
    closed = shapes.trihedral_rcs(0.8, direction, FREQUENCY, form=form)
    assert decibels(4 * np.pi * (area / WAVELENGTH) ** 2 / closed) == pytest.approx(0, abs=TOLERANCE["counted"])


@pytest.mark.parametrize("angle", [15, 45, 70])
def test_the_area_of_a_dihedral_is_that_of_the_rays_that_both_plates_reflect(angle):
    area = returned_area(shapes.dihedral((0.4, 0.7)), towards(0, angle), 2)
    closed = shapes.dihedral_rcs((0.4, 0.7), towards(0, angle), FREQUENCY)
    assert decibels(4 * np.pi * (area / WAVELENGTH) ** 2 / closed) == pytest.approx(0, abs=TOLERANCE["counted"])


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.4, 45), (1.3, 45), (3.25, 45), (-6, 30), (12, 60), (70, 20)])
def test_off_its_plane_a_dihedral_is_the_sum_over_the_rays_that_both_plates_reflect(azimuth, elevation):
    """Rays from the ground to the wall, one by one, with the phase of their ways."""
    across, along = 0.4, 0.7
    u, k = towards(azimuth, elevation), 2 * np.pi / WAVELENGTH
    x, step = (np.arange(2000) + 0.5) / 2000 * across, across / 2000
    y, width = ((np.arange(2001) + 0.5) / 2001 - 0.5) * along, along / 2001
    length = x / u[0]  # from the ground to the wall
    wall = y[:, None] - u[1] * length  # places along the fold, where the rays meet the wall
    meets = (np.abs(wall) < along / 2) & (u[2] * length < across)
    way = u[0] * x + u[1] * y[:, None] + u[2] ** 2 * length + u[1] * wall - length
    area = 2 * u[2] * step * width * np.abs((meets * np.exp(1j * k * way)).sum())
    closed = shapes.dihedral_rcs((across, along), u, FREQUENCY)
    assert decibels(4 * np.pi * (area / WAVELENGTH) ** 2 / closed) == pytest.approx(0, abs=TOLERANCE["summed"])


@pytest.mark.parametrize("elevation", [10, 30, 45, 60])
def test_a_top_hat_is_its_wall_mirrored_in_its_disc(elevation):
    """The integral over the wall of the waves that reach it by the disc, strip by strip; twice, for both ways."""
    disc, radius, height = 0.9, 0.5, 0.35
    k, e = 2 * np.pi / WAVELENGTH, np.radians(elevation)
    phi = np.linspace(-np.pi / 2, np.pi / 2, 200_001)
    # a ray meets the disc before the wall within its plane: the disc reaches this far along it
    reach = np.sqrt(disc**2 - (radius * np.sin(phi)) ** 2) - radius * np.cos(phi)
    lit = np.minimum(height, reach * np.tan(e))
    wave = np.cos(phi) * np.cos(e) * lit * np.exp(2j * k * radius * np.cos(e) * np.cos(phi))
    area = 2 * radius * abs(np.trapezoid(wave, phi))
    closed = shapes.top_hat_rcs(disc, radius, height, towards(123, elevation), FREQUENCY)
    assert decibels(4 * np.pi * (area / WAVELENGTH) ** 2 / closed) == pytest.approx(
        0, abs=TOLERANCE["stationary phase"]
    )


def test_closed_forms_broadcast_and_are_zero_where_no_beam_returns():
    directions, frequencies = np.ones((4, 1, 3)), np.array([5e9, 10e9])
    sigma = shapes.trihedral_rcs(1, directions, frequencies)
    assert sigma.shape == (4, 2) and sigma[0, 1] == pytest.approx(4 * sigma[0, 0])
    for behind in ((-1, 1, 1), (1, 1, -0.1), (0, 1, 1), (0, 0, 1)):
        assert shapes.trihedral_rcs(1, behind, 1e10) == shapes.trihedral_rcs(1, behind, 1e10, form="square") == 0
    assert shapes.dihedral_rcs((1, 2), (-1, 0, 1), 1e10) == shapes.dihedral_rcs((1, 2), (1, 0, 0), 1e10) == 0
    for edge_on in ((0, 0, 1), (1, 0, 0), (1, 0, -1)):
        assert shapes.top_hat_rcs(1, 0.5, 0.3, edge_on, 1e10) == 0
    assert shapes.luneburg_rcs(0.2, directions, frequencies) == pytest.approx(
        np.broadcast_to(4 * np.pi**3 * 0.2**4 * (frequencies / 299_792_458.0) ** 2, (4, 2))
    )


def test_targets_lie_at_their_vertex_and_face_their_opening():
    corners = shapes.trihedral(2), shapes.trihedral(2, form="square"), shapes.dihedral((2, 3))
    for scene, area, opening in zip(corners, (6, 12, 12), ((1, 1, 1), (1, 1, 1), (1, 0, 1)), strict=True):
        assert areas(scene.triangles).sum() == pytest.approx(area) and scene.two_sided.all()
        assert (normals(scene.triangles) @ opening > 0).all()
        assert (np.abs((normals(scene.triangles) * centroids(scene.triangles)).sum(axis=1)) < 1e-12).all()
    hat = shapes.top_hat(2, 1, 0.5, sections=6)
    assert hat.bounds.tolist() == [[-2, pytest.approx(-np.sqrt(3)), 0], [2, pytest.approx(np.sqrt(3)), 0.5]]
    polygon = 3 * np.sqrt(3) / 2
    assert areas(hat.triangles).sum() == pytest.approx(4 * polygon + 6 * 0.5)
    wall = np.abs(normals(hat.triangles)[:, 2]) < 1e-9
    assert (normals(hat.triangles)[~wall] == (0, 0, 1)).all()
    assert ((normals(hat.triangles) * centroids(hat.triangles)).sum(axis=1)[wall] > 0).all()
    moved = shapes.trihedral(1, position=(5, 6, 7), rotation=(0, 0, np.pi / 2), edge=0.3, material="concrete")
    assert moved.bounds == pytest.approx(np.array([[4, 6, 7], [5, 7, 8]]))
    assert len(moved.triangles) > 3 and moved.materials[0].name == "concrete"


TRACK = sarcl.Trajectory.line(start=(-3e4, -40, 2e4), velocity=(0, 10, 0), prf=4.0, n_pulses=33)


@pytest.mark.parametrize("center", [5e9, 10e9])
@pytest.mark.parametrize("verb", ["echo", "spectral_echo"])
def test_a_lens_echoes_its_closed_form_at_its_position(verb, center):
    chirp = sarcl.Waveform.chirp(center=center, bandwidth=100e6, duration=1e-6)
    scene = shapes.luneburg(0.15, position=(3, 4, 5)) + sarcl.Scene.points([[0.0, 0, 0]], 0)
    raw = getattr(sarcl, verb)(scene, chirp, TRACK, tolerance=TOLERANCE["echo"])
    amplitude = np.sqrt(shapes.luneburg_rcs(0.15, (1, 0, 0), center))
    path = np.linalg.norm(TRACK.positions - (3, 4, 5), axis=1) - raw.reference_range
    frequencies = raw.frequency[:, None] + raw.frequency_step[:, None] * np.arange(raw.n_samples)
    exact = amplitude * np.exp(-4j * np.pi * frequencies / 299_792_458.0 * path[:, None])
    assert np.linalg.norm(raw.samples - exact) <= TOLERANCE["echo"] * np.linalg.norm(exact)


def test_an_aperture_equals_a_disc_seen_face_on():
    """4 pi A^2/lambda^2 by another way: physical optics of facets."""
    track = sarcl.Trajectory.line(start=(0, 0, 1e5), velocity=(1e-3, 0, 0), prf=1.0, n_pulses=2)
    chirp = sarcl.Waveform.chirp(center=8e9, bandwidth=1e6, duration=1e-6)
    side = 0.3
    scenes = shapes.plate((side, side)), sarcl.Scene.points([[0.0, 0, 0]], apertures=side**2)
    plate, point = (
        np.abs(sarcl.echo(s, chirp, track, tolerance=1e-4, range_window=(-9, 9)).samples).max() for s in scenes
    )
    assert plate == pytest.approx(point, rel=1e-3)


def test_a_scene_with_lenses_survives_sums_and_scenario_files():
    scene = shapes.luneburg(0.2) + sarcl.Scene.points([[1.0, 2, 3]], 2j) + shapes.plate((1, 1))
    assert scene.apertures.tolist() == [pytest.approx(np.pi * 0.04), 0] and not scene.apertures.flags.writeable
    assert np.abs(scene.at_frequency(FREQUENCY).amplitudes) ** 2 == pytest.approx(
        [shapes.luneburg_rcs(0.2, (1, 0, 0), FREQUENCY), 4]
    )
    assert not scene.at_frequency(FREQUENCY).apertures.any() and shapes.plate((1, 1)).at_frequency(1e9) is not None
    again = sarcl.Scenario(scene=scene).dumps()
    assert "apertures" in again and "apertures" not in sarcl.Scenario(scene=sarcl.Scene.points([[0.0, 0, 0]])).dumps()


BAD = {
    "no side": (lambda: shapes.trihedral(0), "side is 0; it must be greater than 0"),
    "negative side": (lambda: shapes.trihedral_rcs(-1, (1, 1, 1), 1e9), "side is -1"),
    "form": (lambda: shapes.trihedral(1, form="round"), "form is 'round'; choose one of 'triangular', 'square'"),
    "form of a closed form": (lambda: shapes.trihedral_rcs(1, (1, 1, 1), 1e9, form="cube"), "form is 'cube'"),
    "one length": (lambda: shapes.dihedral(1.0), r"size has shape \(\), wanted \(2,\)"),
    "flat dihedral": (lambda: shapes.dihedral_rcs((1, 0), (1, 0, 1), 1e9), r"size\[1\] is 0"),
    "no brim": (lambda: shapes.top_hat(0.3, 0.3, 1), "the disc must reach beyond the cylinder"),
    "closed form without brim": (lambda: shapes.top_hat_rcs(0.2, 0.3, 1, (1, 0, 1), 1e9), "must reach beyond"),
    "flat hat": (lambda: shapes.top_hat(0.4, 0.3, 0), "height is 0"),
    "no lens": (lambda: shapes.luneburg(0), "radius is 0"),
    "negative lens": (lambda: shapes.luneburg_rcs(-0.1, (1, 0, 0), 1e9), "radius is -0.1"),
    "two components": (lambda: shapes.luneburg_rcs(1, (1, 0), 1e9), r"direction has shape \(2,\), wanted \(..., 3\)"),
    "no direction": (lambda: shapes.trihedral_rcs(1, [(1, 1, 1), (0, 0, 0)], 1e9), r"direction\[1\] is \(0, 0, 0\)"),
    "direction of nan": (lambda: shapes.dihedral_rcs((1, 1), (1, np.nan, 1), 1e9), "direction"),
    "no frequency": (lambda: shapes.top_hat_rcs(0.4, 0.3, 1, (1, 0, 1), 0), "frequency reaches 0 Hz"),
    "negative aperture": (lambda: sarcl.Scene.points([[0, 0, 0]], apertures=-1), r"apertures\[0\] is -1 m\^2"),
    "carrier": (lambda: shapes.luneburg(1).at_frequency(0), "frequency is 0"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_targets_are_named(name):
    call, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        call()
