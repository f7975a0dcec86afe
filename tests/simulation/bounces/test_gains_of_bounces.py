"""Antennas whose beams end on the facets: the gain of one counts at the first facet, that of the other at the last."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import sarcl
from sarcl import shapes

CENTER = 9.6e9  # Hz
K = 2 * np.pi * CENTER / 299_792_458.0
SIDE, DISTANCE = 0.5, 100.0  # m
CHIRP = sarcl.Waveform.chirp(center=CENTER, bandwidth=20e6, duration=1e-6)
# the half-power edge of a beam of 5 mrad, 0.35 m on a plate, crosses the first plate; the receiver looks elsewhere
SENDS = sarcl.Antenna.gaussian(width=(5e-3, 5e-3))
RECEIVES = sarcl.Antenna.gaussian(width=(8e-3, 6e-3), mount=Rotation.from_euler("zy", [2e-3, 3e-3]).as_matrix())


def currents_on_both_plates(tx: np.ndarray, axes: list[np.ndarray], n: int = 700) -> complex:
    """VV of two reflections, m: places on the last plate, and for each the place where its ray left the first."""
    at = (np.arange(n) + 0.5) / n * SIDE
    across, along = (part.ravel() for part in np.meshgrid(at, at - SIDE / 2))
    total = 0j
    u = tx / np.linalg.norm(tx)
    v = np.cross(u, [0.0, 1, 0])
    for first, last in ((2, 0), (0, 2)):  # the normals' axes
        place = np.zeros((n * n, 3))
        place[:, first], place[:, 1] = across, along
        image = tx * (1 - 2 * np.eye(3)[first])
        share = -image[first] / (place[:, first] - image[first])
        begin = image + share[:, None] * (place - image)
        reaches = (begin[:, last] > 0) & (begin[:, last] < SIDE) & (np.abs(begin[:, 1]) < SIDE / 2)
        gain = SENDS.gain((begin - tx) @ axes[0], CENTER) * RECEIVES.gain((place - tx) @ axes[1], CENTER)
        path = np.linalg.norm(place - image, axis=1) + np.linalg.norm(place - tx, axis=1)
        wave = (reaches * gain * np.exp(-1j * K * (path - 2 * DISTANCE))).sum() * (SIDE / n) ** 2
        normal, field = np.eye(3)[last], -v + 2 * v[first] * np.eye(3)[first]
        way = -u * (1 - 2 * np.eye(3)[first])
        total += K / (2 * np.sqrt(np.pi)) * wave * (2 * np.cross(normal, np.cross(way, field)) @ v)
    return complex(total)


@pytest.mark.parametrize("tolerance", [1e-1, 3e-2, pytest.param(1e-2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("aim", [(0.25, 0.0, 0.0), (0.45, 0.2, 0.0), (0.0, -0.25, 0.3)])
def test_beams_that_end_on_a_plate_weigh_each_part_of_it(aim, tolerance):
    position = DISTANCE * np.array([1.0, 0, 1]) / np.sqrt(2)
    track = sarcl.pointing.spotlight(sarcl.Trajectory(None, position[None]), aim)
    options = {
        "antenna": (SENDS, RECEIVES),
        "polarization": "VV",
        "reference": (0, 0, 0),
        "range_window": (-30, 30),
        "tolerance": tolerance,
        "check": False,
    }
    two, one = (
        sarcl.echo(shapes.dihedral((SIDE, SIDE)), CHIRP, track, bounces=n, **options).samples[0] for n in (2, 1)
    )
    expected = currents_on_both_plates(position, [a.axes(track)[0] for a in (SENDS, RECEIVES)])
    error = abs((two - one)[len(one) // 2] - expected)
    assert error < max(tolerance, 2e-3) * abs(expected)  # the sum over places: 1e-3, at outlines of beams


def test_antennas_that_differ_keep_the_cross_polarisation_of_each_way():
    """HV and VH of one antenna are equal; of two in one place each is that of antennas 1 um apart."""
    look = np.array([0.5, 0.55, 0.67])
    track = sarcl.pointing.spotlight(sarcl.Trajectory(None, DISTANCE * look[None]), (0.2, 0.1, 0.15))
    beside = sarcl.pointing.spotlight(sarcl.Trajectory(None, track.positions + 1e-6), (0.2, 0.1, 0.15))
    options = {
        "antenna": (SENDS, RECEIVES), "polarization": "all", "reference": (0, 0, 0),
        "range_window": (-30, 30), "tolerance": 1e-1, "check": False, "bounces": 3,
    }  # fmt: skip
    together, apart, alike = (
        sarcl.echo(shapes.trihedral(SIDE), CHIRP, track, **options | changes).samples[1:3]
        for changes in ({}, {"receiver": beside}, {"antenna": SENDS})
    )
    assert np.linalg.norm(together - apart) < 1e-3 * np.linalg.norm(apart)
    assert np.linalg.norm(together[0] - together[1]) > 0.05 * np.linalg.norm(together)
    assert np.linalg.norm(alike[0] - alike[1]) < 1e-5 * np.linalg.norm(alike)
