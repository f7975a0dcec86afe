"""Errors that plans of facets foresee: of cuts, of few frequencies, of directions rounded to float32, of H and V."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import quick_of, thinned
from helpers.facet_cases import WET, echo_and_integral, plate, random_units, seen_from, still

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.errors import ToleranceUnreachable
from sarcl.base.vectors import unit
from sarcl.numerics import polynomials
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference import facet
from sarcl.scattering import facet_plan
from sarcl.scattering._cutting_error import CuttingError
from sarcl.scattering._direction_error import FLOAT32_DIRECTION, DirectionError, _rotations
from sarcl.scattering._facet_norm import longest_piece
from sarcl.scattering._frequency_nodes import OverBand
from sarcl.scattering.facet_kinds import FacetView
from sarcl.scattering.facets import FacetSet
from sarcl.scattering.physical_optics import polarisation, scattering_matrix
from sarcl.scene.triangles import cut

TONE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=1e6, duration=1e-6)
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=6e8, duration=1e-6)
VERTICAL = np.array([0.0, 1.0, 0.05]) / np.linalg.norm([0.0, 1.0, 0.05])
SCALENE = np.array([[[-0.5, -0.4, 0], [0.6, -0.3, 0], [0.05, 0.45, 0]]])
ROUGH = sarcl.Material(eps_r=6.0, height=np.inf, diagram="cos")
OBTUSE = np.array([[[-0.5, 0, 0], [0.7, 0, 0], [-0.2, 0.3, 0]]])


def trihedral():
    """Three squares of 1 m about a corner, two triangles each, lit from (1, 1, 1)."""
    axes = np.eye(3)
    pairs = ((axes[i], axes[(i + 1) % 3]) for i in range(3))
    return np.array([side for u, v in pairs for side in ([0 * u, u, u + v], [0 * u, u + v, v])])


def error(raw, triangles, n=5):
    """Error of a single-pulse echo at n of its frequencies, all its polarisations together.

    Relative, as tolerances are, to the larger of its norm and the norm that the triangles would have at random phases.
    """
    at = np.linspace(0, raw.n_samples - 1, n).astype(int)
    f = raw.frequency[0] + raw.frequency_step[0] * at
    rx = raw.tx if raw.rx is None else raw.rx
    place, up = (raw.tx[0], rx[0], raw.reference_range[0]), tuple(VERTICAL.tolist())
    each = np.stack([facet.facet_echo(one[None], np.inf, f, *place, up=up) for one in triangles])
    names = raw.polarization.tolist()
    parts = np.stack([each[:, :, "HV".index(name[0]), "HV".index(name[1])] for name in names])
    parts = parts * np.abs(raw.waveform.pulse_spectrum(f)) ** 2
    wanted = parts.sum(axis=1)
    return np.linalg.norm(raw.samples[:, at] - wanted) / max(np.linalg.norm(wanted), np.linalg.norm(parts))


@pytest.mark.parametrize("cycles, tolerance", thinned([36.975, 37.0], [1e-2, 1e-3]))
def test_one_look_at_a_trihedral_of_six_triangles_at_a_null_of_its_pattern(cycles, tolerance):
    # at a whole number of cycles along each edge the faces send back almost nothing: over 120 dB below their area
    center = cycles * SPEED_OF_LIGHT * np.sqrt(3) / 2
    tone = sarcl.Waveform.tone(center=center, duration=1e-6)
    scene = sarcl.Scene.facets(trihedral(), two_sided=False)
    place = np.full(3, 1e4 / np.sqrt(3))
    raw = sarcl.echo(scene, tone, still(place), tolerance=tolerance, vertical=VERTICAL)
    assert error(raw, scene.triangles) <= raw.report.predicted_error <= tolerance
    assert raw.report.plan["facets"] <= 1000
    if tolerance < 1e-2:
        assert raw.report.plan["sums"] == "in float64"


@pytest.mark.parametrize("tolerance, most, waveform", thinned([(1e-2, 1e4), (1e-3, 1e5)], [TONE, CHIRP]))
def test_a_plate_of_one_metre_at_ten_metres(waveform, tolerance, most):
    scene = sarcl.Scene.facets(plate(1.0), two_sided=False)
    track = still(seen_from(10.0, np.radians(20)))
    raw = sarcl.echo(scene, waveform, track, tolerance=tolerance, shadows=False, vertical=VERTICAL)
    assert error(raw, scene.triangles) <= raw.report.predicted_error <= tolerance
    assert raw.report.plan["facets"] <= most


@pytest.mark.slow
@pytest.mark.parametrize(
    "triangles, distance, off, azimuth, bistatic",
    [
        (SCALENE, 30.0, 20, 180, False),
        (OBTUSE, 10.0, 20, 33, False),
        (SCALENE, 3.0, 50, 200, True),
        (plate(1.0), 1e3, 65, 304, False),
    ],
)
def test_pieces_of_any_shape_near_the_antennas(triangles, distance, off, azimuth, bistatic):
    scene = sarcl.Scene.facets(triangles, two_sided=False)
    tx = seen_from(distance, np.radians(off), np.radians(azimuth))
    options = {"receiver": still(seen_from(1.3 * distance, 0.5, 1.0))} if bistatic else {}
    raw = sarcl.echo(
        scene, TONE, still(tx), tolerance=1e-2, shadows=False, polarization=("HH", "VV"), vertical=VERTICAL, **options
    )
    assert error(raw, triangles) <= 1e-2


def test_many_looks_take_the_estimate_from_small_pieces():
    scene = sarcl.Scene.facets(plate(1.0), two_sided=False)
    track = still(*(seen_from(10.0, np.radians(20 + 0.1 * i)) for i in range(8)))
    raw = sarcl.echo(scene, TONE, track, tolerance=1e-2, shadows=False, vertical=VERTICAL)
    exact = [
        facet.facet_echo(
            scene.triangles, np.inf, raw.frequency[p : p + 1], raw.tx[p], raw.tx[p], raw.reference_range[p],
            up=tuple(VERTICAL.tolist()),
        )[0, 0, 0]
        for p in range(8)
    ]  # fmt: skip
    assert np.linalg.norm(raw.samples[:, 0] - exact) <= 1e-2 * np.linalg.norm(exact)
    assert raw.report.plan["facets"] <= 1e5


def cutting_error(triangles, tx):
    ends = PulseGeometry(tx[None], tx[None])
    scene = sarcl.Scene.facets(triangles, two_sided=False)
    return CuttingError(FacetView(scene, ends, 9.6e9, 0.0, ("HH",), VERTICAL))


@pytest.mark.parametrize("triangles", [plate(1.0), SCALENE], ids=["plate", "scalene"])
@pytest.mark.parametrize("distance, off", [(10.0, 5), (10.0, 20), (30.0, 20)])
def test_the_estimate_from_small_pieces_is_no_less_than_their_error_and_no_more_than_ten_times(
    triangles, distance, off
):
    """Sums of linear phases over all pieces against the integral over the facets."""
    tx, f = seen_from(distance, np.radians(off)), 9.6e9
    k, up = 2 * np.pi * f / SPEED_OF_LIGHT, tuple(VERTICAL.tolist())
    whole = facet.facet_echo(triangles, np.inf, np.array([f]), tx, tx, distance, up=up)[0, 0, 0]
    estimates = cutting_error(triangles, tx)
    for edge in (0.01, 0.0053):
        parts, _ = cut(triangles, longest_piece(edge), 10**6)
        middle = parts.mean(axis=1)
        look = unit(tx - middle)
        made = facet.facet_amplitude(parts, np.inf, f, look, look, up)[:, 0, 0]
        total = made @ np.exp(-2j * k * (np.linalg.norm(tx - middle, axis=1) - distance))
        found = abs(total - whole) / abs(whole)
        assert found <= estimates.gain(edge) * estimates.relative(edge) <= 10 * found


def test_pieces_in_step_with_the_wave_have_no_estimate():
    # a direction in which the errors of pieces add up exists from half a cycle of path along an edge on
    estimates = cutting_error(plate(1.0), seen_from(1e4, np.radians(20)))
    most = np.pi / (4 * np.pi * 9.6e9 / SPEED_OF_LIGHT * np.sin(np.radians(20)))
    assert np.isinf(estimates.relative(1.01 * most)) and estimates.relative(0.99 * most) < 1e-3


def test_rounding_does_not_decide_which_pieces_are_cut():
    top = float(np.linalg.norm(SCALENE[0, 1] - SCALENE[0, 0]))
    for halvings in range(6, 13):
        edge = longest_piece(top / 2 ** (halvings / 2))
        counts = {len(cut(SCALENE + shift, edge, 10**6)[0]) for shift in (0.0, 0.1, 1 / 3, 1e3)}
        assert len(counts) == 1


@pytest.mark.filterwarnings("ignore:the permittivity of wet soil is known")
@pytest.mark.parametrize("material", ["metal", "wet soil", ROUGH])
@pytest.mark.parametrize("edge", [0.03, 0.2, 0.6])
@pytest.mark.parametrize("bandwidth", [0.06, 0.4])
def test_the_error_between_frequencies_is_no_more_than_samples_say(material, edge, bandwidth):
    """Amplitudes of 400 facets at 9 frequencies, interpolated, against what 96 of them promise."""
    random = np.random.default_rng(9)
    corners = random.uniform(-30, 30, (400, 1, 3)) + random.uniform(-0.6, 0.6, (400, 3, 3)) * edge
    scene, fc = sarcl.Scene.facets(corners, material=material), 9.6e9
    track = still(*(seen_from(8e3, 0.8, a) for a in np.linspace(0, 0.05, 7)))
    antennas = PulseGeometry(track.positions, track.positions)
    vertical, band = np.array([0.0, 0, 1]), bandwidth * fc
    view = FacetView(scene, antennas, fc, band, ["HH", "HV"], vertical)
    errors = OverBand(view, np.inf, np.zeros(len(scene.triangles), bool)).errors(np.inf)
    part = FacetSet(
        scene.triangles, scene.reflectivity, scene.two_sided, scene.material, scene.materials, None, np.arange(400),
        np.exp(2j * np.pi * random.uniform(size=400)).astype(np.complex64),
    )  # fmt: skip

    def sent(f):
        return part.amplitudes(track.positions[3], track.positions[3], np.array([f]), ["HH", "HV"], vertical).ravel()

    f = np.linspace(fc - band / 2, fc + band / 2, 9)
    exact = np.stack([sent(one) for one in f])
    for n in (1, 2, 4, 8):
        nodes = polynomials.chebyshev(fc, band, n)
        at_nodes = np.stack([sent(one) for one in nodes])
        for power in (0, 1):
            plan = facet_plan.FacetPlan(1.0, nodes, 0.0, 1.0, power)
            over = at_nodes / (nodes[:, None] / 1e9) ** power
            found = np.linalg.norm(plan.basis(f).T @ over - exact) / np.linalg.norm(exact)
            assert found <= errors[power][n] + 1e-14, (power, n)


@pytest.mark.parametrize("angle", quick_of([20, 60], [20, 30, 45, 60]))
def test_a_bright_facet_in_shadow_hides_no_errors(angle):
    """A tilted triangle from 30 m, and behind it one along the wavefronts, whose echo would be 10, 20, 50 and
    2300 times as strong."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    screen = np.array([[-1.5 * c, -1.2, 1.5 * s], [1.5 * c, -1.2, -1.5 * s], [0, 1.8, 0.1]])
    hidden = np.array([[-0.4, -0.6, -3], [0.4, -0.6, -3], [0, 0.2, -3]])
    scene, low = sarcl.Scene.facets([screen, hidden]), sarcl.Waveform.chirp(center=1e9, bandwidth=2e7, duration=1e-6)
    raw = sarcl.echo(
        scene, low, still([0, 0, 30.0]), tolerance=1e-1, range_window=(-20, 20), vertical=VERTICAL, check=False
    )
    f, up = raw.frequency[0] + raw.frequency_step[0] * np.arange(0, raw.n_samples, 7), tuple(VERTICAL.tolist())
    place = raw.tx[0], raw.tx[0], raw.reference_range[0]
    wanted = facet.facet_echo(screen[None], np.inf, f, *place, up=up)[:, 0, 0]
    wanted *= np.abs(low.pulse_spectrum(f)) ** 2
    achieved = np.linalg.norm(raw.samples[0, ::7] - wanted) / np.linalg.norm(wanted)
    assert 1e-3 < achieved <= raw.report.predicted_error <= 1e-1


@pytest.mark.parametrize("height", [-0.5, 0.5])
def test_a_plate_under_a_terrain_counts_as_little_as_under_the_same_facets(device, height):
    """What lies under a terrain below all lines of sight is hidden by its heights; under facets alone, by rays."""
    axis, tx = np.linspace(-4, 4, 5), np.array([[30.0, 0, 60.0]])
    ground = sarcl.Scene.from_heights(axis, axis, np.zeros((5, 5)), material=ROUGH)
    large, small = (sarcl.shapes.plate((side, side)).moved((x, x, z)) for side, x, z in ((2, 0, height), (0.5, 2, 0.5)))
    known = ground + large + small
    bare = sarcl.Scene.facets(
        known.triangles, two_sided=known.two_sided, material=known.material, materials=known.materials
    )
    assert known.heights is not None and bare.heights is None
    views = [FacetView(scene, PulseGeometry(tx, tx), 9.6e9, 0.0, ("HH",), VERTICAL, device) for scene in (known, bare)]
    one, other = ((error.gain(0.2), error.relative(0.02)) for error in map(CuttingError, views))
    assert one == pytest.approx(other, rel=1e-6)


# Directions -------------------------------------------------------------------------------------------------

UP = np.array([0.0, 0.0, 1.0])
METAL = sarcl.Material()
NAMES = ("HH", "VV")


def needle(random):
    """A triangle 1 m long and 1 cm wide about the origin, level or nearly so, m (1, 3, 3)."""
    angle = random.uniform(0, np.pi)
    along = np.array([np.cos(angle), np.sin(angle), random.uniform(-0.3, 0.3)])
    across = 0.005 * np.array([-np.sin(angle), np.cos(angle), 0.0])
    return np.array([[-along / 2 - across, along / 2 - across, along / 2 + across]])


def finer(triangles, material, f, tx, rx, reference_range, edge):
    """Echo of facets cut to `edge`, m, in float64: each with its own H, V and distance, complex128 (2,)."""
    parts = cut(triangles, edge, 10**6)[0]
    k = len(parts)
    part = FacetSet(parts, np.ones(k), np.ones(k, bool), np.zeros(k, int), (material,), None, np.arange(k), np.zeros(0))
    places = parts.mean(axis=1)
    path = sum(np.linalg.norm(end - places, axis=1) for end in (tx, rx)) - 2 * reference_range
    return np.exp(-2j * np.pi * f / SPEED_OF_LIGHT * path) @ part.amplitudes(tx, rx, np.array([f]), NAMES, UP)[0]


def error_beside_finer(raw, triangles, material):
    """Error of an echo in HH and VV at its first frequency, relative to that of pieces of 1/400 of the longest edge."""
    wrong = right = 0.0
    rx = raw.tx if raw.rx is None else raw.rx
    for row in range(0, len(raw.tx), 2):
        wanted = finer(triangles, material, raw.frequency[row], raw.tx[row], rx[row], raw.reference_range[row], 1 / 400)
        wrong += (np.abs(raw.samples[row : row + 2, 0] - wanted) ** 2).sum()
        right += (np.abs(wanted) ** 2).sum()
    return np.sqrt(wrong / right)


@pytest.mark.slow
@pytest.mark.parametrize("pulses", [1, 8])
@pytest.mark.parametrize("material", [METAL, WET], ids=["metal", "soil"])
@pytest.mark.parametrize("bistatic", [True, False])
def test_needles_seen_along_the_vertical_are_within_the_tolerance_or_refused(pulses, material, bistatic):
    """One H and V per facet, as the curvature of the wave alone allows: up to 30 times the tolerance."""
    refused = 0
    for seed in range(6):
        random = np.random.default_rng(seed)
        triangles, off = needle(random), 10.0 ** random.uniform(-1, 2.5)
        tx = np.array([*(off * unit(random.normal(size=2))), 1e3])
        rx = np.array([*(10.0 ** random.uniform(1, 2.8) * unit(random.normal(size=2))), 900.0])
        ways = np.arange(pulses)[:, None] * [0.05, 0.02, 0.0]
        options = {"receiver": still(*(rx + ways))} if bistatic else {}
        scene = sarcl.Scene.facets(triangles, material=material)
        try:
            raw = sarcl.echo(
                scene, TONE, still(*(tx + ways)), tolerance=1e-3, shadows=False, check=False, polarization=NAMES,
                vertical=UP, **options,
            )  # fmt: skip
        except ToleranceUnreachable as exc:
            assert off < 1 and "vertical" in str(exc), (seed, off)
            refused += 1
            continue
        assert error_beside_finer(raw, triangles, material) <= 1e-3, (seed, off)
    assert refused < 3 and (refused == 0 or bistatic)


def test_a_needle_across_the_vertical_is_refused_with_what_helps():
    scene = sarcl.Scene.facets([[[-0.5, -0.005, 0], [0.5, -0.005, 0], [0.5, 0.005, 0]]])
    ways = np.arange(8)[:, None] * [0.05, 0.02, 0.0]
    ends = {"receiver": still(*(np.array([300.0, 400.0, 900.0]) + ways)), "shadows": False, "check": False}
    track = still(*(np.array([0.1, 0.0, 1e3]) + 0.1 * ways))
    with pytest.raises(ToleranceUnreachable, match=r"H and V .*another vertical="):
        sarcl.echo(scene, TONE, track, tolerance=1e-3, vertical=UP, **ends)
    raw = sarcl.echo(scene, TONE, track, tolerance=1e-3, vertical=(1, 0, 0), **ends)
    assert raw.report.predicted_error <= 1e-3


def direction_error(scene, antennas):
    return DirectionError(FacetView(scene, antennas, 9.6e9, 0.0, NAMES, UP))


def test_h_and_v_turn_by_the_change_of_azimuth():
    """The rotation that the bound uses against the vectors themselves, for small steps of the line of sight."""
    random = np.random.default_rng(1)
    scene = sarcl.Scene.facets(plate(1.0))
    ends = PulseGeometry(np.array([[1.0, 2.0, 1e3]]), np.array([[300.0, 0.0, 1e3]]))
    errors = direction_error(scene, ends)
    end, places = np.array([20.0, 30.0, 1e3]), random.uniform(-5, 5, (200, 3))
    others = places + 1e-3 * random_units(random, 200)
    turn = _rotations(errors._turned_by(places, others, end))
    (h, v), (h2, v2) = (polarisation(unit(p - end), (0.0, 0.0, 1.0)) for p in (places, others))
    for i, vector in enumerate((h2, v2)):
        assert np.abs(turn[:, i, :1] * h + turn[:, i, 1:] * v - vector).max() < 3e-6  # the direction turns by 1e-6


@pytest.mark.parametrize("off", [3.0, 30.0, 200.0])
def test_the_bound_is_no_less_than_what_the_corners_make_of_the_matrix(off):
    """A small plate at one place: against scattering matrices with H and V of its corners."""
    triangles = plate(0.2)[:1]
    tx, rx = np.array([off, 0.4 * off, 1e3]), np.array([-200.0, 350.0, 800.0])
    ends, scene = PulseGeometry(tx[None], rx[None]), sarcl.Scene.facets(triangles, material=WET)
    errors = direction_error(scene, ends)
    eps = WET.permittivity(9.6e9)
    middle = triangles.mean(axis=1)
    exact = scattering_matrix(UP, unit(tx - middle[0]), unit(rx - middle[0]), eps)
    corners = triangles[0]
    there = scattering_matrix(UP, unit(tx - corners), unit(rx - corners), eps)
    apart = np.abs(there - exact)[:, [0, 1], [0, 1]] ** 2
    found = np.sqrt(apart.sum(axis=1).max() / (np.abs(np.diag(exact)) ** 2).sum())
    bound, sharp = errors.turn(1.0)
    assert found <= 1.1 * bound + 3e-4  # the direction itself turns by 1.5e-4
    assert bound <= 1.2 * found + 3e-4 and not sharp
    assert errors.turn(0.02)[0] == pytest.approx(0.02 / 0.2 / np.sqrt(2) * bound, rel=0.05)


def test_what_turns_alike_or_is_seen_from_the_side_costs_nothing():
    scene = sarcl.Scene.facets(plate(1.0))
    above, aside = np.array([[0.2, 0.1, 1e3]]), np.array([[800.0, 0.0, 900.0]])
    for tx, rx in ((above, above), (aside, aside), (aside, 1.1 * aside)):
        assert direction_error(scene, PulseGeometry(tx, rx)).turn(1.0) == (0.0, False)
    both = direction_error(scene, PulseGeometry(above, aside)).turn(1.0)
    assert both[0] > 0.3 and both[1]
    assert direction_error(scene, PulseGeometry(aside, above)).turn(1.0) == pytest.approx(both)


@pytest.mark.parametrize("height, material", thinned([0.2, 1.0, 4.0, 20.0, 100.0], [WET, METAL]))
def test_grazing_facets_are_computed_as_exactly_as_the_tolerance_says(height, material):
    """Where the cosine is small its rounding counts: at 4e-3, float32 sums of soil had 1.6 times the tolerance."""
    tx, rx = np.array([5e3, 1e3, height]), np.array([1e3, 4e3, 2e3])
    scene = sarcl.Scene.facets(plate(0.5), material=material, two_sided=False)
    got, wanted = echo_and_integral(scene, TONE, tx, rx, (0.6, 0.0, 0.8), tolerance=1e-3, shadows=False)
    assert np.linalg.norm(got - wanted) <= 1e-3 * np.linalg.norm(wanted)


@pytest.mark.parametrize("bistatic", [True, False])
def test_the_rounding_of_grazing_facets_is_what_their_cosines_say(bistatic):
    for height in (1.0, 10.0, 100.0):
        tx, rx = np.array([[5e3, 1e3, height]]), np.array([[1e3, 4e3, 2e3]])
        ends = PulseGeometry(tx, rx if bistatic else tx)
        scene = sarcl.Scene.facets(plate(0.5), material=WET, two_sided=False)
        found = direction_error(scene, ends).rounding
        cosine = height / np.linalg.norm(tx)
        assert 0.5 < found * cosine / FLOAT32_DIRECTION < 3


@pytest.mark.slow
def test_errors_of_facets_in_shadow_do_not_cancel_by_chance():
    """Triangles in four planes, one above the other: cut to 0.73 m, rays told of 5e-5, and the error was 1.3e-4.
    The planes are far away: finer pieces lie nearer to the exact sum, by the square of their size."""
    random = np.random.default_rng(101)
    size = 10 ** random.uniform(-1.2, 0)
    triangles = random.normal(size=(4, 3, 3)) * size
    triangles[:, :, 2] = (np.arange(4) * 0.4 * size)[:, None]
    tx, rx = np.array([[15584.0, 32544.0, 21363.0]]), np.array([[26076.0, 38964.0, 40414.0]])
    chirp = sarcl.Waveform.chirp(center=3.477e9, bandwidth=34.77e6, duration=1e-6)
    track, receiver = (sarcl.Trajectory(np.zeros(1), end) for end in (tx, rx))
    got, finer = (
        np.asarray(sarcl.echo(sarcl.Scene.facets(triangles), chirp, track, receiver=receiver, tolerance=one).samples)
        for one in (1e-4, 1e-5)
    )
    assert np.linalg.norm(got - finer) <= 0.9e-4 * np.linalg.norm(finer)
