"""Echoes past and through thin sheets against small pieces, each with a ray to each antenna (reference.facet)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from helpers.cases import quick_of

import sarcl
from sarcl import shapes
from sarcl.reference.facet import sheet_echo

CHIRP = sarcl.Waveform.chirp(center=5e9, bandwidth=100e6, duration=1e-6)
NAMES = ("HH", "HV", "VH", "VV")
TOLERANCE = 1e-2
SIZE = 0.004  # m: pieces of the reference are dark or seen whole
PIECES = 7e-3  # its share of the error of an echo: 4 mm against 2 mm, 16 random scenes, rms 5e-3, at most 1.2e-2
GLASS, WET = sarcl.Material(3.0, thickness=0.01), sarcl.Material(5.0 - 0.5j, thickness=0.004)


def echo(scene, tx, rx=None, **options):
    """Samples (n_polarizations, 3) at both ends of the band and in its middle, the reference's, and the report."""
    fixed = {"reference": (0, 0, 0), "range_window": (-4, 4), "polarization": NAMES, "tolerance": TOLERANCE}
    receiver = None if rx is None else sarcl.Trajectory(None, rx[None])
    raw = sarcl.echo(scene, CHIRP, sarcl.Trajectory(None, tx[None]), receiver=receiver, **fixed | options)
    some = [0, raw.n_samples // 2, raw.n_samples - 1]
    frequencies = raw.frequency[0] + raw.frequency_step[0] * np.array(some)
    expected = sheet_echo(scene, frequencies, (tx, tx if rx is None else rx), raw.reference_range[0], size=SIZE)
    return raw.samples[:, some], expected.reshape(3, 4).T, raw.report


def check(scene, tx, rx=None, **options):
    samples, expected, report = echo(scene, tx, rx, **options)
    assert np.linalg.norm(samples - expected) < (report.tolerance + PIECES) * np.linalg.norm(expected)
    return report


def plate(size, position, rotation=(0, 0, 0), material="metal", two_sided=True):
    shape = shapes.plate(size, position=position, rotation=rotation, material=material)
    return shape if two_sided else sarcl.Scene.facets(shape.triangles, two_sided=False, material=material)


PANE = plate((0.5, 0.4), (0.1, 0.05, 0), (0.1, 0.2, 0), GLASS)
TARGET = plate((0.3, 0.2), (0, 0, -0.4), (-0.1, 0.1, 0.2))
BESIDE = plate((0.3, 0.2), (-0.25, 0, -0.4), (-0.1, 0.1, 0.2))
CASES = {
    "behind one sheet": PANE + TARGET,
    "partly behind it": PANE + BESIDE,
    "behind two that overlap": PANE + plate((0.4, 0.3), (-0.1, 0, 0.3), (-0.2, 0.1, 0), WET) + TARGET,
    "a sheet behind a sheet": PANE + plate((0.4, 0.3), (-0.1, 0, -0.3), (-0.2, 0.1, 0), WET),
    "opaque facet before a sheet": PANE + TARGET + plate((0.1, 0.1), (0.05, 0, 0.3), (0.1, 0.2, 0.4)),
    "opaque facet between": PANE + TARGET + plate((0.1, 0.1), (0.05, 0, -0.2), (0, 0.4, 0)),
    "reflecting from one side": PANE + plate((0.3, 0.2), (0, 0, -0.4), (-0.1, 0.1, 0.2), two_sided=False),
    "turned away": PANE + TARGET + plate((0.3, 0.2), (0.2, 0, -0.2), (np.pi, 0.1, 0.2), two_sided=False),
}
FROM, TO = np.array([[6.0, 3.0, 24.0], [-9.0, 1.5, 15.0]])  # m


@pytest.mark.parametrize(
    "name, antennas",
    quick_of(
        [*((name, "one") for name in CASES), ("a sheet behind a sheet", "two"), ("opaque facet between", "two")],
        [(name, antennas) for name in CASES for antennas in ("one", "two")],
    ),
)
def test_near_sheets_every_part_is_seen_through_what_lies_before_it(name, antennas):
    report = check(CASES[name], FROM, TO if antennas == "two" else None)
    assert report.plan["facets behind sheets"] > 0
    assert report.predicted_error <= TOLERANCE


def random_scene(random):
    """One sheet or two, and three opaque plates: behind, behind and reflecting from one side, and before them."""
    parts = []
    for i in range(random.integers(1, 3)):
        material = sarcl.Material(random.uniform(2, 6) - 0.2j * random.random(), thickness=random.uniform(2e-3, 12e-3))
        place = random.uniform(-0.15, 0.15, 3) + np.array([0, 0, 0.35 * i])
        parts.append(plate(random.uniform(0.2, 0.6, 2), place, random.uniform(-0.4, 0.4, 3), material))
    for i, height in enumerate((-0.5, -0.3, 0.8)):
        place = random.uniform(-0.15, 0.15, 3) * (1, 1, 0.3) + np.array([0, 0, height])
        material = sarcl.Material(5 - 1j) if i == 1 else "metal"
        parts.append(plate(random.uniform(0.1, 0.4, 2), place, random.uniform(-0.5, 0.5, 3), material, i != 1))
    return sum(parts[1:], parts[0])


def place_above(random):
    direction = random.normal(size=3) * (0.3, 0.3, 0) + np.array([0, 0, 1])
    return 24 * direction / np.linalg.norm(direction)


@pytest.mark.parametrize("antennas", [1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_random_scenes(seed, antennas):
    random = np.random.default_rng(seed)
    check(random_scene(random), *(place_above(random) for _ in range(antennas)))


def test_the_reference_converges_and_knows_that_vacuum_is_no_sheet():
    """Pieces of a half, a quarter: nearer and nearer. Behind vacuum the echo is as it would be alone."""
    places, f = (FROM, FROM), np.array([5e9])
    sizes = [sheet_echo(CASES["partly behind it"], f, places, 8.0, size=size) for size in (0.04, 0.02, 0.005)]
    steps = [np.linalg.norm(b - a) / np.linalg.norm(sizes[-1]) for a, b in pairwise(sizes)]
    assert steps[1] < steps[0] / 1.5
    pane = plate((0.5, 0.4), (0.1, 0.05, 0), (0.1, 0.2, 0), sarcl.Material(1.0, thickness=0.01))
    both, alone = (sheet_echo(scene, f, places, 8.0, size=0.02) for scene in (pane + TARGET, TARGET))
    assert both == pytest.approx(alone, rel=1e-6, abs=1e-9)
