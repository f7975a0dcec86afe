"""Point response: position, resolution and side lobes of a reflector in an image.

    range        on the grid's plane, the direction in which the two-way path grows fastest: its projected gradient
    cross-range  on the plane, perpendicular to range

Cuts along both go through the interpolated peak (_image_interpolator.py). docs/guide/measure.md states
all conventions; sarcl/reference/quality.py measures an exactly computed image.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import validation
from ..model.image import Image
from ..model.maps.antennas import ends_at
from ._image_interpolator import ImageInterpolator
from ._peaks import brightest, brightest_around, peak_near, place
from ._surface import place_of

if TYPE_CHECKING:
    import PIL.Image

REACH = 10.0  # IRW on each side over which side lobes are measured
LEAST_REACH = 3.0  # IRW on each side that the image must hold
MARGIN = 18  # pixels that the interpolator may need on each side
STEPS = 32  # points of a cut per IRW
FARTHEST = 12  # steps, three pixels of the widest spacing: the peak is nearer to the brightest pixel
MOST_STEPS = 40  # along both axes, of one length
FINER = 4  # ratio of the first steps to the last ones: the response is no parabola over the first
STRAIGHT = 0.98  # cosine of the angle to a cut within which something lies "in range" or "in cross-range"
NAMES = "range", "cross-range"


@dataclass(frozen=True, eq=False)
class Cut:
    """A cut through a point response.

    name      "range" or "cross-range"
    distance  m (n,), from the peak, evenly spaced over +-reach IRW;  values  of the image there, complex128 (n,)
    """

    name: str
    distance: NDArray[np.float64]
    values: NDArray[np.complex128]

    def decibels(self) -> NDArray[np.float64]:
        """20 log10 of the modulus over that of the peak, dB (n,)."""
        level = np.abs(self.values)
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(level / level[len(level) // 2]))


@dataclass(frozen=True, eq=False)
class PointResponse:
    """The response of a point; pairs are (range, cross-range), projected on the grid.

    position  of the interpolated peak, m (3,)
    irw       width at half power (-3.01 dB), m
    pslr      highest lobe outside the first nulls over the peak, dB
    islr      energy outside the first nulls, within +-`reach` IRW, over the energy between the nulls, dB
    peak      complex value of the image at `position`, in the unit of the image's data
    gain      the image's gain at the nearest pixel: |peak/gain|^2 is the point's radar cross section, m^2
    reach     IRW on each side that pslr and islr cover: 10, or as far as the image extends
    cuts      the cuts in range and cross-range from which the figures are taken

    >>> point = sarcl.measure(image, near=(0, 0, 0))
    >>> [round(width, 2) for width in point.irw]  # m, range and cross-range
    [0.63, 0.39]
    >>> round(point.rcs, 2)  # m^2
    1.0
    >>> picture = point.show()  # a PIL.Image.Image of both cuts
    """

    position: NDArray[np.float64]
    irw: tuple[float, float]
    pslr: tuple[float, float]
    islr: tuple[float, float]
    peak: complex
    gain: float = 1.0
    reach: tuple[float, float] = (REACH, REACH)
    cuts: tuple[Cut, Cut] | None = field(default=None, repr=False)

    @property
    def rcs(self) -> float:
        """|peak/gain|^2, m^2: the radar cross section if the image is calibrated."""
        return float(abs(self.peak / self.gain) ** 2)

    def show(self, floor_db: float = -50.0, *, title: str | None = None) -> PIL.Image.Image:
        """The two cuts as a picture: decibels below the peak over metres from it. ValueError without cuts.

        floor_db  the lowest level drawn;  title  above the picture
        """
        from ..figures.decibels import curves

        if self.cuts is None:
            raise ValueError("this PointResponse has no cuts; take one from sarcl.measure")
        level = round(10 * np.log10(self.rcs), 2) + 0.0
        caption = ", ".join(
            f"{cut.name}: {irw:.4g} m, PSLR {pslr:.2f} dB, ISLR {islr:.2f} dB"
            for cut, irw, pslr, islr in zip(self.cuts, self.irw, self.pslr, self.islr, strict=True)
        )
        return curves(
            [(cut.name, cut.distance, cut.decibels()) for cut in self.cuts],
            "from the peak (m)",
            floor_db,
            title,
            f"{caption}. Peak at {place(self.position)} m, {level:.2f} dBsm if calibrated.",
        )

    def __str__(self) -> str:
        amplitude = abs(self.peak) / self.gain
        level = round(float(20 * np.log10(amplitude)), 2) + 0.0  # no -0.00
        rows = (
            ("IRW, half power", self.irw, ".4f", "m"),
            ("PSLR", self.pslr, ".2f", "dB"),
            ("ISLR", self.islr, ".2f", "dB"),
            ("lobes within +-", self.reach, ".1f", "IRW"),
        )
        lines = [
            f"position         {place(self.position, 4)} m",
            f"peak             {abs(self.peak):.6g} at {np.angle(self.peak):.4f} rad",
            f"peak/gain        {amplitude:.6g}, RCS {level:.2f} dBsm if calibrated",
            f"{'':15}{NAMES[0]:>12}{NAMES[1]:>14}",
            *(f"{name:15}{a:>12{form}}{b:>14{form}} {unit}" for name, (a, b), form, unit in rows),
        ]
        return "\n".join(lines)


@overload
def measure(image: Image, near: None = None) -> PointResponse: ...


@overload
def measure(image: Image, near: ArrayLike | None) -> PointResponse | tuple[PointResponse, ...]: ...


def measure(image: Image, near: ArrayLike | None = None) -> PointResponse | tuple[PointResponse, ...]:
    """Position, resolution and side lobes of a point of a complex image, or of each of several points.

    image  of rows and columns, with frequency (Hz) and tx, rx (m; rx None is tx); only the data that are needed are
           read. On a plane or a grid by `range_doppler`, or on listed points of a surface: these are measured on the
           plane that touches the surface at the peak
    near   m (3,), projected on the surface along its normal: the highest peak within two resolution cells of it
           is measured. Default: the brightest pixel. (n, 3): that many points, a tuple of a PointResponse each

    Cuts run along range and cross-range projected on the grid; range is the direction of the antennas in the middle
    of the rows that saw the point. IRW is the half-power width; PSLR the highest
    lobe outside the first nulls; ISLR takes the main lobe from null to null and side lobes out to 10 IRW, or
    as far as the image extends on both sides. A uniform aperture has -13.26 and -10.22 dB.
    ValueError for a detected image, a grid of one axis or of three, no frequency or tx, an image of zeros, NaN or
    Inf, a `near` outside the grid or without a peak, a peak closer than 3 IRW to the border or in the
    response of a stronger one, and a grid coarser than the resolution: one on which the response fills more
    than +-0.42 of the +-0.5 cycles per pixel.
    Source: the image equation of sarcl/__init__.py for the carrier; the figures are those of sin(x)/x.

    >>> first, second = sarcl.measure(image, near=[[0, 0, 0], [5, -4, 0]])
    >>> second.position.round(2)
    array([ 5., -4.,  0.])
    """
    validation.instance("image", image, Image)
    _check(image)
    if near is None:
        return _measure_peak(image, *brightest(image))
    if validation.ndim("near", near) != 2:
        return _measure_peak(image, *peak_near(image, near))
    places = validation.array("near", near, np.float64, ("n", 3))
    return tuple(_measure_peak(image, *peak_near(image, position)) for position in places)


class _Outshone(Exception):
    """A peak at `position`, m (3,), with a stronger lobe in the cut `name` along `axis`, of which an IRW is `irw` m."""

    def __init__(self, position: np.ndarray, axis: np.ndarray, name: str, cut: _Cut) -> None:
        self.position, self.axis, self.name, self.cut = position, axis, name, cut


def _measure_peak(image: Image, row: int, column: int) -> PointResponse:
    """The response of the peak at a pixel; ValueError names the strongest pixel in whose response it lies."""
    try:
        return _response(image, row, column)
    except _Outshone as exc:
        weak = exc
    pixel = brightest_around(image, weak.position + weak.cut.lobe * weak.axis, REACH * weak.cut.irw)
    source = place_of(image, *pixel)
    offset = source - weak.position
    distance = float(np.linalg.norm(offset))
    direction = f" in {weak.name}" if abs(offset @ weak.axis) > STRAIGHT * distance else ""
    decibels = 20 * np.log10(np.abs(image.data[pixel]) / np.abs(image.data[row, column]))
    raise ValueError(
        f"the peak at {place(weak.position)} lies in the response of something {decibels:.1f} dB stronger, "
        f"{distance:.3g} m away{direction}; measure that with near={place(source)}"
    )


def _response(image: Image, row: int, column: int) -> PointResponse:
    """The response of the peak at a pixel, whatever is around it."""
    interpolated = ImageInterpolator.about(image, row, column)
    peak = _ascend(interpolated, interpolated.origin, _axes(interpolated, interpolated.origin))
    interpolated, position = interpolated.touching(interpolated.origin if peak is None else peak)
    axes = _axes(interpolated, position)

    def cut(axis: np.ndarray, name: str) -> _Cut:
        def values(t: np.ndarray) -> np.ndarray:
            return interpolated(position + t[:, None] * axis)

        response = _cut(values, interpolated.room(position, axis), interpolated.step, name)
        if response.pslr >= 0:
            raise _Outshone(position, axis, name, response)
        return response

    along, across = (cut(axis, name) for axis, name in zip(axes, NAMES, strict=True))
    if peak is None:
        raise ValueError(
            f"the image has no smooth maximum about {place(position)}: give near= another point, or focus with a finer "
            "grid and a smaller tolerance"
        )
    position.flags.writeable = False
    return PointResponse(
        position=position,
        irw=(along.irw, across.irw),
        pslr=(along.pslr, across.pslr),
        islr=(along.islr, across.islr),
        peak=complex(interpolated(position[None])[0]),
        gain=float(image.gain[row, column]) if isinstance(image.gain, np.ndarray) else image.gain,
        reach=(along.reach, across.reach),
        cuts=(along.cut, across.cut),
    )


def _check(image: Image) -> None:
    if not image.is_complex:
        raise ValueError("the image is detected (multilooked), without phase; measure the complex image")
    if len(image.grid.shape) != 2 or (min(image.grid.shape) < 2 and not image.grid.is_plane):
        raise ValueError(
            f"the grid lists points of shape {image.grid.shape}; cuts need rows and columns of a surface: focus on an "
            "ImageGrid.plane, or list the points row by row"
        )
    needed = {"frequency": "the centre frequency, Hz", "tx": "the antenna at mid-aperture, m (3,)"}
    for name, meaning in needed.items():
        if getattr(image, name) is None:
            raise ValueError(f"image.{name} is None, and the carrier follows from it; set it to {meaning}")


def _axes(interpolated: ImageInterpolator, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors of range and cross-range on the surface, at a position on it, m (3,)."""
    normal = interpolated.surface.normal_at(*interpolated.surface.index(point))
    ends = ends_at(interpolated.image, point)
    gradient = -np.sum([validation.direction("antenna less point", end - point) for end in ends], axis=0)
    along = gradient - (gradient @ normal) * normal
    length = np.linalg.norm(along)
    if length < 1e-3:
        raise ValueError("the antennas stand straight above the grid: range has no direction on it; tilt it")
    return along / length, np.cross(normal, along / length)


def _ascend(interpolated: ImageInterpolator, start: np.ndarray, axes: tuple[np.ndarray, ...]) -> np.ndarray | None:
    """Position of the maximum near `start`, m (3,), from parabolas through log |I| along each axis in turn; None where
    they find none."""
    peak = None
    for step in (interpolated.step, interpolated.step / FINER):
        x = np.array(start if peak is None else peak)
        for _ in range(MOST_STEPS):
            before = x
            for axis in axes:
                x = x + _move(interpolated, x, step * axis)
            if np.linalg.norm(x - start) > FARTHEST * interpolated.step:
                return peak
            if np.linalg.norm(x - before) < 1e-5 * step:
                break
        else:
            return peak
        peak = x
    return peak


def _move(interpolated: ImageInterpolator, x: np.ndarray, step: np.ndarray) -> np.ndarray:
    """From x to the maximum of the parabola through log |I| at x and a step, m (3,), on either side of it; at most a
    step."""
    values = np.abs(interpolated(x + np.array([[-1], [0], [1]]) * step))
    before, middle, after = np.log(np.maximum(values, 1e-300))
    bend = before - 2 * middle + after
    move = (before - after) / (2 * bend) if bend < 0 else np.sign(after - before)
    return np.asarray(np.clip(move, -1, 1) * step)


@dataclass(frozen=True)
class _Cut:
    irw: float
    pslr: float
    islr: float
    reach: float
    lobe: float  # position of the highest side lobe, m from the peak
    cut: Cut


def _cut(values: Callable[[np.ndarray], np.ndarray], room: float, step: float, name: str) -> _Cut:
    """Resolution and side lobes of a cut; values(t) are I at t m from the peak, t (n,), for |t| <= room."""

    def power(t: np.ndarray) -> np.ndarray:
        return np.abs(values(t)) ** 2

    irw = _half_power(power, room, step) + _half_power(lambda t: power(-t), room, step)
    reach = min(REACH, max(room, 0.0) / irw)  # room is -inf where pixels are missing beside the cut, and irw then inf
    if not reach >= LEAST_REACH:
        raise ValueError(
            f"in {name} the image holds less than {LEAST_REACH:g} IRW on each side of the peak; focus a grid "
            f"that reaches {REACH:g} resolution cells and {MARGIN} pixels beyond it"
        )
    n = int(np.ceil(reach * STEPS))
    t = np.linspace(-reach * irw, reach * irw, 2 * n + 1)
    sampled = values(t)
    p = np.abs(sampled) ** 2
    rising = np.diff(p) > 0
    if not (rising[n:].any() and (~rising[:n]).any()):
        raise ValueError(f"in {name} the main lobe has no end within {reach:.1f} IRW: the image is not focused")
    end, start = n + int(rising[n:].argmax()), n - int((~rising[:n])[::-1].argmax())
    inside = _integral(p[start : end + 1])
    lobes = np.where((t < t[start]) | (t > t[end]), p, 0)
    i = int(lobes.argmax())
    highest, lobe = lobes[i], t[i]
    if 0 < i < 2 * n and p[i] >= max(p[i - 1], p[i + 1]):  # maximum of the parabola through three points
        bend = p[i - 1] - 2 * p[i] + p[i + 1]
        highest -= (p[i - 1] - p[i + 1]) ** 2 / (8 * bend)
    decibels = 10 * np.log10(np.array([highest / p[n], _integral(p) / inside - 1]))
    return _Cut(irw, float(decibels[0]), float(decibels[1]), reach, float(lobe), Cut(name, t, sampled))


def _integral(p: np.ndarray) -> float:
    """Trapezoid rule at unit steps."""
    return float(p.sum() - (p[0] + p[-1]) / 2)


def _half_power(power: Callable[[np.ndarray], np.ndarray], room: float, step: float) -> float:
    """Distance, m, at which power(t) first falls to half of power(0); inf if it does not within `room`."""
    start = 0.0
    level = power(np.zeros(1))[0] / 2 if room > 0 else 0.0
    while start < room:
        t = np.minimum(start + step / 2 * np.arange(33), room)
        below = power(t) < level
        if below.any():
            for _ in range(3):  # ever finer between the last point above half power and the first one below
                i = int(below.argmax())
                t = np.linspace(t[i - 1], t[i], 33)
                below = power(t) < level
            return float(t[int(below.argmax())])
        start = float(t[-1])
    return np.inf
