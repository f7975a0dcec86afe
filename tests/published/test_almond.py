"""The NASA almond by physical optics against the Austin RCS benchmark: accurate at broadside, wrong at the tip."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl

LENGTH = 9.936 * 0.0254  # m
FREQUENCIES = (3.5e9, 5.12e9, 7e9, 10.25e9)


def almond(along=160, around=120):
    """The closed body of Woo et al. 1993, pointed end at +x, widest in y."""
    half = np.linspace(0, np.pi / 2, along // 2 + 1)
    t = np.concatenate([-0.416667 * np.cos(half), 0.58333 * np.sin(half)[1:]])
    blunt = 0.193333 * np.sqrt(np.maximum(1 - (t / 0.416667) ** 2, 0))
    sharp = 4.83345 * (np.sqrt(np.maximum(1 - (t / 2.08335) ** 2, 0)) - 0.96)
    width = np.maximum(np.where(t < 0, blunt, sharp), 0)[:, None]
    psi = np.arange(around) * 2 * np.pi / around
    ring = [np.broadcast_to(t[:, None], (len(t), around)), width * np.cos(psi), width / 3 * np.sin(psi)]
    places = LENGTH * np.stack(ring, axis=-1)
    a, b = places[:-1], places[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    triangles = np.concatenate([np.stack(three, axis=2).reshape(-1, 3, 3) for three in ((a, c, b), (b, c, d))])
    return sarcl.Scene.facets(triangles, two_sided=False)


@pytest.fixture(scope="module")
def differences(request):
    """dB from the benchmark at each frequency, H and V, and azimuth from the tip, deg: {(i, pol): (azimuth, dB)}."""
    folder = request.getfixturevalue("data_folder") / "austin_rcs" / "IIIA"
    body, azimuth = almond(), np.radians(np.arange(0, 180.5, 0.5))
    track = sarcl.Trajectory(
        np.arange(len(azimuth)) * 1.0, 1e5 * np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], axis=1)
    )
    out = {}
    for i, frequency in enumerate(FREQUENCIES, 1):
        wave = sarcl.Waveform.chirp(center=frequency, bandwidth=1e6, duration=1e-6)
        raw = sarcl.echo(body, wave, track, tolerance=1e-3, polarization=("HH", "VV"), shadows=False, check=False)
        level = 20 * np.log10(np.abs(raw.samples).mean(axis=1)).reshape(-1, 2)
        for p, name in enumerate("HV"):
            table = np.loadtxt(folder / f"ref_rcs.III.A.s1.fx{i}.{name}.txt")
            assert np.allclose(table[:, 2], np.degrees(azimuth)) and np.allclose(table[:, 1], 90)
            out[i, name] = table[:, 2], level[:, p] - table[:, 3]
    return out


def rms(differences, key, low, high):
    azimuth, off = differences[key]
    return float(np.sqrt((off[(azimuth >= low) & (azimuth <= high)] ** 2).mean()))


def test_broadside_is_within_two_decibels_at_10_ghz(differences):
    assert rms(differences, (4, "H"), 70, 110) < 1.7 and rms(differences, (4, "V"), 70, 110) < 2.0


def test_physical_optics_comes_closer_as_the_wavelength_falls(differences):
    for name in "HV":
        series = [rms(differences, (i, name), 70, 110) for i in (1, 2, 3, 4)]
        assert series == sorted(series, reverse=True) and series[-1] < 0.5 * series[0]


def test_on_a_conductor_it_is_the_same_in_both_polarisations_and_between_the_two(differences):
    for i in (1, 2, 3, 4):
        azimuth, h = differences[i, "H"]
        broad = (azimuth >= 70) & (azimuth <= 110)
        assert h[broad].mean() < 0 < differences[i, "V"][1][broad].mean()


def test_its_limit_is_the_tip_where_diffraction_rules(differences):
    # from the pointed end nothing is specular: the result is 10 dB or more too low
    assert rms(differences, (4, "H"), 0, 60) > 10
