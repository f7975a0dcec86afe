"""Wavefronts from addresses: what is known without a count, and today's gather kernel."""

from __future__ import annotations

import numpy as np
import pytest
from gpu_static.wavefronts import (
    gather,
    global_wavefronts,
    local_wavefronts,
    samples_of_pixels,
    sectors,
    shared_lines,
)

LANES = np.arange(32)


@pytest.mark.parametrize(
    "addresses, width, fronts, touched",
    [(LANES * 4, 4, 1, 4), (LANES * 8, 8, 2, 8), (LANES * 16, 16, 4, 16), (LANES * 0, 4, 1, 1),
     (LANES * 128, 4, 32, 32), (LANES * 4 + 64, 4, 2, 4), (LANES * 256, 16, 32, 32), (LANES * 8, 4, 2, 8),
     (LANES * 0 + 124, 8, 2, 2), (LANES * 0, 16, 1, 1)],
)  # fmt: skip
def test_loads_from_global_memory(addresses, width, fronts, touched):
    assert global_wavefronts(addresses, width) == fronts
    assert sectors(addresses, width) == touched


@pytest.mark.parametrize(
    "addresses, width, fronts",
    [(LANES * 4, 4, 1), (LANES * 0, 4, 1), (LANES * 8, 4, 2), (LANES * 128, 4, 32), (LANES * 8, 8, 2),
     (LANES * 16, 16, 4), (LANES * 132, 4, 1), (LANES * 12, 4, 1), (LANES * 64, 16, 16),
     (LANES // 8 * 16, 16, 1), (LANES * 0, 16, 1)],
)  # fmt: skip
def test_loads_from_local_memory(addresses, width, fronts):
    assert local_wavefronts(addresses, width) == fronts


def test_many_loads_are_counted_one_by_one():
    both = np.stack([LANES * 4, LANES * 128])
    assert global_wavefronts(both).tolist() == [1, 32] and local_wavefronts(both).tolist() == [1, 32]


def test_pixels_that_read_one_sample_share_it_and_others_do_not():
    together, apart = np.zeros((1, 32, 32), np.int64), np.arange(1024).reshape(1, 32, 32) * 1000
    assert gather(together, taps=4) == (8.0, 8.0)
    assert gather(apart, taps=4)[1] == 8 * 32
    assert gather(together, taps=4, width=8) == (4.0, 4.0)


def test_samples_of_pixels_follow_their_spacing_in_slant_range():
    samples = samples_of_pixels(24.0)
    assert samples.shape == (40, 32, 32)
    step = np.diff(samples, axis=2).mean()
    assert step == pytest.approx(-24.0 * 0.25 * np.sin(np.radians(36.9)), rel=0.02)


def test_work_items_that_share_lines_read_samples_without_conflicts():
    """Per line of an item: 16 samples of 8 bytes, two pairs of weights, and where the line begins."""
    assert shared_lines(64, 256, fine=4, line_taps=4, slope_taps=0) == (16 * 2 + 2 + 1) / 4


@pytest.mark.parametrize("nodes", [1, 5, 500])
def test_a_node_of_a_tree_takes_a_quarter_of_the_wavefronts_as_loads_of_sixteen_bytes(nodes):
    """Nodes of kernels/ray_casting.cl have 48 numbers; the rays of 20 warps look at any of them."""
    at = 192 * np.random.default_rng(0).integers(0, nodes, (20, 32))
    single, four = (global_wavefronts(at + np.arange(0, 192, width)[:, None, None], width).sum() for width in (4, 16))
    assert single == 4 * four
