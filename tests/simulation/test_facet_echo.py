"""The frequency-by-frequency echo of sarcl/reference/facet.py, which the engine is held to, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.facet_cases import CONDUCTOR, UP, far_amplitude, plate, quarters
from scipy.special import fresnel as fresnel_integrals

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.reference import facet
from sarcl.reference.geometry import half_path

BAND = np.linspace(9.3e9, 9.9e9, 7)


def seen_from(distance, elevation, azimuth):
    return distance * np.array(
        [np.sin(elevation) * np.cos(azimuth), np.sin(elevation) * np.sin(azimuth), np.cos(elevation)]
    )


@pytest.mark.parametrize("distance", [1e3, 1e5])
def test_echo_of_a_tilted_plate_does_not_depend_on_how_it_is_cut(distance):
    target, tx, rx = plate(5.0, np.radians(20)), seen_from(distance, 0.1, 0.4), seen_from(distance, 0.3, -0.2)
    normal_incidence = 2 * np.sqrt(np.pi) * 25 * BAND.max() / SPEED_OF_LIGHT
    wanted = facet.facet_echo(target, 6 - 1j, BAND, tx, rx, distance)
    cut = facet.facet_echo(quarters(target), 6 - 1j, BAND, tx, rx, distance)  # nodes lie at more than twice the density
    assert np.abs(wanted).min() > 1e-8 * normal_incidence
    assert np.abs(cut - wanted).max() < 1e-11 * normal_incidence


def test_echo_from_far_away_is_that_of_plane_waves():
    target, tx, rx = plate(5.0, np.radians(20)), seen_from(1e10, 0.33, 0.01), seen_from(1e10, 0.36, -0.02)
    rounding = float(half_path(tx, rx, np.zeros((1, 3)), 1e10)[0])  # of 1e10 m: 1e-6 m
    for permittivity in (CONDUCTOR, 6 - 1j):
        got = facet.facet_echo(target, permittivity, BAND[:2], tx, rx, 1e10)
        for a, f in zip(got, BAND[:2], strict=True):
            wanted = far_amplitude(target, permittivity, f, tx / 1e10, rx / 1e10)
            wanted = wanted * np.exp(-4j * np.pi * f / SPEED_OF_LIGHT * rounding)
            # 25 m^2/(2 R) of path at the corners
            assert a == pytest.approx(wanted, abs=1e-6 * np.abs(wanted).max())


def test_echo_of_a_plate_at_normal_incidence_is_a_pair_of_fresnel_integrals():
    # exp(-2 j k (sqrt(R^2 + x^2 + y^2) - R)) to second order in x/R; the fourth order is 8e-6 rad in the corners
    distance, side = 1e3, 5.0
    got = facet.facet_echo(plate(side), CONDUCTOR, BAND, distance * UP, distance * UP, distance, by_facet=True)
    k = 2 * np.pi * BAND / SPEED_OF_LIGHT
    scale = np.sqrt(2 * k / (np.pi * distance))
    sine, cosine = fresnel_integrals(scale * side / 2)
    wanted = k / np.sqrt(np.pi) * (2 * (cosine - 1j * sine) / scale) ** 2
    assert got[:, 0, 0] == pytest.approx(wanted, rel=1e-5)
    assert got[:, 1, 1] == pytest.approx(wanted, rel=1e-5)


def test_permittivity_may_change_with_frequency():
    eps = np.array([[6 - 1j, 4 - 2j], [5 - 1j, 4 - 2j]])
    got = facet.facet_echo(plate(0.5), eps, BAND[:2], 1e3 * UP, 1e3 * UP, 1e3)
    for i in range(2):
        one = facet.facet_echo(plate(0.5), eps[i], BAND[i : i + 1], 1e3 * UP, 1e3 * UP, 1e3)
        assert got[i] == pytest.approx(one[0], rel=1e-12)
    assert abs(got[0, 0, 0] / BAND[0] - got[1, 0, 0] / BAND[1]) > 1e-3 * abs(got[0, 0, 0] / BAND[0])


def test_a_complex_permittivity_reflects_alike_at_all_frequencies_and_a_conductivity_does_not():
    """A plate seen along its normal: Fresnel's coefficient (1 - n)/(1 + n), over the -1 of a conductor."""
    track = sarcl.Trajectory(None, np.array([[0, 0, 300.0]]))
    chirp = sarcl.Waveform.chirp(center=3e9, bandwidth=1e9, duration=1e-7)

    def samples(material):
        raw = sarcl.echo(sarcl.shapes.plate((0.5, 0.4), material=material), chirp, track, tolerance=1e-4)
        return np.asarray(raw.samples)[0], raw.frequency[0] + raw.frequency_step[0] * np.arange(raw.n_samples)

    (metal, f), (lossy, _), (conducting, _) = map(
        samples, ("metal", sarcl.Material(3 - 1.5j), sarcl.Material(3, conductivity=1.5 * 3e9 * 2 * np.pi * 8.854e-12))
    )
    inside = abs(f - 3e9) < 0.4e9
    n = np.sqrt(3 - 1.5j)
    assert np.abs(lossy / metal + (1 - n) / (1 + n))[inside].max() < 1e-3
    n = np.sqrt(3 - 1.5j * 3e9 / f)
    assert np.abs(conducting / metal + (1 - n) / (1 + n))[inside].max() < 1e-3
    assert np.abs(conducting / lossy - 1)[inside].max() > 0.02
