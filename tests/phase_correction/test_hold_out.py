"""What cross-validation compares: near and far places that both have targets; phases of few cosines."""

from __future__ import annotations

import numpy as np
import pytest

import sarcl
from sarcl.base.constants import SPEED_OF_LIGHT
from sarcl.phase_correction import _phase_smoothing, _search
from sarcl.phase_correction._echo_parts import near_and_far
from sarcl.phase_correction.autofocus import _aperture_view

N, CARRIER, BANDWIDTH, SAMPLES = 64, 24e9, 0.75e9, 32  # pulses, Hz, Hz, samples
CELL = SPEED_OF_LIGHT / 2 / BANDWIDTH
GRID = sarcl.ImageGrid.plane(center=(4.0, 0, 0), shape=(20, 20), spacing=0.1)
SIDE_LOBE = 10 ** (-45 / 20)  # of a Hamming window, of the amplitude of its target


def sets(cells, amplitudes):
    """Near and far ones of places at these ranges, range cells behind 4 m, as lists of their numbers."""
    tx = np.stack([np.zeros(N), np.linspace(-0.2, 0.2, N), np.zeros(N)], axis=1)
    raw = sarcl.PhaseHistory(
        np.ones((N, SAMPLES), np.complex64), frequency=CARRIER, frequency_step=BANDWIDTH / SAMPLES, tx=tx,
        reference_range=4.0,
    )  # fmt: skip
    view = _aperture_view(raw, np.arange(N)[:, None], GRID)
    places = np.stack([4.0 + CELL * np.array(cells), np.zeros(len(cells)), np.zeros(len(cells))], axis=1)
    values = np.tile(np.array(amplitudes, np.complex64), (N, 1))
    near, far = near_and_far(view, places, [values, values], np.zeros(N))
    return np.flatnonzero(near).tolist(), np.flatnonzero(far).tolist()


def test_places_are_divided_where_their_sharpness_is_halved():
    assert sets([0, 1, 5, 6, 9], [1, 1, 1, 1, 0.1]) == ([0, 1], [2, 3, 4])


def test_a_set_of_side_lobes_alone_gives_way_to_one_with_a_target():
    # halves of the sharpness: 0 and 1 against the rest, of which 2 lies between the sets
    assert sets([0, 1.5, 2.8, 6, 8], [0.8, 1, 1, SIDE_LOBE, SIDE_LOBE]) == ([0], [2, 3, 4])


@pytest.mark.parametrize("cells", [(0.0, 0.5), (0.0, 1.9)])
def test_targets_too_close_in_range_are_not_divided(cells):
    assert sets([*cells, 5, 7], [1, 1, SIDE_LOBE, SIDE_LOBE]) == ([], [])


def test_a_large_smooth_phase_is_found_from_that_of_single_pulses():
    random, n, modes = np.random.default_rng(1), 128, 8
    phase = _phase_smoothing.cosines(n, modes)[:, 2:] @ random.normal(size=modes - 2)
    phase *= 15 / np.abs(phase).max()
    # in every column two points side by side, which phases of single pulses may focus to one
    pulses = np.arange(n)[:, None]
    points = 1 + np.exp(2j * np.pi * (3 * pulses / n + random.random(20)))
    v = (points * np.exp(2j * np.pi * random.random(20) + 1j * phase[:, None])).astype(np.complex64)
    free = np.angle(np.exp(1j * (phase + random.normal(scale=0.4, size=n))))
    found = _search.curves(v, free, 64.0)[_search.MODES.index(modes)]
    left = _phase_smoothing.detrended(found - phase)
    assert left.std() < 0.1
    lost = _search.curves(v, np.zeros(n), 64.0)[_search.MODES.index(modes)]
    assert _phase_smoothing.detrended(lost - phase).std() > 1
