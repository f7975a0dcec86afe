"""Radar cross sections of calibration targets, m^2, in closed form: geometrical optics of large, perfect conductors.

Beams that are reflected by every plate of a corner return through an aperture of area A, m^2, across the direction:

    sigma = 4 pi A^2/lambda^2

    direction   towards the radar, in the axes of the target before it is rotated (..., 3); of any length
    frequency   Hz (...)
Each returns m^2, of the shape that the directions and `frequency` broadcast to; 0 for directions from which no beam
returns. Other reflections (one plate of a trihedral seen face on, say) and edges are not in it.
ValueError for a direction of no length or of another shape, and for sizes and frequencies that are not greater than 0.
Source: Doerry, "Reflectors for SAR performance testing", second edition, SAND2014-0882R: eqs. (2) and (3) for the
triangular trihedral, whose area follows from the rays that reach all plates; the other areas follow in the same way.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation
from ..base.constants import SPEED_OF_LIGHT

FORMS = ("triangular", "square")  # of the plates of a trihedral
Form = Literal["triangular", "square"]
LEAST_TURN = 1e-7  # cycles along the fold: fewer change nothing, and would divide by 0
LEAST_COSINE = 1e-300  # of the elevation: straight from above, the product with the lit length is 0, not NaN


def trihedral_rcs(
    side: float, direction: ArrayLike, frequency: ArrayLike, *, form: Form = "triangular"
) -> NDArray[np.float64]:
    """Three reflections of `sarcl.shapes.trihedral(side, form=form)`; side, m, along the folds.

    With direction cosines l <= m <= n of the folds, the area is side^2 times

        triangular   l + m + n - 2/(l + m + n) where l + m >= n, else 4 l m/(l + m + n)
        square       l (4 - n/m) where m >= n/2, else 4 l m/n

    >>> section = sarcl.shapes.trihedral_rcs(1.0, (1, 1, 1), 9.6e9)
    >>> round(float(10 * np.log10(section)), 2)  # dBsm
    36.33
    """
    side = validation.number("side", side, above=0)
    triangular = validation.choice("form", form, FORMS) == "triangular"
    low, middle, high = np.moveaxis(np.sort(np.maximum(_directions(direction), 0), axis=-1), -1, 0)
    total = low + middle + high
    with np.errstate(divide="ignore", invalid="ignore"):
        if triangular:
            area = np.where(low + middle >= high, total - 2 / total, 4 * low * middle / total)
        else:
            area = np.where(middle >= high / 2, low * (4 - high / middle), 4 * low * middle / high)
    return _of_area(np.where(low > 0, side**2 * area, 0.0), frequency)


def dihedral_rcs(size: ArrayLike, direction: ArrayLike, frequency: ArrayLike) -> NDArray[np.float64]:
    """Two reflections of `sarcl.shapes.dihedral(size)`; size (a, b), m, across and along the fold.

        A = 2 a min(x, z) |exp(j q (2 b - w)) sinc(q w) - 1|/(2 q),   w = a |y|/max(x, z) <= b,   q = 2 pi |y|/lambda

    of direction (x, y, z), sinc(v) = sin(v)/v: 2 a b min(x, z) across the fold. A beam moves along the fold between
    its plates, by up to w, so that a strip reflects a length of b - w to b. Where w would exceed b, A falls by b/w.

    >>> section = sarcl.shapes.dihedral_rcs((1, 1), (1, 0, 1), 9.6e9)
    >>> round(float(10 * np.log10(section)), 2)  # dBsm
    44.11
    """
    sides = validation.array("size", size, np.float64, (2,))
    across, along = (validation.number(f"size[{i}]", v, above=0) for i, v in enumerate(sides))
    x, y, z = np.moveaxis(_directions(direction), -1, 0)
    drift = across * np.abs(y) / np.maximum(np.maximum(x, z), LEAST_COSINE)
    lost = np.minimum(drift, along)
    q = 2 * np.pi * np.maximum(np.abs(y) / _wavelength(frequency), LEAST_TURN / along)
    pattern = np.abs(np.exp(1j * q * (2 * along - lost)) * np.sinc(q * lost / np.pi) - 1) / (2 * q)
    strip = across * np.maximum(np.minimum(x, z), 0) * np.where(drift > along, along / np.maximum(drift, along), 1.0)
    return _of_area(2 * strip * pattern, frequency)


def top_hat_rcs(
    disc_radius: float, cylinder_radius: float, height: float, direction: ArrayLike, frequency: ArrayLike
) -> NDArray[np.float64]:
    """Two reflections, disc and wall, of `sarcl.shapes.top_hat(disc_radius, cylinder_radius, height)`; lengths, m.

        sigma = 8 pi r L^2 cos e/lambda,   L = min(height, (disc_radius - r) tan e),   r = cylinder_radius

    e is the elevation above the disc and L the part of the wall whose reflection on the disc returns. This is the
    dihedral of width sqrt(r lambda/(2 cos e)), the stationary phase of the round wall: k r cos e >> 1, not from above.

    >>> section = sarcl.shapes.top_hat_rcs(1.0, 0.3, 0.8, (1, 0, 1), 9.6e9)
    >>> round(float(10 * np.log10(section)), 2)  # dBsm
    19.22
    """
    disc, radius = (
        validation.number(name, value, above=0)
        for name, value in (("disc_radius", disc_radius), ("cylinder_radius", cylinder_radius))
    )
    height = validation.number("height", height, above=0)
    check_brim(disc, radius)
    x, y, z = np.moveaxis(_directions(direction), -1, 0)
    cosine, sine = np.hypot(x, y), np.maximum(z, 0)
    short = np.minimum(height * cosine, (disc - radius) * sine)  # L cos e
    width = np.sqrt(radius * _wavelength(frequency) / (2 * np.maximum(cosine, LEAST_COSINE)))
    return _of_area(2 * short * width, frequency)


def luneburg_rcs(radius: float, direction: ArrayLike, frequency: ArrayLike) -> NDArray[np.float64]:
    """`sarcl.shapes.luneburg(radius)`: A = pi radius^2, the lens's cross section, from every direction that its
    reflector serves: 4 pi^3 radius^4/lambda^2.

    >>> section = sarcl.shapes.luneburg_rcs(0.15, (1, 0, 0), 9.6e9)
    >>> round(float(10 * np.log10(section)), 2)  # dBsm
    18.09
    """
    area = np.pi * validation.number("radius", radius, above=0) ** 2
    return _of_area(np.broadcast_to(area, _directions(direction).shape[:-1]), frequency)


def check_brim(disc_radius: float, cylinder_radius: float) -> None:
    """ValueError unless the disc of a top hat reaches beyond the cylinder."""
    if not disc_radius > cylinder_radius:
        raise ValueError(
            f"disc_radius is {disc_radius:g} m and cylinder_radius {cylinder_radius:g} m; the disc must reach beyond "
            "the cylinder: without it no beam is reflected twice"
        )


def _directions(direction: ArrayLike) -> np.ndarray:
    """Unit vectors along `direction` (..., 3)."""
    v = validation.vectors("direction", direction)
    validation.finite("direction", v)
    largest = np.abs(v).max(axis=-1, keepdims=True)
    if not largest.all():
        index = validation.first(largest[..., 0] == 0)[1]
        raise ValueError(f"direction{index} is (0, 0, 0); give a vector from the target towards the radar")
    v = v / largest  # first, so that squares neither overflow nor vanish
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _wavelength(frequency: ArrayLike) -> np.ndarray:
    """m, of frequencies, Hz."""
    f = validation.values("frequency", frequency)
    validation.finite("frequency", f)
    if not (f > 0).all():
        raise ValueError(f"frequency reaches {f.min():g} Hz; it must be greater than 0")
    validation.carriers("frequency", f)
    return np.asarray(SPEED_OF_LIGHT / f)


def _of_area(area: np.ndarray, frequency: ArrayLike) -> NDArray[np.float64]:
    """sigma = 4 pi A^2/lambda^2, m^2, of areas, m^2."""
    return np.asarray(4 * np.pi * (area / _wavelength(frequency)) ** 2)[()]
