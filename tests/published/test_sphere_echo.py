"""The conducting sphere by physical optics, from 10 000 km away, through sarcl.echo."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.base.constants import SPEED_OF_LIGHT

# ka -> sigma/(pi a^2) by physical optics: |1 + (j/b)(1 - exp(-jb))|^2, b = 2 k a
RATIOS = {50: 1.01015, 100: 1.00876, 200: 1.00427}
FACETS = {50: 80_000, 100: 80_000, 200: 320_000}
VIEWS = [(0.4, 0.0), (1.0, 1.0), (1.9, 2.2), (2.8, -1.3)]


def excess(ball, ka, views=VIEWS, **options):
    """dB above physical optics of a unit sphere at each view (tilt, azimuth)."""
    tone = sarcl.Waveform.chirp(center=ka * SPEED_OF_LIGHT / (2 * np.pi), bandwidth=1e3, duration=1e-6)
    tilt, azimuth = np.array(views).T
    looks = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)], axis=1)
    track = sarcl.Trajectory(np.arange(len(looks)) * 1.0, 1e7 * looks)
    raw = sarcl.echo(ball, tone, track, **{"shadows": False, "tolerance": 1e-4, "check": False, **options})
    return 20 * np.log10(np.abs(raw.samples).mean(axis=1)) - 10 * np.log10(np.pi * RATIOS[ka])


@pytest.mark.parametrize("ka", RATIOS)
def test_the_table_is_the_closed_form(ka):
    b = 2 * ka
    assert abs(1 + 1j / b * (1 - np.exp(-1j * b))) ** 2 == pytest.approx(RATIOS[ka], abs=1e-5)


@pytest.mark.parametrize("ka", RATIOS)
def test_a_fine_mesh_is_within_two_hundredths_of_a_decibel(device, ka):
    assert np.abs(excess(shapes.sphere(1.0, facets=FACETS[ka]), ka, device=device)).max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("ka", [50, 200])
def test_shadows_change_nothing_on_a_convex_body(ka):
    ball = shapes.sphere(1.0, facets=FACETS[ka])
    with_shadows, without = (excess(ball, ka, shadows=s) for s in (True, False))
    assert with_shadows == pytest.approx(without, abs=1e-3)


def test_the_error_falls_with_the_number_of_facets():
    # as the square of their edges
    errors = [np.abs(excess(shapes.sphere(1.0, facets=n), 50)).mean() for n in (20_000, 80_000, 320_000)]
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.25)


def globe(latitudes, sections):
    """A unit sphere cut along latitudes and longitudes."""
    tilt, azimuth = np.linspace(0, np.pi, latitudes + 1)[:, None], 2 * np.pi * np.arange(sections) / sections
    up = np.broadcast_to(np.cos(tilt), (latitudes + 1, sections))
    points = np.stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), up], axis=-1)
    a, b = points[:-1], points[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    triangles = [np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in ((a, b, c), (b, d, c))]
    return sarcl.Scene.facets(np.concatenate(triangles), two_sided=False)


@pytest.mark.filterwarnings("ignore:mesh too coarse")
def test_rings_too_wide_for_the_wavelength_err_by_decibels_seen_along_their_axis():
    # ka = 50, 50 latitudes, pole-on: all errors of a ring add up
    pole, side = excess(globe(50, 200), 50, [(1e-9, 0.0), (np.pi / 2, 0.3)])
    assert pole == pytest.approx(-3.85, abs=0.02) and abs(side) < 0.1
    assert abs(excess(globe(100, 200), 50, [(1e-9, 0.0)])[0]) < 0.06
