"""Echoes of what lies behind thin sheets."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl import shapes
from sarcl.reference.facet import film

EPS, THICKNESS, CENTER = 3.0, 0.01, 5e9  # relative permittivity, m, Hz
GLASS = sarcl.Material(EPS, thickness=THICKNESS)
CHIRP = sarcl.Waveform.chirp(center=CENTER, bandwidth=100e6, duration=1e-6)
NAMES = ("HH", "VV", "HV")
FAR = 1e7  # m
AZIMUTH, ELEVATION = np.radians([0.0, 20, 40, 60]), np.radians([80.0, 70, 60, 75])
GATE = 0.05  # dB


def passed(frequency, incidence):
    """T_h, T_v of the glass."""
    cosine, frequency = np.broadcast_arrays(np.cos(incidence), frequency)
    return film(cosine, EPS, THICKNESS, frequency)[2:]


def echo(scene, places, polarization=NAMES, **options):
    """Samples (n_pulses, n_polarizations, n), frequencies, Hz, and the report."""
    track = sarcl.Trajectory(None, places)
    options = {"reference": (0, 0, 0), "range_window": (-8, 8), "polarization": polarization} | options
    raw = sarcl.echo(scene, CHIRP, track, **options)
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)
    return raw.samples.reshape(len(places), len(polarization), -1).astype(complex), frequencies, raw.report


def towards(azimuth, elevation):
    c = np.cos(elevation)
    return np.stack([c * np.cos(azimuth), c * np.sin(azimuth), np.sin(elevation) + 0 * azimuth], axis=-1)


SHEET = shapes.plate((8, 8), material=GLASS)
TILTED = shapes.plate((1, 2), position=(0.3, 0.1, 2.0), rotation=(0.3, 0.2, 0), material=GLASS)
PLATE = shapes.plate((0.3, 0.3), position=(0.1, 0, -1.0), rotation=(0, 0.5, 0))
SCENES = {
    "behind a large sheet": SHEET + PLATE,
    "half behind it": shapes.plate((1, 1), position=(0.45, 0, -0.5), material=GLASS) + PLATE,
    "behind two, one tilted": SHEET + TILTED + PLATE,
    "opaque facet before the sheet": SHEET + PLATE + shapes.plate((0.2, 0.2), position=(0.2, 0, 0.3)),
    "opaque facet behind the sheet": SHEET + PLATE + shapes.plate((0.2, 0.2), position=(0.2, 0, -0.5)),
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("receiver", [None, (-0.5, 1.0)], ids=["one antenna", "two"])
def test_from_far_away_echoes_are_those_of_rcs(name, receiver):
    scene, options, hears = SCENES[name], {"polarization": NAMES, "receiver": receiver}, None
    if receiver is not None:
        hears = sarcl.Trajectory(None, FAR * towards(*(np.full(len(AZIMUTH), angle) for angle in receiver)))
    samples, frequencies, report = echo(scene, FAR * towards(AZIMUTH, ELEVATION), receiver=hears, check=True)
    s = sarcl.rcs(scene, AZIMUTH, ELEVATION, frequencies, **options).swapaxes(1, 2)
    all_seen = sarcl.rcs(scene, AZIMUTH, ELEVATION, frequencies, shadows=False, **options).swapaxes(1, 2)
    assert np.linalg.norm(s - all_seen) > 0.02 * np.linalg.norm(s)
    assert np.linalg.norm(samples - s) < 1e-3 * np.linalg.norm(s)
    assert report.measured_error < 1e-6


def test_a_plate_behind_a_parallel_slab_is_seen_through_it_twice():
    """Far away, from 0 to 60 deg: T_h^2 in HH and T_v^2 in VV."""
    incidence = np.radians(np.arange(0, 61, 10))
    places = FAR * towards(0 * incidence, np.pi / 2 - incidence)
    plate = shapes.plate((0.1, 0.1), position=(0, 0, -1.0))
    both, front, (alone, frequencies, _) = echo(SHEET + plate, places)[0], echo(SHEET, places)[0], echo(plate, places)
    for p, angle in enumerate(incidence):
        for column, through in enumerate(passed(frequencies, angle)):
            expected, behind = alone[p, column] * through**2, (both - front)[p, column]
            assert 20 * np.log10(np.linalg.norm(behind) / np.linalg.norm(expected)) == pytest.approx(0, abs=GATE)
            assert np.linalg.norm(behind - expected) < 1e-3 * np.linalg.norm(expected) + 1e-6 * np.linalg.norm(front[p])


def test_a_receiver_elsewhere_sees_through_a_slab_at_its_own_angle():
    """Transmitter and receiver at different angles in one plane: T(in) T(out), of H and of V."""
    away = np.radians([10.0, 30.0, 50.0])
    track, back = (FAR * towards(np.zeros(3), np.pi / 2 - angle) for angle in (away, -away[::-1] / 2))
    plate, hears = shapes.plate((0.1, 0.1), position=(0, 0, -1.0)), sarcl.Trajectory(None, back)
    both, front, alone = (echo(scene, track, receiver=hears) for scene in (SHEET + plate, SHEET, plate))
    for p in range(3):
        sent, returned = passed(both[1], away[p]), passed(both[1], away[::-1][p] / 2)
        for column in range(2):
            expected, behind = alone[0][p, column] * sent[column] * returned[column], (both[0] - front[0])[p, column]
            near = 1e-3 * np.linalg.norm(expected) + 1e-6 * np.linalg.norm(front[0][p])
            assert np.linalg.norm(behind - expected) < near


NEAR, TWO = np.array([[6.0, 0.0, 20.0]]), ("HH", "VV")
PANE = shapes.plate((1.6, 0.3), position=(0.3, 0, 0), material=GLASS)


@pytest.fixture(scope="module")
def strips():
    """A plate of 1 m behind the pane as the sum of narrow ones, each times T^2 along its own line of sight."""
    total, n = 0.0, 8
    for x in (np.arange(n) + 0.5) / n - 0.5:
        alone, frequencies, _ = echo(shapes.plate((1.0 / n, 0.05), position=(x, 0, -1.0)), NEAR, TWO, tolerance=1e-3)
        total += alone * np.square(passed(frequencies, np.arctan2(NEAR[0, 0] - x, NEAR[0, 2] + 1.0)))
    return total + echo(PANE, NEAR, TWO, tolerance=1e-3)[0]


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3])
def test_near_a_sheet_each_part_has_the_transmission_of_its_own_angle(strips, tolerance):
    plate = shapes.plate((1.0, 0.05), position=(0, 0, -1.0))
    samples, _, report = echo(PANE + plate, NEAR, TWO, tolerance=tolerance)
    assert report.predicted_error <= tolerance
    assert np.linalg.norm(samples - strips) < tolerance * np.linalg.norm(strips)


def test_the_report_counts_what_is_seen_through_sheets_once():
    place = FAR * towards(AZIMUTH[:1], ELEVATION[:1])
    report = echo(SHEET + shapes.plate((0.1, 0.1), position=(0, 0, -1.0)), place)[2]
    assert report.plan["facets behind sheets"] == 2
    assert report.contributions_skipped["shadowed"] == 0
