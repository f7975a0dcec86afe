"""Rows picked and grouped."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.base.rows import groups, spread_over


@pytest.mark.parametrize("n, most", [(0, 5), (1, 5), (5, 5), (6, 5), (1000, 64), (3, 1)])
def test_numbers_spread_over_a_range_have_no_gap_wider_than_the_mean_rounded_up(n, most):
    found = spread_over(n, most)
    assert len(found) == min(n, most) and set(found) <= set(range(n))
    if most > 1 and n:
        assert found[0] == 0 and found[-1] == n - 1
        assert n == 1 or np.diff(found).max() <= np.ceil((n - 1) / (len(found) - 1))


def test_rows_of_a_group_agree_in_every_key_and_groups_are_in_the_order_of_the_keys():
    random = np.random.default_rng(1)
    keys = random.integers(0, 3, 200), None, random.choice(["HH", "VV"], 200), random.integers(-2, 2, 200) / 3
    found = groups(200, *keys)
    rows = list(zip(*(k.tolist() for k in keys if k is not None), strict=True))
    order = sorted(set(rows))
    assert found.tolist() == [order.index(row) for row in rows]
    assert groups(4, None, None).tolist() == [0, 0, 0, 0]


def test_many_keys_of_many_values_do_not_overflow():
    keys = [np.random.default_rng(seed).permutation(100_000) for seed in range(5)]
    assert (groups(100_000, *keys) == keys[0]).all()
