"""Antenna: a pattern in its own axes, its mounting, and its numbers for the kernels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import constants, validation
from .antenna_pattern import factor_reach, table_limits, table_slope, uniform_spline
from .pointing import rotations
from .trajectory import Trajectory

Kind = Literal["isotropic", "aperture", "gaussian", "table"]
TABLE = ("azimuth", "elevation", "values")  # fields of the kind "table"
KINDS = ("isotropic", "aperture", "gaussian", "table")
LEVEL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # mount of an antenna along the body's axes
MOST_DECIBELS = 300.0  # largest gain, dB: the squares of both antennas' amplitudes stay within float32
AMPLITUDE = 1  # place of the peak's amplitude in the header
HEADER = 16  # floats before the coefficients of a table, as kernels/pattern.clh reads them
ANGLE_ERROR = 5e-7  # error of float32 directions in antenna axes, rad
COSINE = 1e-5  # margin of limits of direction cosines, which kernels compute in float32
FLOAT_ERROR = 2e-6  # error of gains over the peak: rounding of float32 sines, exponentials and spline sums


@dataclass(frozen=True, eq=False, kw_only=True)
class Antenna:
    """An amplitude pattern over directions. Make one with `isotropic`, `rectangular`, `gaussian` or `table`.

    Antenna axes: x boresight, y azimuth, z elevation, right-handed. A direction (x, y, z) lies at azimuth
    atan2(y, x) and elevation atan2(z, hypot(x, y)).

    kind        "isotropic", "aperture", "gaussian" or "table"
    gain_db     gain at the peak, dBi, from -300 to 300; with 0 the peak is 1
    two_way     pattern and gain_db are those of transmitting and receiving together
    size        m (azimuth, elevation), of an aperture;  taper  illumination at its edges, 0 ... 1 of that at the centre
    width       rad (azimuth, elevation), half-power width of a Gaussian pattern
    azimuth, elevation, values   of a table: rad (n,) and (m,), evenly spaced; complex amplitude (n, m), peak modulus 1
    frequency   Hz, to which width or table refer: angles are inversely proportional to frequency; None: no dependence
    mount       rotation from antenna to body axes (3, 3): attitude @ mount is that from antenna to scene axes

    ValueError names the wrong argument. The gain of an aperture is 0 behind it, that of a table outside its angles.

    >>> dish = sarcl.Antenna.gaussian(width=(0.02, 0.02), gain_db=38)
    >>> round(float(20 * np.log10(abs(dish.gain([1, 0.01, 0], frequency=9.6e9)))), 2)  # half its width off the axis, dB
    34.99
    >>> slot, dot = sarcl.Antenna.rectangular(size=(1.5, 0.3), gain_db=30), sarcl.Antenna.isotropic(gain_db=3)
    >>> angles = np.radians(np.linspace(-20, 20, 41))  # azimuth, elevation
    >>> measured = sarcl.Antenna.table(angles, angles, values_db=-400 * (angles[:, None] ** 2 + angles**2), gain_db=20)
    >>> measured.axes(sarcl.pointing.spotlight(track, (0, 0, 0))).shape  # antenna axes at every pulse
    (64, 3, 3)
    """

    kind: Kind
    gain_db: float = 0.0
    two_way: bool = False
    size: NDArray[np.float64] = None  # type: ignore[assignment]  # set where the kind has them
    taper: NDArray[np.float64] = (1.0, 1.0)  # type: ignore[assignment]
    width: NDArray[np.float64] = None  # type: ignore[assignment]
    azimuth: NDArray[np.float64] = None  # type: ignore[assignment]
    elevation: NDArray[np.float64] = None  # type: ignore[assignment]
    values: NDArray[np.complex128] = None  # type: ignore[assignment]
    frequency: float | None = None
    mount: NDArray[np.float64] = LEVEL  # type: ignore[assignment]

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            *,
            kind: Kind,
            gain_db: float = 0.0,
            two_way: bool = False,
            size: ArrayLike | None = None,
            taper: ArrayLike = (1.0, 1.0),
            width: ArrayLike | None = None,
            azimuth: ArrayLike | None = None,
            elevation: ArrayLike | None = None,
            values: ArrayLike | None = None,
            frequency: float | None = None,
            mount: ArrayLike = LEVEL,
        ) -> None: ...

    def __post_init__(self) -> None:
        validation.choice("antenna kind", self.kind, KINDS)
        self._set("gain_db", validation.number("antenna gain_db", self.gain_db))
        if abs(self.gain_db) > MOST_DECIBELS:
            raise ValueError(
                f"antenna gain_db is {self.gain_db:g}; gains reach from {-MOST_DECIBELS:g} to {MOST_DECIBELS:g} dB: "
                "was it a factor?"
            )
        if not isinstance(self.two_way, (bool, np.bool_)):
            raise ValueError(f"antenna two_way is {self.two_way!r}; give True or False")
        self._set("mount", rotations("antenna mount", self.mount, ()))
        if self.frequency is not None:
            self._set("frequency", validation.carrier("antenna frequency", self.frequency))
        if self.kind == "aperture":
            if self.frequency is not None:
                raise ValueError("an aperture's size in metres holds at every frequency; leave its frequency out")
            self._set("size", _pair("antenna size", self.size))
            taper = validation.array("antenna taper", self.taper, np.float64, (2,))
            if not ((taper >= 0) & (taper <= 1)).all():
                raise ValueError(
                    f"antenna taper is {taper.tolist()}; illumination at the edges is 0 to 1 of the centre's"
                )
            self._set("taper", taper)
        elif self.kind == "gaussian":
            width = _pair("antenna width", self.width)
            if (width > np.pi).any():
                raise ValueError(
                    f"antenna width is {width.tolist()} rad; half-power widths are at most pi: were they in deg?"
                )
            self._set("width", width)
        elif self.kind == "table":
            self._check_table()
        for name, kind in (("size", "aperture"), ("width", "gaussian"), *((n, "table") for n in TABLE)):
            if kind != self.kind and getattr(self, name) is not None:
                raise ValueError(f"antenna {name} is of the kind {kind!r}, and kind is {self.kind!r}; leave it out")
        taper = validation.array("antenna taper", self.taper, np.float64, (2,))
        if self.kind != "aperture" and (taper != 1).any():
            raise ValueError(f"antenna taper is of the kind 'aperture', and kind is {self.kind!r}; leave it out")

    def _check_table(self) -> None:
        for name, most in (("azimuth", np.pi), ("elevation", np.pi / 2)):
            axis = validation.array(f"antenna {name}", getattr(self, name), np.float64, ("n",))
            step = np.diff(axis)
            if len(axis) < 4 or not (step > 0).all():
                raise ValueError(f"antenna {name} must be at least 4 increasing angles, got {axis[:5].tolist()} ...")
            if np.ptp(step) > 1e-6 * step.mean():
                index = int(np.argmax(np.abs(step - step.mean())))
                raise ValueError(
                    f"antenna {name}[{index + 1}] is {step[index]:g} rad after its neighbour, {step.mean():g} in the "
                    "mean; a table needs even steps: interpolate it first"
                )
            if np.abs(axis).max() > most * (1 + 1e-6):
                largest = np.abs(axis).max()
                raise ValueError(f"antenna {name} reaches {largest:g} rad, beyond {most:g}: were they in degrees?")
            self._set(name, axis)
        shape = (len(self.azimuth), len(self.elevation))
        values = validation.array("antenna values", self.values, np.complex128, shape)
        if not values.any():
            raise ValueError("antenna values are zero everywhere; some gain must be larger")
        self._set("values", validation.sealed(values / np.abs(values).max()))

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    @classmethod
    def isotropic(cls, *, gain_db: float = 0.0) -> Antenna:
        """An antenna with the same gain in every direction."""
        return cls(kind="isotropic", gain_db=gain_db)

    @classmethod
    def rectangular(
        cls,
        *,
        size: ArrayLike,
        taper: ArrayLike = 1.0,
        gain_db: float = 0.0,
        two_way: bool = False,
        mount: ArrayLike = LEVEL,
    ) -> Antenna:
        """A rectangular aperture, m (azimuth, elevation): sinc(size_y y/lambda) sinc(size_z z/lambda) if uniform.

        taper  illumination at the edges, one or per axis, of a raised cosine on a pedestal: 1 uniform, 0.08 Hamming's,
               0 Hann's
        """
        taper = validation.each("antenna taper", taper, 2)
        return cls(kind="aperture", size=size, taper=taper, gain_db=gain_db, two_way=two_way, mount=mount)

    @classmethod
    def gaussian(
        cls,
        *,
        width: ArrayLike,
        gain_db: float = 0.0,
        two_way: bool = False,
        frequency: float | None = None,
        mount: ArrayLike = LEVEL,
    ) -> Antenna:
        """Power exp(-4 ln 2 ((a/width_y)^2 + (e/width_z)^2)), rad, where (a, e) is the angle from boresight times the
        unit vector of (y, z): azimuth and elevation on the axes."""
        return cls(kind="gaussian", width=width, gain_db=gain_db, two_way=two_way, frequency=frequency, mount=mount)

    @classmethod
    def table(
        cls, azimuth: ArrayLike, elevation: ArrayLike, values: ArrayLike | None = None, *,
        values_db: ArrayLike | None = None, gain_db: float = 0.0,
        two_way: bool = False, frequency: float | None = None, mount: ArrayLike = LEVEL,
    ) -> Antenna:  # fmt: skip
        """A measured pattern: bicubic spline through complex amplitudes, or values_db = 20 log10 of their modulus.

        azimuth (n,), elevation (m,) rad, evenly spaced; values (n, m), of any scale: their peak is set to `gain_db`.
        """
        if (values is None) == (values_db is None):
            raise ValueError("an antenna table takes either values or values_db; give one of them")
        if values is None:
            values = 10 ** (validation.converted("antenna values_db", values_db, np.float64) / 20)
        return cls(
            kind="table", azimuth=azimuth, elevation=elevation, values=values, gain_db=gain_db, two_way=two_way,
            frequency=frequency, mount=mount,
        )  # fmt: skip

    @property
    def amplitude(self) -> float:
        """Amplitude gain at the peak, 10^(gain_db/20)."""
        return float(10 ** (self.gain_db / 20))

    @property
    def has_root(self) -> bool:
        """Whether a two-way pattern is real and nowhere negative: the square of one that sends and receives alike."""
        if self.kind == "table":
            return bool((self.values.real >= 0).all() and not self.values.imag.any())
        return self.kind != "aperture"

    def axes(self, track: Trajectory) -> NDArray[np.float64]:
        """Antenna axes in the scene at every pulse, as columns, (n, 3, 3): track.attitude @ mount.

        Raises ValueError where the track has no attitude, unless the antenna is isotropic, or it is not a rotation.
        """
        validation.instance("track", track, Trajectory)
        if track.attitude is None:
            if self.kind == "isotropic":
                return np.tile(self.mount, (len(track), 1, 1))
            raise ValueError(
                f"the track has no attitude, so nothing aims this {self.kind} antenna; use sarcl.pointing, such as "
                "pointing.spotlight(track, point) or pointing.stripmap(track, look=0.6)"
            )
        attitude = rotations("trajectory attitude", track.attitude, (len(track),))
        return np.asarray(attitude @ self.mount)

    def gain(self, directions: ArrayLike, frequency: float) -> np.ndarray:
        """Complex amplitude gain (...) at directions in antenna axes (..., 3), of any length, at `frequency` Hz."""
        from .antenna_pattern import pattern_gain

        directions = validation.vectors("directions", directions)
        return pattern_gain(self, directions, validation.carrier("frequency", frequency))

    def ratio(self, frequency: float | np.ndarray) -> float | np.ndarray:
        """Factor by which angles are multiplied before the pattern is evaluated."""
        return 1.0 if self.frequency is None else frequency / self.frequency

    def slope(self, frequency: float) -> float:
        """Largest |change of gain| per radian, over the peak, within 90 deg of boresight."""
        if self.kind == "isotropic":
            return 0.0
        if self.kind == "aperture":  # |g'| <= 2 pi/lambda times the illumination's mean distance from its centre
            return float(np.pi / 2 * np.hypot(*self.size) * frequency / constants.SPEED_OF_LIGHT)
        scale = float(self.ratio(frequency))
        if self.kind == "gaussian":  # pi/2: largest stretch of a circle about boresight
            return float(np.pi / 2 * np.exp(-0.5) * 2 * np.sqrt(np.log(2)) / self.width.min()) * scale
        return table_slope(self) * scale

    def error(self, frequency: float) -> float:
        """Bound of the error of float32 gains, over the peak, at directions with the error of float32."""
        return FLOAT_ERROR + ANGLE_ERROR * self.slope(frequency)

    def limits(self, level: float, frequency: float) -> np.ndarray:
        """(y, z, behind): |gain| is below `level` of the peak where a direction cosine along azimuth exceeds y, along
        elevation exceeds z, and behind the antenna where `behind` is -1 (0: not for certain).
        """
        level = validation.number("level", level, above=0)
        if self.kind == "isotropic":
            return np.array([2.0, 2.0, 0.0])
        if self.kind == "aperture":
            y, z = (factor_reach(self, axis, level, frequency) for axis in (0, 1))
            return np.array([y + COSINE, z + COSINE, -1.0])
        if self.kind == "gaussian":  # an angle is not smaller than its sine
            off = np.sqrt(max(np.log(1 / level), 0.0) / (2 * np.log(2))) / self.ratio(frequency)
            return np.array([*(self.width * off + COSINE), -float(self.width.max() * off < np.pi / 2)])
        y, z, behind = table_limits(self, level, float(self.ratio(frequency)))
        return np.array([y + COSINE, z + COSINE, behind])

    def packed(self, frequency: float, dtype: type[np.floating] = np.float32) -> np.ndarray:
        """Numbers of kernels/pattern.clh, float32, or gains_float64.clh: a header, then a table's spline coefficients.

        frequency  Hz at which the kernel's `ratio` is 1.
        """
        numbers = np.zeros(HEADER, dtype)
        integers = numbers.view(f"i{numbers.itemsize}")
        integers[0] = KINDS.index(self.kind)
        shrinks = self.kind == "aperture" or self.frequency is not None
        numbers[AMPLITUDE], numbers[2:4] = self.amplitude, (self.ratio(frequency), shrinks)
        if self.kind == "aperture":
            numbers[4:6] = self.size * frequency / constants.SPEED_OF_LIGHT
            numbers[6:8] = (1 - self.taper) / (1 + self.taper) / 2
        elif self.kind == "gaussian":
            numbers[4:6] = np.sqrt(2 * np.log(2)) / self.width
        elif self.kind == "table":
            for i, axis in enumerate((self.azimuth, self.elevation)):
                numbers[4 + 2 * i : 6 + 2 * i] = axis[0], (len(axis) - 1) / (axis[-1] - axis[0])
            integers[8:10] = self.values.shape
            weights = np.ascontiguousarray(uniform_spline(uniform_spline(self.values).T).T, np.complex128)
            return np.concatenate([numbers, weights.view(np.float64).ravel().astype(dtype)])
        return numbers


def pair_of(antenna: object, bistatic: bool) -> tuple[Antenna, Antenna | None]:
    """(transmitting, receiving) antennas from one Antenna or a pair; None for the second if the first is two-way."""
    pair = antenna if isinstance(antenna, (tuple, list)) else (antenna, antenna)
    if len(pair) != 2:
        raise ValueError(f"antenna has {len(pair)} entries; give an Antenna, or (transmitting, receiving)")
    for member in pair:
        validation.instance("antenna", member, Antenna)
    tx, rx = pair
    if not (tx.two_way or rx.two_way):
        return tx, rx
    if tx is not rx or bistatic:
        raise ValueError("a two-way pattern is that of one antenna at one position; give two one-way patterns")
    return tx, None


def _pair(name: str, value: object) -> np.ndarray:
    numbers = validation.each(name, value, 2)
    if not (numbers > 0).all():
        raise ValueError(f"{name} is {numbers.tolist()}; both must be greater than 0")
    return numbers
