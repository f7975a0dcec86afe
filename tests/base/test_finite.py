"""`finite` reads large arrays once, by sums, and names the first NaN or Inf as it does in small ones."""

from __future__ import annotations

import numpy as np
import pytest

from sarcl.base import validation

SHAPE = 3, 2**18 + 5  # rows that end within a sum


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.complex64, np.complex128])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("place", [(0, 0), (1, 7), (2, -1)])
def test_a_value_that_is_not_finite_is_named_wherever_it_stands(kind, bad, place):
    values = np.ones(SHAPE, kind)
    validation.finite("samples", values)
    values[place] = bad
    row, column = place[0] + 10, place[1] % SHAPE[1]
    with pytest.raises(ValueError, match=rf"samples\[{row}, {column}\] is .*every value must be finite"):
        validation.finite("samples", values, first_row=10)


def test_an_imaginary_part_and_both_infinities_are_seen():
    values = np.ones(SHAPE, np.complex64)
    values.imag[1, 3] = np.nan
    with pytest.raises(ValueError, match=r"samples\[1, 3\] is"):
        validation.finite("samples", values)
    values.imag[1, 3:5] = np.inf, -np.inf
    with pytest.raises(ValueError, match=r"samples\[1, 3\] is"):
        validation.finite("samples", values)


@pytest.mark.parametrize("order", ["C", "F"])
def test_finite_values_pass_whose_sums_are_infinite(order):
    largest = np.finfo(np.float32).max
    validation.finite("samples", np.full(SHAPE, largest, np.float32, order=order))
    validation.finite("samples", np.full(SHAPE, largest * (1 + 1j), np.complex64, order=order)[:, ::2])
    validation.finite("samples", np.ones(SHAPE, ">c8"))
    validation.finite("samples", np.ones(SHAPE, np.int64))
