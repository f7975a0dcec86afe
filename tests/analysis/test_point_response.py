"""Echo, focus and measure together: position and resolution of a point are those of theory, at any range."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT

CENTER, BANDWIDTH, ARC, N = 9.6e9, 600e6, np.radians(4), 512
GRAZING = np.radians(35)


def spotlight(distance):
    """A 4 deg arc seen from the side, looked down at 35 deg."""
    return sarcl.Trajectory.circle(
        radius=distance * np.cos(GRAZING), height=distance * np.sin(GRAZING), start=-ARC / 2, arc=ARC, n_pulses=N
    )


@pytest.mark.parametrize("distance", [10e3, 800e3])
@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (24.0, 32.0, 0.0)], ids=["centre", "40 m off"])
def test_a_point_has_theoretical_width_lobes_place_and_phase(distance, point):
    chirp = sarcl.Waveform.chirp(center=CENTER, bandwidth=BANDWIDTH, duration=2e-6)
    track = spotlight(distance)
    point = np.array(point)
    raw = sarcl.echo(
        sarcl.Scene.points([point]), chirp, track, reference=(0, 0, 0), range_window=(-60, 60), tolerance=1e-3
    )
    grid = sarcl.ImageGrid.plane(center=point, shape=(129, 129), spacing=(0.08, 0.1))
    image = sarcl.backproject(raw, grid, tolerance=1e-3)
    response = sarcl.measure(image, near=point)

    # theory, projected on the grid; N dtheta: each of N pulses represents one step of azimuth
    azimuth = ARC * N / (N - 1)
    irw_range = 0.886 * SPEED_OF_LIGHT / (2 * BANDWIDTH) / np.cos(GRAZING)
    irw_cross = 0.886 * SPEED_OF_LIGHT / CENTER / (2 * azimuth) / np.cos(GRAZING)
    assert response.irw == pytest.approx((irw_range, irw_cross), rel=0.01)
    assert response.pslr == pytest.approx((-13.26, -13.26), abs=0.1)
    cell = min(irw_range, irw_cross) / 0.886
    assert np.linalg.norm(response.position - point) <= 0.01 * cell
    # the oracle's value at the true place is real and positive: every sample adds in phase
    there = sarcl.backproject(raw, sarcl.ImageGrid.points([point]), tolerance=1e-3).data[0]
    assert abs(np.angle(there)) <= 5e-3
    assert abs(there) == pytest.approx(image.gain, rel=2e-3)


@pytest.mark.parametrize("distance", [10e3, 800e3])
@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (24.0, 32.0, 0.0)], ids=["centre", "40 m off"])
def test_phase_of_an_oracle_point_is_kept(distance, point):
    # echoes from the formula in extended precision, not from sarcl, to detect an error common to echo and image
    tx, n = spotlight(distance).positions, 1000
    reference = np.linalg.norm(tx, axis=1)
    frequency = CENTER - BANDWIDTH / 2 + (np.arange(n) + 0.5) * BANDWIDTH / n
    path = 2 * (np.sqrt(((tx.astype(np.longdouble) - point) ** 2).sum(axis=1)) - reference)
    turns = np.outer(path, frequency) / SPEED_OF_LIGHT % 1
    raw = sarcl.PhaseHistory(
        np.exp(-2j * np.pi * turns.astype(np.float64)).astype(np.complex64),
        frequency=frequency[0],
        frequency_step=BANDWIDTH / n,
        tx=tx,
        reference_range=reference,
    )
    there = sarcl.backproject(raw, sarcl.ImageGrid.points([point]), tolerance=1e-3)
    assert abs(np.angle(there.data[0])) <= 5e-3
    assert abs(there.data[0]) == pytest.approx(there.gain, rel=2e-3)
    echoes = sarcl.echo(
        sarcl.Scene.points([point]),
        sarcl.Waveform.chirp(center=CENTER, bandwidth=BANDWIDTH, duration=2e-6),
        spotlight(distance),
        reference=(0, 0, 0),
        range_window=(-n / 4 * SPEED_OF_LIGHT / BANDWIDTH, n / 4 * SPEED_OF_LIGHT / BANDWIDTH),
        tolerance=1e-3,
    )
    assert echoes.samples.shape == raw.samples.shape
    error = np.linalg.norm(echoes.samples - raw.samples) / np.linalg.norm(raw.samples)
    print(f"phase {np.angle(there.data[0]):.1e} rad, echo error {error:.1e}")
    assert error <= 1e-3


# The windows' transforms: width in units of c/(2B) and lambda/(2 dtheta) (0.886 without), peak side lobe
WINDOWS = {"hamming": ("hamming", 1.303, -42.67), "taylor": (("taylor", 35, 5), 1.188, -35.22)}


@pytest.mark.parametrize("name", WINDOWS)
def test_windows_widen_and_quieten_as_theory_says(name):
    window, width, pslr = WINDOWS[name]
    # a narrow band and arc: with wide ones the keystone shape of the spectrum changes lobes 40 dB below the peak
    chirp = sarcl.Waveform.chirp(center=CENTER, bandwidth=60e6, duration=2e-6)
    arc = 0.006
    track = sarcl.Trajectory.circle(radius=8e3, height=6e3, start=-arc / 2, arc=arc, n_pulses=200)
    raw = sarcl.echo(sarcl.Scene.points([[0, 0, 0]]), chirp, track, range_window=(-80, 80), tolerance=1e-4)
    grid = sarcl.ImageGrid.plane(shape=(129, 129), spacing=(0.8, 1.0))
    shaped = sarcl.measure(sarcl.backproject(raw, grid, tolerance=1e-4, window=window))
    cells = SPEED_OF_LIGHT / 2 / 60e6 / 0.8, SPEED_OF_LIGHT / CENTER / 2 / (arc * 200 / 199) / 0.8
    assert np.divide(shaped.irw, cells) == pytest.approx((width, width), rel=0.01)
    assert shaped.pslr == pytest.approx((pslr, pslr), abs=0.3)
