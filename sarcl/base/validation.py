"""Checks of user input: every message names the argument, the value given, the value wanted and the remedy."""

from __future__ import annotations

from typing import Any, SupportsComplex, SupportsFloat, SupportsIndex

import numpy as np
from numpy.typing import DTypeLike

from .host_memory import installed
from .text import shown, size_text

NUMBERS = SupportsComplex | SupportsFloat | SupportsIndex  # None is none of these; classes of numbers look like them
SUMMED = 2**18  # floats: a cache holds them, and a call of NumPy takes little beside their sum
LARGEST_TOLERANCE = 0.3  # relative error; noise of a tenth of the signal's power
LOWEST_CARRIER, HIGHEST_CARRIER = 1e5, 1e13  # Hz: from long waves to far infrared
LEAST_TOLERANCE = 1e-11  # relative error; a range of 1 km at 10 GHz, rounded to float64, has a phase error of 2e-11 rad


def array(name: str, value: object, dtype: DTypeLike, shape: tuple[int | str, ...]) -> np.ndarray:
    """Return `value` as a finite array of `dtype` with `shape`; a str in `shape` is a free axis, named.

    The result is a read-only copy in C order: the caller's array stays as it is. ValueError names the
    argument, its shape or the index of its first NaN or Inf.
    """
    out = converted(name, value, dtype)
    shape_text = "(" + ", ".join(str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    if out.ndim != len(shape) or any(isinstance(n, int) and n != m for n, m in zip(shape, out.shape, strict=False)):
        raise ValueError(f"{name} has shape {out.shape}, wanted {shape_text}")
    if out.size == 0:
        raise ValueError(f"{name} is empty (shape {out.shape}), wanted {shape_text} with at least one element")
    finite(name, out)
    return sealed(out)


def each(name: str, value: object, n: int) -> np.ndarray:
    """`value` as finite numbers (n,), of one number for all or one for each."""
    if ndim(name, value) == 0:
        value = np.full(n, number(name, value))
    return array(name, value, np.float64, (n,))


def ndim(name: str, value: Any) -> int:
    """Number of axes of a value; ValueError where it is a list of lists of different lengths."""
    try:
        return int(np.ndim(value))
    except ValueError:
        raise ValueError(f"{name} is {shown(value)}, whose rows differ in length; give rows of equal length") from None


def flag(name: str, value: object) -> bool:
    """`value` as True or False; TypeError for anything but these, 1 and 0."""
    if not isinstance(value, (bool, np.bool_, int, np.integer)) or value not in (0, 1):
        raise TypeError(f"{name} is {shown(value)}; give True or False")
    return bool(value)


def flags(name: str, value: object) -> Any:
    """`value`, one or several of True, False, 1 and 0; TypeError for anything else, which NumPy may take for True."""
    states = np.asarray(value) if ndim(name, value) else None
    if states is None:
        return flag(name, value)
    if states.dtype.kind not in "biuf" or not ((states == 0) | (states == 1)).all():
        raise TypeError(f"{name} is {shown(value)}; give True or False for each")
    return value


def without_unit(name: str, value: object) -> None:
    """ValueError for numbers that carry a unit (astropy, unyt, pint): NumPy would take 1 km for 1."""
    kind = type(value)
    if kind in (float, int, np.ndarray, list, tuple):
        return
    if (isinstance(value, np.ndarray) and not isinstance(value, np.ma.MaskedArray)) or hasattr(kind, "magnitude"):
        unit = str(getattr(value, "unit", getattr(value, "units", None)) or "")
        if unit and unit != "dimensionless":
            raise ValueError(
                f"{name} carries the unit {unit:.20}; give plain numbers, in the units of the documentation"
            )


def values(name: str, value: object, dtype: DTypeLike = np.float64) -> np.ndarray:
    """`value` of any shape as an array of `dtype`, NaN and Inf left in it; ValueError for what are no numbers."""
    return np.asarray(value) if type(value) is float else converted(name, value, dtype)


def vectors(name: str, value: object) -> np.ndarray:
    """`value` as vectors (..., 3), float64, NaN and Inf left in them; ValueError for another shape."""
    out = values(name, value)
    if out.shape[-1:] != (3,):
        raise ValueError(f"{name} has shape {out.shape}, wanted (..., 3)")
    return out


def room(what: str, n_bytes: float, remedy: str) -> None:
    """MemoryError where more bytes are needed than the machine has; remedy  what to give instead."""
    if n_bytes > installed():
        raise MemoryError(f"{what} needs {size_text(n_bytes)}, this machine has {size_text(installed())}; {remedy}")


def sealed(values: np.ndarray) -> np.ndarray:
    """`values`, read-only from here on: for arrays that only the caller holds, so that PhaseHistory copies none."""
    values.flags.writeable = False
    return values


class _NoNumbers(TypeError):
    """Why a value is refused, in words of sarcl."""


def converted(name: str, value: object, dtype: DTypeLike) -> np.ndarray:
    """A copy of `value` as an array of `dtype` in C order; ValueError where that would change its numbers."""
    number_type = np.dtype(dtype)
    ndim(name, value)
    without_unit(name, value)
    try:
        source = np.asarray(value)
        if source.dtype.kind not in "biufcO":
            raise _NoNumbers(f"type {source.dtype}")
        if source.dtype.kind == "O":
            none = [v for v in source.flat if isinstance(v, type) or not isinstance(v, NUMBERS)]
            if none:
                raise _NoNumbers(f"{'None' if none[0] is None else 'a ' + type(none[0]).__name__} is no number")
        if source.dtype.kind == "c" and number_type.kind != "c":
            raise _NoNumbers(f"type {source.dtype}: take the real part or the modulus")
        if np.ma.is_masked(value):
            raise _NoNumbers(f"{np.ma.count_masked(value)} values are masked: fill or remove them")
        if number_type.kind in "iu" and source.dtype.kind == "f" and not (source == np.rint(source)).all():
            raise _NoNumbers("not all are whole numbers")
        with np.errstate(all="ignore"):
            numbers = np.array(source, dtype=number_type, order="C")
        if number_type.kind in "iu" and not (numbers == source).all():  # the largest numbers come back as negative ones
            raise _NoNumbers("not all are small enough")
        return numbers
    except (TypeError, ValueError, OverflowError) as exc:
        why = "not all are small enough" if isinstance(exc, OverflowError) else "not all are numbers"
        why = str(exc) if isinstance(exc, _NoNumbers) else why
        raise ValueError(f"{name} must be numbers that fit {number_type}, got {shown(value, 80)} ({why})") from None


def unmasked(name: str, value: object, first_row: int = 0) -> Any:
    """`value` without an empty mask; ValueError where values of a masked array are masked: they are no numbers.

    first_row  rows are counted from it
    """
    if not isinstance(value, np.ma.MaskedArray):
        return value
    mask = np.ma.getmaskarray(value)
    if mask.any():
        place = first(mask, first_row)[1] or "[]"
        raise ValueError(
            f"{name} has {int(mask.sum())} masked values, the first at {place}, which are no measurements; fill "
            f"them, with 0 where nothing came: {name}.filled(0)"
        )
    return value.data


def finite(name: str, value: np.ndarray, first_row: int = 0) -> None:
    """Raise ValueError naming the first NaN or Inf in `value`; rows are counted from `first_row`."""
    if _has_finite_sums(value):
        return
    is_finite = np.isfinite(value)
    if not is_finite.all():
        index, place = first(~is_finite, first_row)
        raise ValueError(f"{name}{place} is {value[index]}; every value must be finite: remove or replace it")


def _has_finite_sums(value: np.ndarray) -> bool:
    """Whether all sums of SUMMED consecutive floats are finite: then each of them is, as a NaN or Inf stays in a sum.

    It reads them once and makes no array of their size. False for arrays that are small, not of floats, or not
    consecutive in memory, and where a sum overflows.
    """
    if value.size < SUMMED or value.dtype.kind not in "fc" or not value.flags.c_contiguous or not value.dtype.isnative:
        return False
    parts = value.reshape(-1).view(value.real.dtype)
    with np.errstate(over="ignore", invalid="ignore"):
        return all(bool(np.isfinite(parts[at : at + SUMMED].sum())) for at in range(0, parts.size, SUMMED))


def first(mask: np.ndarray, first_row: int = 0) -> tuple[tuple[int, ...], str]:
    """Index of the first True of a mask, and its text, such as "[2, 0]", with rows counted from `first_row`."""
    index = tuple(int(i) for i in np.unravel_index(int(np.argmax(mask)), mask.shape))
    places = (index[0] + first_row, *index[1:]) if index else ()
    return index, f"[{', '.join(map(str, places))}]" if index else ""


def number(name: str, value: Any, *, above: float | None = None, least: float | None = None) -> float:
    """Return `value` as a finite float, greater than `above` and not less than `least`."""
    try:
        # of complex numbers NumPy would drop the imaginary part, and of masked ones use what is behind the mask
        if isinstance(value, (str, bytes, bool, np.bool_)) or np.iscomplexobj(value) or np.ma.is_masked(value):
            raise TypeError
        without_unit(name, value)
        out = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {value!r:.80}") from None
    if not np.isfinite(out):
        raise ValueError(f"{name} is {out}; it must be finite")
    if above is not None and not out > above:
        raise ValueError(f"{name} is {out:g}; it must be greater than {above:g}")
    if least is not None and not out >= least:
        raise ValueError(f"{name} is {out:g}; it must be at least {least:g}")
    return out


def carrier(name: str, value: Any) -> float:
    """`value` as a carrier frequency, Hz: LOWEST_CARRIER to HIGHEST_CARRIER."""
    out = number(name, value, above=0)
    carriers(name, np.array(out))
    return out


def carriers(name: str, value: np.ndarray) -> None:
    """ValueError for frequencies that no radar has; the message names the unit that they are likely in."""
    outside = (value < LOWEST_CARRIER) | (value > HIGHEST_CARRIER)
    if not outside.any():
        return
    f = float(value[outside].flat[0])
    units = [(unit, f * scale) for unit, scale in (("GHz", 1e9), ("MHz", 1e6)) if 0 < f < 1e12 / scale]
    remedy = f"is it in {units[0][0]}? Give {units[0][1]:g}" if units else "was a unit counted twice?"
    limits = f"{LOWEST_CARRIER:.0e} and {HIGHEST_CARRIER:.0e}".replace("+0", "").replace("+", "")
    raise ValueError(f"{name} is {f:g} Hz; carriers lie between {limits} Hz: {remedy}")


def tolerance(value: object) -> float:
    """`value` as a relative error that an image or echoes may have: LEAST_TOLERANCE to LARGEST_TOLERANCE."""
    out = number("tolerance", value, above=0)
    if out > LARGEST_TOLERANCE:
        raise ValueError(
            f"tolerance is {out:g}; an error above {LARGEST_TOLERANCE:g} of the norm leaves no image: give less, such "
            "as 1e-1"
        )
    if out < LEAST_TOLERANCE:
        raise ValueError(
            f"tolerance is {out:g}; positions, frequencies and ranges in float64 do not carry an error below "
            f"{LEAST_TOLERANCE:g}: give more, such as 1e-6"
        )
    return out


def count(name: str, value: Any, least: int | None = 1) -> int:
    """Return `value` as an int of at least `least`, None for any; a float with a fraction is refused."""
    try:
        if np.iscomplexobj(value) or np.ma.is_masked(value):
            raise TypeError
        out = int(value)
        is_whole = out == value
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a whole number, got {value!r:.80}") from None
    if not is_whole or isinstance(value, (bool, np.bool_)):
        raise ValueError(f"{name} must be a whole number, got {value!r:.80}")
    if least is not None and out < least:
        raise ValueError(f"{name} is {out}; it must be at least {least}")
    return out


def direction(name: str, value: object) -> np.ndarray:
    """Return the unit vector along `value` (3,); a zero vector raises."""
    v = array(name, value, np.float64, (3,))
    if not v.any():
        raise ValueError(f"{name} is (0, 0, 0); a direction needs a length")
    v = v / np.abs(v).max()  # first, so that squares neither overflow nor vanish
    return np.asarray(v / np.linalg.norm(v))


def instance(name: str, value: object, kind: type) -> None:
    """Raise TypeError unless `value` is a `kind`."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} is a {type(value).__name__}; wanted a sarcl.{kind.__name__}")


def choice(name: str, value: object, allowed: tuple[str, ...]) -> str:
    """Return `value` if it is one of `allowed`."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} is {shown(value)}; choose one of {', '.join(map(repr, allowed))}")
    return str(value)


def pair(name: str, value: Any) -> tuple[Any, Any]:
    """A (row, column) pair, from a pair or one number for both."""
    if ndim(name, value) == 0:
        return value, value
    if np.shape(value) != (2,):
        raise ValueError(f"{name} is {value!r}; wanted (row, column) or one number for both")
    return value[0], value[1]
