"""Checksums differ where results would."""

import numpy as np
import pytest

from sarcl.base.fingerprint import checksum, leaves

SIX = np.arange(6.0)


@pytest.mark.parametrize(
    "other",
    [
        (SIX.reshape(2, 3),),
        (SIX.reshape(3, 2),),
        (SIX.astype(np.float32),),
        (SIX.view(np.int64),),
        (SIX[::-1],),
        (SIX[:3], SIX[3:]),
        (SIX, None),
        (SIX, "None"),
        (str(SIX),),
    ],
    ids=["2 x 3", "3 x 2", "float32", "int64", "reversed", "two parts", "None", "a string", "text"],
)
def test_shape_type_order_and_number_count(other):
    assert checksum(*other) != checksum(SIX)
    assert len({checksum(*o) for o in (other, other)}) == 1


def test_views_with_equal_values_are_equal():
    assert checksum(np.arange(12.0)[::2]) == checksum(np.arange(12.0)[::2].copy())
    assert checksum(np.asfortranarray(SIX.reshape(2, 3))) == checksum(SIX.reshape(2, 3))


def test_names_of_options_count_and_their_order_does_not():
    assert checksum(*leaves({"a": 1, "b": 2})) == checksum(*leaves({"b": 2, "a": 1}))
    assert checksum(*leaves({"a": 1, "b": 2})) != checksum(*leaves({"a": 2, "b": 1}))
    with pytest.raises(TypeError, match="function"):
        leaves(leaves)
