"""Orders along the Morton curve."""

import numpy as np
import pytest

from sarcl.base.morton import DEPTH, order_of_codes


@pytest.mark.parametrize("n", [0, 1, 2, 70_000])
@pytest.mark.parametrize("distinct", [3, 1000, 2 ** (3 * DEPTH)])
@pytest.mark.parametrize("common", [0, 7 << 40])
def test_codes_are_sorted_and_equal_ones_keep_their_order(n, distinct, common):
    codes = np.random.default_rng(n).integers(0, distinct, n, dtype=np.uint64) | np.uint64(common)
    order = order_of_codes(codes)
    assert order.dtype == np.int64
    np.testing.assert_array_equal(order, np.argsort(codes, kind="stable"))
