"""Closed forms of linear and planar arrays: array factors, their validity, and the waveform of diverse carriers.

Elements stand at +n dy y + p dz z from the reference, n < N, p < P, and transmit f0 + n dfy + p dfz, as in
`AntennaArray.planar`. Farooq (2009) has them at -n dy and -p dz: reverse the sign of `spacing` for his layout, which
reverses every angle. Directions are cosines (ky, kz) along y and z; azimuth and elevation have
ky = cos(elevation) sin(azimuth), kz = sin(elevation). Retarded time t' = t - R/c, R from the reference element.

    constant   sum exp(j k0 (n dy ky + p dz kz))                               his (3.23), for elements at -n d
    diverse    sum exp(j (n Theta + p Psi))                                    his (3.46)
               Theta = 2 pi dfy t' + k0 dy ky,  Psi = 2 pi dfz t' + k0 dz kz   his (3.44), (3.45) with - k0 d k

Multiplied by exp(j 2 pi f0 t') the factor is the far field, except for the phase in n^2 and n p, which (3.40) bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
from numpy.typing import ArrayLike

from ..base import validation
from ..base.constants import SPEED_OF_LIGHT

Cosines = Sequence[ArrayLike] | np.ndarray  # (ky, kz), each (...)

LONGEST = 1e12  # s, of retarded times

# 2 pi in parts of 33 bits, of which up to 2^20 multiples are exact, and the rest
_TWO_PI = (6.2831853069365025, 2.4308402025215864e-10, 8.089064995183803e-21)


def reduced(x: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """x, rad, reduced to [-pi, pi], and the number of whole cycles that are removed; |x| up to 6e6."""
    x = validation.values("angle", x)
    validation.finite("angle", x)
    cycles = np.rint(x / (2 * np.pi))
    if cycles.size and np.abs(cycles).max() >= 2**20:
        raise ValueError(f"an angle of {np.abs(x).max():g} rad is too large to be reduced; keep below 6e6")
    return ((x - cycles * _TWO_PI[0]) - cycles * _TWO_PI[1]) - cycles * _TWO_PI[2], cycles


def dirichlet(x: ArrayLike, n: int) -> np.ndarray:
    """sin(n x/2)/sin(x/2), n where x is 0; x rad (...), |x| <= 6e6. The error is below 1e-12 n.

    >>> sarcl.array_factor.dirichlet([0.0, 2 * np.pi], 5)
    array([5., 5.])
    """
    n = validation.count("n", n)
    rest, cycles = reduced(x)
    flat = np.abs(rest) < 1e-300  # half of a smaller number may underflow to 0
    half = np.where(flat, 1.0, rest / 2)
    ratio = np.where(flat, float(n), np.sin(n * half) / np.sin(half))
    return np.asarray(np.where((cycles % 2 != 0) & (n % 2 == 0), -ratio, ratio))


def geometric(x: ArrayLike, n: int) -> np.ndarray:
    """sum over 0 <= i < n of exp(j i x) = exp(j (n - 1) x/2) dirichlet(x, n)."""
    n = validation.count("n", n)
    rest, _ = reduced(x)
    return np.asarray(np.exp(0.5j * (n - 1) * rest) * dirichlet(rest, n))


def constant_factor(
    f0: float, *, shape: Sequence[int] | np.ndarray, spacing: ArrayLike, cosines: Cosines
) -> np.ndarray:
    """Array factor of shape (N, P) elements on one carrier, (3.23). cosines (ky, kz), each (...).

    >>> factor = sarcl.array_factor.constant_factor(10e9, shape=(8, 1), spacing=(0.015, 0), cosines=(0.0, 0.0))
    >>> float(abs(factor))
    8.0
    """
    return diverse_factor(f0, shape=shape, spacing=spacing, frequency_step=(0, 0), cosines=cosines, retarded=0.0)


def diverse_factor(
    f0: float,
    *,
    shape: Sequence[int] | np.ndarray,
    spacing: ArrayLike,
    frequency_step: ArrayLike,
    cosines: Cosines,
    retarded: ArrayLike,
) -> np.ndarray:
    """Array factor of N by P elements, (3.46), in closed form: valid where `quadratic_phase` is small.

    shape (N, P), spacing (dy, dz) m, frequency_step (dfy, dfz) Hz, cosines (ky, kz) and retarded s: (...), broadcast.

    >>> steps, times = (20e6, 0), [0, 1 / 160e6]  # Hz, s
    >>> factor = sarcl.array_factor.diverse_factor(
    ...     10e9, shape=(8, 1), spacing=(0.015, 0), frequency_step=steps, cosines=(0.0, 0.0), retarded=times
    ... )
    >>> abs(factor).round(6)
    array([8., 0.])
    """
    f0 = validation.carrier("f0", f0)
    d = validation.array("spacing", spacing, np.float64, (2,))
    df = validation.array("frequency_step", frequency_step, np.float64, (2,))
    if not isinstance(cosines, (list, tuple, np.ndarray)) or len(cosines) != 2:
        raise ValueError(f"cosines is {cosines!r:.60}; give (ky, kz)")
    ky, kz = (validation.values("cosines", k) for k in cosines)
    t = _seconds(retarded)
    lengths = zip_longest(*(each.shape[::-1] for each in (ky, kz, t)), fillvalue=1)
    if any(len(set(along) - {1}) > 1 for along in lengths):
        raise ValueError(f"cosines have shapes {ky.shape} and {kz.shape} and retarded has {t.shape}; give equal ones")
    out = np.ones(np.broadcast_shapes(ky.shape, kz.shape, t.shape), np.complex128)
    _pair("shape", shape)
    for i, cosine in enumerate((ky, kz)):
        cycles = df[i] * t
        x = 2 * np.pi * ((cycles - np.rint(cycles)) + f0 * d[i] * cosine / SPEED_OF_LIGHT)
        out = out * geometric(x, validation.count(f"shape[{i}]", shape[i]))
    return out


def _pair(name: str, value: object) -> None:
    """ValueError unless the value has two entries."""
    if not isinstance(value, (list, tuple, np.ndarray)) or len(value) != 2:
        raise ValueError(f"{name} is {value!r:.60}; give two, along y and z")


def power_pattern(factor: ArrayLike, peak: float | None = None) -> np.ndarray:
    """|factor|^2 over `peak`^2; peak: the number of elements, or None: the largest |factor| given.

    >>> sarcl.array_factor.power_pattern([8, 4, 0])
    array([1.  , 0.25, 0.  ])
    """
    level = np.abs(validation.values("factor", factor, np.complex128))
    validation.finite("factor", level)
    largest = float(level.max(initial=0)) if peak is None else validation.number("peak", peak, above=0)
    if largest == 0:
        raise ValueError("factor is 0 everywhere, so that it has no peak; give peak=, the number of elements")
    with np.errstate(over="ignore"):
        return np.asarray((level / largest) ** 2)


def _finite(name: str, value: ArrayLike) -> np.ndarray:
    """Numbers (...); ValueError for what are none, NaN and Inf."""
    out = validation.values(name, value)
    validation.finite(name, out)
    return out


def _seconds(retarded: ArrayLike) -> np.ndarray:
    """Retarded times, s (...); ValueError for those whose products with frequencies overflow."""
    out = _finite("retarded", retarded)
    if out.size and np.abs(out).max() > LONGEST:
        raise ValueError(f"retarded reaches {np.abs(out).max():g} s, wanted at most {LONGEST:g} s; give seconds")
    return out


def quadratic_phase(
    *, shape: Sequence[int] | np.ndarray, spacing: ArrayLike, frequency_step: ArrayLike, cosines: ArrayLike = (1.0, 1.0)
) -> float:
    """Largest phase that the closed form neglects, rad: the sum of moduli of the terms of (3.39).

    shape (N, P), spacing (dy, dz) m, frequency_step (dfy, dfz) Hz, cosines (ky, kz)

    Farooq accepts up to pi/4. Cosines of 1 give (3.40); (1, 0) is the plane of azimuth alone, (3.59). Moduli are summed
    because steps of opposite signs cancel at the corner (N, P), which the paper considers, but not elsewhere.

    >>> phase = sarcl.array_factor.quadratic_phase(shape=(45, 1), spacing=(0.015, 0), frequency_step=(1e6, 0))
    >>> phase < np.pi / 4
    True
    """
    _pair("shape", shape)
    n, p = (validation.count(f"shape[{i}]", shape[i]) for i in range(2))
    dy, dz = np.abs(
        validation.array("spacing", spacing, np.float64, (2,)) * validation.array("cosines", cosines, np.float64, (2,))
    )
    steps = validation.array("frequency_step", frequency_step, np.float64, (2,))
    ky, kz = 2 * np.pi * np.abs(steps) / SPEED_OF_LIGHT
    return float(n * n * ky * dy + n * p * ky * dz + p * p * kz * dz + n * p * kz * dy)


def beam_angles(
    f0: float, *, spacing: ArrayLike, frequency_step: ArrayLike, retarded: ArrayLike, lobe: tuple[int, int] = (0, 0)
) -> tuple[np.ndarray, np.ndarray]:
    """(azimuth, elevation) rad of the beam at retarded time t', (3.53) and (3.54) for elements at +n d; NaN where none.

    spacing, frequency_step  (d, df) from element to element along y, z, m, Hz

    sin(elevation) = (c/(f0 dz)) (v - dfz t');  sin(azimuth) cos(elevation) = (c/(f0 dy)) (u - dfy t');  lobe (u, v).
    Along y alone: sin(azimuth) = -(c/(f0 d)) df t'. Farooq's layout, -n d, has the opposite signs.

    >>> azimuth, elevation = sarcl.array_factor.beam_angles(
    ...     10e9, spacing=(0.015, 0.015), frequency_step=(20e6, 0), retarded=5e-9
    ... )
    >>> round(float(azimuth), 3), float(elevation)
    (-0.201, 0.0)
    """
    f0 = validation.number("f0", f0, above=0)
    wave = SPEED_OF_LIGHT / f0
    d = validation.array("spacing", spacing, np.float64, (2,))
    df = validation.array("frequency_step", frequency_step, np.float64, (2,))
    if not d.all():
        raise ValueError(f"spacing is {d.tolist()}; elements at one position form no beam")
    t = validation.values("retarded", retarded)
    _pair("lobe", lobe)
    orders = [validation.number(f"lobe[{i}]", lobe[i]) for i in range(2)]
    for i, order in enumerate(orders):
        validation.count(f"lobe[{i}]", abs(order), 0)
    with np.errstate(invalid="ignore", over="ignore"):  # no beam: NaN
        ky, kz = (wave / d[i] * (orders[i] - df[i] * t) for i in range(2))
        elevation = np.arcsin(np.where(np.abs(kz) <= 1, kz, np.nan))
        azimuth = np.arcsin(np.where(ky**2 + kz**2 <= 1, ky / np.cos(elevation), np.nan))
    return azimuth, elevation


def period(frequency_step: float) -> float:
    """1/|df|, s, df the frequency_step: a pulse of this length holds one peak, (4.15).

    >>> 1e9 * sarcl.array_factor.period(20e6)  # ns
    50.0
    """
    return 1 / abs(_step(frequency_step))


def main_lobe(n: int, frequency_step: float) -> float:
    """2/(n |df|), s between the nulls beside the peak, df the frequency_step, (4.14).

    >>> 1e9 * sarcl.array_factor.main_lobe(50, 20e6)  # ns
    2.0
    """
    return 2 / (validation.count("n", n) * abs(_step(frequency_step)))


def bandwidth(n: int, frequency_step: float) -> float:
    """n |df|, Hz, of n pulses of length 1/|df|, df the frequency_step, (4.18).

    >>> sarcl.array_factor.bandwidth(45, 20e6)
    900000000.0
    """
    return validation.count("n", n) * abs(_step(frequency_step))


def time_bandwidth(n: int, frequency_step: float) -> float:
    """bandwidth times period: n, for every frequency_step, (4.19).

    >>> sarcl.array_factor.time_bandwidth(45, 20e6)
    45.0
    """
    return bandwidth(n, frequency_step) * period(frequency_step)


def center_frequency(f0: float, n: int, frequency_step: float) -> float:
    """f0 + (n - 1) df/2, Hz, df the frequency_step, (4.6).

    >>> sarcl.array_factor.center_frequency(10e9, 45, 20e6)
    10440000000.0
    """
    return validation.number("f0", f0) + (validation.count("n", n) - 1) / 2 * validation.number(
        "frequency_step", frequency_step
    )


def peak_delay(
    f0: float, *, spacing: float, frequency_step: float, azimuth: ArrayLike, elevation: ArrayLike = 0.0, n: int = 1
) -> np.ndarray:
    """Delay of the peak, s after R/c: -d cos(elevation) sin(azimuth) f/(c df) for elements at +n d, df frequency_step.

    n = 1: f = f0, the peak of the closed form, (4.27), which has the other sign for its elements at -n d.
    n elements: f = f0 + (n - 1) df, the peak of the exact field: the part i (n - 1) of its phase i^2 dk d k is linear.

    >>> delay = sarcl.array_factor.peak_delay(10e9, spacing=0.015, frequency_step=20e6, azimuth=0.1)
    >>> round(1e9 * float(delay), 2)  # ns
    -2.5
    """
    f = validation.number("f0", f0, above=0) + (validation.count("n", n) - 1) * _step(frequency_step)
    d, step = validation.number("spacing", spacing), _step(frequency_step)
    up, aside = _finite("elevation", elevation), _finite("azimuth", azimuth)
    return np.asarray(-d * np.cos(up) * np.sin(aside) * f / (SPEED_OF_LIGHT * step))


def waveform(
    f0: float,
    n: int,
    *,
    spacing: float,
    frequency_step: float,
    azimuth: ArrayLike,
    retarded: ArrayLike,
    pulsed: bool = False,
) -> np.ndarray:
    """exp(j 2 pi f0 t') times the factor of n elements in a row, (4.9); pulsed: 0 where |t'| > period/2, (4.16).

    retarded  t', s (...);  spacing, frequency_step  from element to element, m, Hz

    >>> times = [0.0, 3e-9]  # s
    >>> pulse = sarcl.array_factor.waveform(10e9, 8, spacing=0.015, frequency_step=20e6, azimuth=0.0, retarded=times)
    >>> abs(pulse).round(3)
    array([8.   , 5.326])
    """
    t = _seconds(retarded)
    aside = np.sin(_finite("azimuth", azimuth))
    steps = (validation.number("frequency_step", frequency_step), 0.0)
    factor = diverse_factor(
        f0, shape=(n, 1), spacing=(spacing, 0.0), frequency_step=steps, cosines=(aside, 0.0), retarded=t
    )
    cycles = f0 * t
    out = np.exp(2j * np.pi * (cycles - np.rint(cycles))) * factor
    pulsed = validation.flag("pulsed", pulsed)
    return np.asarray(out * (np.abs(t) <= period(frequency_step) / 2) if pulsed else out)


def _step(frequency_step: float) -> float:
    step = validation.number("frequency_step", frequency_step)
    if step == 0:
        raise ValueError("frequency_step is 0: equal carriers have no period, lobe or delay")
    return step
