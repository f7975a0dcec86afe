"""Facets cut as coarsely as their errors allow, compared with the integral over the uncut facets."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.cases import thinned
from helpers.facet_cases import plate, seen_from, still

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.base.vectors import unit
from sarcl.numerics.pulse_geometry import PulseGeometry
from sarcl.reference import facet
from sarcl.scattering._cutting_error import CuttingError
from sarcl.scattering._facet_norm import longest_piece
from sarcl.scattering.facet_kinds import FacetView
from sarcl.scene.triangles import cut

TONE = sarcl.Waveform.chirp(center=9.6e9, bandwidth=1e6, duration=1e-6)
CHIRP = sarcl.Waveform.chirp(center=9.6e9, bandwidth=6e8, duration=1e-6)
VERTICAL = np.array([0.0, 1.0, 0.05]) / np.linalg.norm([0.0, 1.0, 0.05])
SCALENE = np.array([[[-0.5, -0.4, 0], [0.6, -0.3, 0], [0.05, 0.45, 0]]])
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
