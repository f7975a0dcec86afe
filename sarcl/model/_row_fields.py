"""Fields of a PhaseHistory that have one entry per row: their types, and checks of what is given for them."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ..base import validation

# optional arrays with one entry per row: name -> (dtype, trailing shape)
PER_ROW: dict[str, tuple[DTypeLike, tuple[int, ...]]] = {
    "time": (np.float64, ()),
    "tx_channel": (np.int64, ()),
    "rx_channel": (np.int64, ()),
    "polarization": ("U2", ()),
    "weight": (np.float64, ()),
    "tx_velocity": (np.float64, (3,)),
    "rx_velocity": (np.float64, (3,)),
}


class RowFields(TypedDict, total=False):
    """The optional fields of a PhaseHistory that have one entry per row."""

    time: ArrayLike | None
    tx_channel: ArrayLike | None
    rx_channel: ArrayLike | None
    polarization: ArrayLike | None
    weight: ArrayLike | None
    tx_velocity: ArrayLike | None
    rx_velocity: ArrayLike | None


def check_axis(frequency: ArrayLike, frequency_step: ArrayLike, shape: tuple[int, int]) -> None:
    """Raise ValueError where `frequency` is the axis of samples of a shape, not one frequency per row.

    With as many rows as samples the shape does not show it. Rows whose first frequencies lie frequency_step apart
    are then taken for an axis: not to be asked of rows that name channels.
    """
    n_rows, n_samples = shape
    validation.ndim("frequency", frequency)
    frequency = np.asarray(frequency)
    if frequency.shape != (n_samples,) or n_samples < 2:
        return
    is_axis = n_rows != n_samples
    if not is_axis and np.ndim(frequency_step) == 0 and frequency.dtype.kind in "iuf":
        steps, step = np.diff(frequency.astype(np.float64)), float(np.asarray(frequency_step))
        is_axis = bool((np.abs(steps - step) <= 0.02 * abs(step)).all())
    if is_axis:
        raise ValueError(
            f"frequency has {n_samples} values, one per sample: it is the axis of the samples, where the frequency "
            "of sample 0 is wanted, one number or one per row; give frequency=f[0], frequency_step=f[1] - f[0]. "
            "(Rows that do start frequency_step apart: give them tx_channel=, such as numpy.arange(n_rows))"
        )


def one_per_row(
    name: str, value: object, n: int, dtype: DTypeLike, tail: tuple[int, ...] = (), spread: bool = False
) -> np.ndarray:
    """`value` with one entry per row, (n, *tail); with `spread`, a single number is taken for all rows."""
    if validation.ndim(name, value) == 0 and spread:
        validation.without_unit(name, value)
        value = np.full(n, validation.unmasked(name, value))
    rows = _words(name, value) if dtype == "U2" else validation.converted(name, value, dtype)
    if rows.ndim != 1 + len(tail) or rows.shape[1:] != tail:
        raise ValueError(f"{name} has shape {rows.shape}, wanted {(n, *tail)}")
    if len(rows) != n:
        raise ValueError(f"samples has {n} rows but {name} has {len(rows)}; give one {name} per row")
    if rows.dtype.kind in "fc":
        validation.finite(name, rows)
    return validation.sealed(rows)


def _words(name: str, value: object) -> np.ndarray:
    """Strings (n,), from strings or from bytes, as files hold them."""
    words = np.asarray(value)
    if words.dtype.kind == "S":
        words = np.char.decode(words, "ascii")
    if not all(isinstance(word, str) for word in words.ravel().tolist()):
        raise ValueError(f"{name} must be strings such as 'HH', got {value!r:.80}")
    return words.astype(str)
