"""Echoes of facets through sarcl.echo: against the frequency-by-frequency integral, closed forms, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of, thinned
from helpers.facet_cases import WET, plate, seen_from, still

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference import facet
from sarcl.scene.material import Material
from sarcl.scene.triangles import centroids, normals

CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=600e6, duration=1e-6)
NAMES = ("HH", "HV", "VH", "VV")
ROUGH = Material(eps_r=6.0, height=np.inf, diagram="cos")


def oracle(raw, scene, rows=None, n=5):
    """Exact samples of single-pulse echoes at n frequencies, complex128 (4, n), and the samples that there are."""
    at = np.linspace(0, raw.n_samples - 1, n).astype(int)
    f = raw.frequency[0] + raw.frequency_step[0] * at
    eps = np.array([[m.permittivity(v) for m in scene.materials] for v in f])[:, scene.material]
    wanted = facet.facet_echo(scene.triangles, eps, f, raw.tx[0], raw.rx[0], raw.reference_range[0])
    names = raw.polarization.tolist()
    got = {name: raw.samples[names.index(name), at] for name in names}
    wanted = {name: wanted[:, "HV".index(name[0]), "HV".index(name[1])] for name in names}
    return np.stack(list(wanted.values())), np.stack(list(got.values()))


@pytest.mark.parametrize(
    "distance, elevation, tolerance",
    thinned(
        [(1e3, 20), (1e5, 40), (1e3, 70), (1e5, 20), (1e3, 40), (1e5, 70)], [1e-1, 1e-2, 1e-3, 1e-4], every=6, slow=(3,)
    ),
)
def test_a_five_metre_plate_tilted_by_20_degrees(distance, elevation, tolerance):
    # at 20 deg the plate is seen along its normal, at 70 deg its edges' echoes are 1/2000 of that
    scene = sarcl.Scene.facets(plate(5.0, np.radians(20)), two_sided=False)
    track = still(seen_from(distance, np.radians(elevation)))
    raw = sarcl.echo(scene, CHIRP, track, tolerance=tolerance, shadows=False, polarization="all", check=False)
    wanted, got = oracle(raw, scene)
    assert np.linalg.norm(got - wanted) <= tolerance * np.linalg.norm(wanted)
    assert raw.report.predicted_error <= tolerance


@pytest.mark.costly
@pytest.mark.parametrize("material, bistatic", thinned([Material(), WET, Material(eps_r=3.0)], [True, False]))
def test_every_polarisation_of_tilted_facets(device, material, bistatic):
    random = np.random.default_rng(3)
    corners = random.uniform(-4, 4, (12, 1, 3)) + random.uniform(-0.6, 0.6, (12, 3, 3))
    scene = sarcl.Scene.facets(corners, material=material, two_sided=False)
    tx, rx = seen_from(5e3, 0.7, 0.2), seen_from(6e3, 0.9, 0.8)
    options = {"receiver": still(rx)} if bistatic else {}
    raw = sarcl.echo(
        scene,
        CHIRP,
        still(tx),
        tolerance=1e-3,
        shadows=False,
        polarization="all",
        device=device,
        check=False,
        **options,
    )
    wanted, got = oracle(raw, scene)
    for name, exact, found in zip(NAMES, wanted, got, strict=True):
        # each within the tolerance of all: cross-polarised echoes are far weaker
        assert np.linalg.norm(found - exact) <= 1e-3 * np.linalg.norm(wanted), name
    if bistatic or not material.conducting:
        assert np.linalg.norm(wanted[1]) > 0.01 * np.linalg.norm(wanted[0])


@pytest.mark.slow
def test_rows_are_pulse_by_pulse_and_polarisations_do_not_depend_on_one_another():
    random = np.random.default_rng(4)
    scene = sarcl.Scene.facets(random.uniform(-1, 1, (30, 3, 3)) * [1, 1, 0.3], material=WET, two_sided=True)
    scene = scene + sarcl.Scene.points([[0.3, 0.6, 0.2]], 1.0)
    track = still(*(seen_from(8e3, 0.8, a) for a in (0.0, 0.01, 0.02)))
    options = {"tolerance": 1e-3, "shadows": False, "check": False}
    whole = sarcl.echo(scene, CHIRP, track, polarization=("VV", "HV", "HH"), **options)
    assert whole.polarization.tolist() == ["VV", "HV", "HH"] * 3
    assert np.array_equal(whole.tx, np.repeat(track.positions, 3, axis=0))
    for name in NAMES:
        alone = sarcl.echo(scene, CHIRP, track, polarization=name, **options)
        same = whole.select(polarization="HV" if name == "VH" else name)
        assert np.linalg.norm(alone.samples - same.samples) <= 2e-3 * np.linalg.norm(whole.samples)
        assert alone.polarization.tolist() == [name] * 3


def test_points_send_back_what_they_are_sent():
    points = sarcl.Scene.points([[1, 2, 0.5]], 3.0)
    raw = sarcl.echo(points, CHIRP, still(seen_from(8e3, 0.8)), polarization="all")
    power = (np.abs(raw.samples) ** 2).mean(axis=1)
    assert power[[0, 3]] == pytest.approx(9, rel=1e-3) and not power[[1, 2]].any()


@pytest.mark.parametrize(
    "angle, dbsm",
    quick_of(
        [(0, 1.0302), (20, -23.5638)], [(0, 1.0302), (5, -3.7595), (10, -21.2624), (20, -23.5638), (60, -29.9208)]
    ),
)
def test_a_small_plate_off_its_normal(device, angle, dbsm):
    # (4 pi A^2/lambda^2) cos^2 t sinc^2(k a sin t): side a = 10.16 cm, wavelength 3.25 cm; to 0.01 dB off the nulls
    tone = sarcl.Waveform.chirp(center=SPEED_OF_LIGHT / 0.0325, bandwidth=1e6, duration=1e-6)
    scene = sarcl.Scene.facets(plate(0.1016, 0.0), two_sided=False)
    raw = sarcl.echo(
        scene, tone, still(seen_from(1e6, np.radians(angle))), shadows=False, tolerance=1e-4, device=device
    )
    assert 20 * np.log10(np.abs(raw.samples).mean()) == pytest.approx(dbsm, abs=0.01)


@pytest.mark.parametrize("side, frequency, dbsm", [(1, 5.405e9, 36.112), (1, 10e9, 41.456), (5, 1e9, 49.41)])
def test_plates_at_normal_incidence(device, side, frequency, dbsm):
    tone = sarcl.Waveform.chirp(center=frequency, bandwidth=1e6, duration=1e-6)
    scene = sarcl.Scene.facets(plate(float(side), 0.0), two_sided=False)
    raw = sarcl.echo(scene, tone, still([0, 0, 5e6]), shadows=False, tolerance=1e-4, device=device)
    assert 20 * np.log10(np.abs(raw.samples).mean()) == pytest.approx(dbsm, abs=5e-3 if side == 5 else 1e-3)


@pytest.mark.parametrize("ka, ratio", [(10, 0.91167), (20, 0.96483)])
def test_a_conducting_sphere_by_physical_optics(device, ka, ratio):
    import trimesh

    # physical optics, pi a^2 |1 + (j/b)(1 - exp(-jb))|^2 with b = 2 k a, not pi a^2; within 0.02 dB with small facets
    frequency = ka * SPEED_OF_LIGHT / (2 * np.pi)
    tone = sarcl.Waveform.chirp(center=frequency, bandwidth=1e3, duration=1e-6)
    ball = trimesh.creation.icosphere(subdivisions=6)
    # the area of the polyhedron is a little less
    scene = sarcl.Scene.from_mesh(ball, scale=float(np.sqrt(4 * np.pi / ball.area)))
    raw = sarcl.echo(scene, tone, still(seen_from(1e7, 0.4)), shadows=False, tolerance=1e-4, device=device)
    assert 20 * np.log10(np.abs(raw.samples).mean()) == pytest.approx(10 * np.log10(np.pi * ratio), abs=0.02)


def test_conductors_give_no_cross_polarisation():
    random = np.random.default_rng(5)
    scene = sarcl.Scene.facets(random.uniform(-3, 3, (50, 3, 3)), two_sided=True)
    raw = sarcl.echo(scene, CHIRP, still(seen_from(8e3, 0.8)), shadows=False, polarization="all")
    power = (np.abs(raw.samples) ** 2).sum(axis=1)
    assert power[[1, 2]].max() <= 1e-12 * power[0] and np.array_equal(raw.samples[0], raw.samples[3])


def test_skips_change_nothing_but_the_count(device):
    random = np.random.default_rng(1)
    triangles = random.uniform(-10, 10, (200, 1, 3)) + random.uniform(-0.3, 0.3, (200, 3, 3))
    scene = sarcl.Scene.facets(triangles, two_sided=False) + sarcl.Scene.facets(triangles + 1, material=0.0)
    options = {"shadows": False, "range_window": (-6, 6), "tolerance": 1e-3, "device": device, "check": False}
    track = still(*(seen_from(1e4, 0.8, a) for a in np.linspace(0, 0.05, 9)))
    whole = sarcl.echo(scene, CHIRP, track, skip=False, **options)
    picky = sarcl.echo(scene, CHIRP, track, skip=True, **options)
    assert np.linalg.norm(whole.samples - picky.samples) <= 1e-3 * np.linalg.norm(whole.samples)
    skipped = picky.report.contributions_skipped
    assert skipped["zero reflectivity"] >= 200 * 9 and skipped["facing away"] > 50 * 9
    assert whole.report.contributions_done > 0
    assert whole.report.contributions_skipped["facing away"] > 0  # found one by one, and counted


def test_echoes_do_not_depend_on_order_or_memory():
    random = np.random.default_rng(6)
    triangles = random.uniform(-10, 10, (200, 1, 3)) + random.uniform(-0.3, 0.3, (200, 3, 3))
    track = still(*(seen_from(1e4, 0.8, a) for a in np.linspace(0, 0.05, 24)))
    options = {"shadows": False, "tolerance": 1e-4, "polarization": ("HH", "HV"), "check": False}
    scene = sarcl.Scene.facets(triangles, material=WET)
    turned = sarcl.Scene.facets(triangles[::-1], material=WET)
    one = sarcl.echo(scene, CHIRP, track, **options)
    norm = np.linalg.norm(one.samples)
    for other in (
        sarcl.echo(turned, CHIRP, track, **options),
        sarcl.echo(scene, CHIRP, track, max_bytes=1e6, **options),
    ):
        assert np.linalg.norm(other.samples - one.samples) <= 1e-5 * norm
    assert np.array_equal(sarcl.echo(scene, CHIRP, track, **options).samples, one.samples)


def test_a_wide_band_takes_the_frequency_of_every_sample():
    # 60 % bandwidth: the echo of a plate at normal incidence grows with frequency, a dispersive one's otherwise
    wide = sarcl.Waveform.chirp(center=1e9, bandwidth=6e8, duration=1e-7)
    for material in (Material(), Material(eps_r=4.0, conductivity=1.0)):
        scene = sarcl.Scene.facets(plate(1.0, 0.3), material=material, two_sided=False)
        raw = sarcl.echo(
            scene, wide, still(seen_from(3e3, 0.5, 0.1)), tolerance=1e-3, shadows=False, polarization="all", check=False
        )
        wanted, got = oracle(raw, scene, n=9)
        assert np.linalg.norm(got - wanted) <= 1e-3 * np.linalg.norm(wanted)


def test_the_measured_error_is_that_of_the_engine(device):
    random = np.random.default_rng(7)
    corners = random.uniform(-3, 3, (60, 1, 3)) + random.uniform(-0.2, 0.2, (60, 3, 3))
    scene = sarcl.Scene.facets(corners, material=WET)
    track = still(*(seen_from(8e3, 0.8, a) for a in np.linspace(0, 0.05, 20)))
    raw = sarcl.echo(scene, CHIRP, track, polarization="all", shadows=False, check=True, device=device)
    assert 0 < raw.report.measured_error <= raw.report.predicted_error <= 1e-3


def test_facets_left_whole_are_refused_where_they_are_too_large():
    scene = sarcl.Scene.facets(plate(5.0, 0.3), two_sided=False)
    with pytest.raises(ValueError, match="let echo cut them"):
        sarcl.echo(scene, CHIRP, still(seen_from(1e3, 0.5)), max_edge=None, shadows=False)
    raw = sarcl.echo(scene, CHIRP, still(seen_from(1e3, 0.5)), max_edge=0.1, shadows=False)
    assert raw.report.plan["facet edges, m"] <= 0.1


@pytest.mark.parametrize("bad", ["HX", "hh", (), ("HH", "HH"), ("HH", 3), 5])
def test_polarisations_that_there_are_not(bad):
    with pytest.raises((ValueError, TypeError), match="polarization"):
        sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, still([0, 0, 1e3]), polarization=bad)


def test_an_antenna_among_facets_is_reported():
    ground = sarcl.Scene.from_heights([-1, 1], [-1, 1], np.zeros((2, 2)))
    with pytest.raises(
        ValueError, match=r"track\[\d+\] is \[.*\] m: an antenna stands on a facet; move the track away"
    ):
        sarcl.echo(ground, CHIRP, still([0, 0, 0]), shadows=False)


def test_facets_are_cut_no_finer_than_the_tolerance_needs():
    scene = sarcl.Scene.facets(plate(5.0, 0.3), two_sided=False)
    edges = []
    for tolerance in (1e-1, 1e-2, 1e-3):
        report = sarcl.echo(scene, CHIRP, still(seen_from(1e5, 0.5)), tolerance=tolerance, shadows=False).report
        edges.append(report.plan["facet edges, m"])
    assert edges[0] >= edges[1] >= edges[2] and edges[0] > 0.5
    assert len(normals(scene.triangles)) == len(centroids(scene.triangles)) == 2


def test_polarisations_lie_about_the_vertical_in_earth_centred_coordinates_too():
    from sarcl.base import wgs84

    random = np.random.default_rng(8)
    corners = random.uniform(-4, 4, (8, 1, 3)) + random.uniform(-0.3, 0.3, (8, 3, 3))
    ends = np.array([seen_from(8e3, 0.8, a) for a in (0.3, 0.31)])
    axes, origin = wgs84.local_axes(12.0, 42.0), wgs84.ecef(12.0, 42.0, 100.0)
    options = {"polarization": "all", "shadows": False, "tolerance": 1e-4, "check": False, "range_window": (-12, 12)}
    local = sarcl.echo(
        sarcl.Scene.facets(corners, material=WET), CHIRP, still(*ends), reference=(0, 0, 0), **options
    ).samples
    there = sarcl.Scene.facets(corners @ axes + origin, material=WET)
    track = still(*(ends @ axes + origin))
    earth = sarcl.echo(there, CHIRP, track, reference=origin, **options).samples
    assert np.linalg.norm(earth - local) <= 3e-4 * np.linalg.norm(local)
    told = sarcl.echo(there, CHIRP, track, reference=origin, vertical=axes[2], **options).samples
    assert np.linalg.norm(told - earth) <= 1e-4 * np.linalg.norm(local)
    z = sarcl.echo(there, CHIRP, track, reference=origin, vertical=(0, 0, 1), **options).samples
    assert np.linalg.norm(z - local) > 0.05 * np.linalg.norm(local)


def test_echoes_of_nothing_are_said():
    track = still(seen_from(8e3, 0.8))
    with pytest.raises(ValueError, match="points send back nothing"):
        sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), CHIRP, track, polarization="HV")
    down = sarcl.Scene.facets(plate(1.0, 0.0)[:, ::-1], two_sided=False)
    for skip in (True, False):
        with pytest.raises(ValueError, match=r"facing away|faces away"):
            sarcl.echo(down, CHIRP, track, shadows=False, skip=skip)


def test_the_window_holds_corners_where_they_are_moved_to():
    axis = np.linspace(-2, 2, 9)
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((9, 9)), point_roughness=20.0)
    raw = sarcl.echo(ground, CHIRP, still(seen_from(8e3, 0.8)), shadows=False, tolerance=1e-2)
    assert raw.report.contributions_skipped["range window"] == 0
