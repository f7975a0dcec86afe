"""AntennaArray: positions, carriers and weights of elements; the carriers may be equal or diverse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base import constants, validation
from ._costas import nearest_sizes, permutation

MOST = 10_000  # largest number of elements
Y, Z = (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class AntennaArray:
    """Isotropic elements, each with its own carrier. Make one with `single`, `linear`, `planar` or `costas`.

    positions  from the reference point, m (n, 3), along the scene's axes
    offsets    carriers minus the base frequency f0, Hz (n_plans, n)
    weights    complex (n,), one per element, default 1
    plan       row of `offsets` that each pulse uses, (n_pulses,); None: row 0 at every pulse

    Elements may coincide. A field is sum_n w_n exp(+j 2 pi f_n (t - r_n/c)), f_n = f0 + offset (`sarcl.beam`).
    Farooq's array (2009, equation 3.1) lies along (0, -1, 0) and (0, 0, -1), which reverses the sign of angles.
    Raises ValueError for other shapes, more than 10 000 elements, weights that are all zero, NaN or Inf.

    >>> array = sarcl.AntennaArray.linear(8, spacing=0.015, frequency_step=20e6)
    >>> array.n, array.offsets_at(0)[:3] / 1e6
    (8, array([ 0., 20., 40.]))
    >>> single, plane = sarcl.AntennaArray.single(), sarcl.AntennaArray.planar((2, 4), spacing=(0.015, 0.02))
    >>> sarcl.AntennaArray.costas(6, spacing=0.015, frequency_step=1e6).offsets_at(0) / 1e6  # a permutation
    array([0., 2., 1., 5., 3., 4.])
    >>> array.subarrays(4).offsets_at(0) / 1e6  # pairs of elements send one carrier
    array([  0.,   0.,  40.,  40.,  80.,  80., 120., 120.])
    >>> array.mirrored(at=32, n_pulses=64).offsets_at(40)[:3] / 1e6  # the last carriers first
    array([140., 120., 100.])
    >>> array.switched(array.with_offsets(np.zeros(8)), at=32, n_pulses=64).offsets_at(40)[:3]  # one carrier
    array([0., 0., 0.])
    """

    positions: NDArray[np.float64]
    offsets: NDArray[np.float64]
    weights: NDArray[np.complex128] = None  # type: ignore[assignment]
    plan: NDArray[np.int64] | None = None

    if TYPE_CHECKING:  # types of the arguments; the fields above have the types after conversion

        def __init__(
            self,
            *,
            positions: ArrayLike,
            offsets: ArrayLike,
            weights: ArrayLike | None = None,
            plan: ArrayLike | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        self._set("positions", validation.array("array positions", self.positions, np.float64, ("n", 3)))
        if self.n > MOST:
            raise ValueError(f"array has {self.n} elements; at most {MOST} are possible: model groups as one element")
        self._set("offsets", validation.array("array offsets", self.offsets, np.float64, ("n_plans", self.n)))
        weights = np.ones(self.n) if self.weights is None else self.weights
        self._set("weights", validation.array("array weights", weights, np.complex128, (self.n,)))
        if not self.weights.any():
            raise ValueError("array weights are zero everywhere; some element must transmit")
        if self.plan is not None:
            plan = validation.array("array plan", self.plan, np.int64, ("n_pulses",))
            is_outside = (plan < 0) | (plan >= len(self.offsets))
            if is_outside.any():
                pulse = int(np.argmax(is_outside))
                raise ValueError(f"array plan[{pulse}] is {plan[pulse]}; offsets has rows 0 to {len(self.offsets) - 1}")
            self._set("plan", plan)

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        extent = np.linalg.norm(np.ptp(self.positions, axis=0))
        plans = f", {len(self.offsets)} plans" if len(self.offsets) > 1 else ""
        return (
            f"AntennaArray({self.n} elements over {extent:.4g} m, offsets {self.offsets.min():.4g} to "
            f"{self.offsets.max():.4g} Hz{plans})"
        )

    @classmethod
    def single(cls) -> AntennaArray:
        """One element at the reference point, which transmits f0."""
        return cls(positions=np.zeros((1, 3)), offsets=np.zeros((1, 1)))

    @classmethod
    def linear(
        cls,
        n: int,
        *,
        spacing: float,
        frequency_step: float = 0.0,
        axis: ArrayLike = Y,
        weights: ArrayLike | None = None,
    ) -> AntennaArray:
        """Element i at i spacing axis, m, transmits f0 + i frequency_step, Hz; element 0 is the reference point.

        A negative spacing reverses the axis.
        """
        i = np.arange(_size("n", n))
        step = validation.number("frequency_step", frequency_step)
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by its name
            place = i[:, None] * (validation.number("spacing", spacing) * validation.direction("axis", axis))
            return cls(positions=place, offsets=[i * step], weights=weights)

    @classmethod
    def planar(
        cls,
        shape: Sequence[int] | np.ndarray,
        *,
        spacing: ArrayLike,
        frequency_step: ArrayLike = (0.0, 0.0),
        axes: Sequence[Sequence[float] | np.ndarray] | np.ndarray = (Y, Z),
        weights: ArrayLike | None = None,
    ) -> AntennaArray:
        """N by P elements: number n P + p at n dy axes[0] + p dz axes[1], which transmits f0 + n dfy + p dfz.

        shape (N, P), spacing (dy, dz) m, frequency_step (dfy, dfz) Hz.
        """
        validation.ndim("shape", shape)
        validation.ndim("axes", axes)
        if np.shape(shape) != (2,) or np.shape(cast(Any, axes)) != (2, 3):
            raise ValueError(f"shape is {shape!r:.40} and axes {axes!r:.60}; give (N, P), and two directions (2, 3)")
        rows, columns = (_size(f"shape[{i}]", shape[i]) for i in range(2))
        _size("shape[0] shape[1]", rows * columns)
        dy, dz = validation.array("spacing", spacing, np.float64, (2,))
        steps = validation.array("frequency_step", frequency_step, np.float64, (2,))
        n, p = (i.ravel() for i in np.indices((rows, columns)))
        y, z = (validation.direction(f"axes[{i}]", axes[i]) for i in range(2))
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused by its name
            place = n[:, None] * (dy * y) + p[:, None] * (dz * z)
            return cls(positions=place, offsets=[n * steps[0] + p * steps[1]], weights=weights)

    @classmethod
    def costas(
        cls, n: int, *, spacing: float, frequency_step: float, axis: ArrayLike = Y, weights: ArrayLike | None = None
    ) -> AntennaArray:
        """Like `linear`, but element i transmits f0 + g(i) frequency_step, g a Costas permutation of 0 ... n - 1.

        spacing, axis, weights  as of `linear`

        Raises ValueError where the constructions of Welch and Golomb modulo a prime give none of this size.
        """
        order = permutation(_size("n", n))
        if order is None:
            below, above = nearest_sizes(n)
            raise ValueError(f"no Costas array of {n} elements is known; the nearest sizes are {below} and {above}")
        step = validation.number("frequency_step", frequency_step)
        with np.errstate(over="ignore"):
            offsets = order * step
        return cls.linear(n, spacing=spacing, axis=axis, weights=weights).with_offsets(offsets)

    def with_offsets(self, offsets: ArrayLike, *, plan: ArrayLike | None = None) -> AntennaArray:
        """The same elements with other `offsets`, Hz (n,), or (n_plans, n) with the `plan` of the pulses."""
        rows = validation.converted("array offsets", offsets, np.float64)
        return replace(self, offsets=rows[None] if rows.ndim == 1 else rows, plan=cast(Any, plan))

    def subarrays(self, count: int, *, steer: ArrayLike | None = None, frequency: float | None = None) -> AntennaArray:
        """`count` equal groups of consecutive elements, each with the carrier of its first element.

        steer      a direction (3,), or (azimuth, elevation) rad from x towards y and z: weights gain the phases that
                   turn each group there, about its first element, at the carrier it sends in plan 0
        frequency  f0, Hz, that those phases hold for; needed with `steer`
        """
        count = validation.count("count", count)
        if self.n % count:
            raise ValueError(f"count is {count}; {self.n} elements do not make {count} equal groups: give a divisor")
        if (steer is None) != (frequency is None):
            raise ValueError("steer and frequency go together: steering phases refer to one frequency; give both")
        first = np.arange(self.n) // (self.n // count) * (self.n // count)
        grouped = replace(self, offsets=self.offsets[:, first])
        if steer is None:
            return grouped
        f = validation.carrier("frequency", frequency) + grouped.offsets[0]
        if f.min() <= 0:
            raise ValueError(f"frequency {frequency:g} Hz gives a carrier of {f.min():g} Hz; carriers are above 0")
        along = (self.positions - self.positions[first]) @ _towards(steer)
        return replace(grouped, weights=self.weights * np.exp(-2j * np.pi * f * along / constants.SPEED_OF_LIGHT))

    def switched(self, other: AntennaArray, at: int, n_pulses: int) -> AntennaArray:
        """This array for the pulses before `at`, the carriers of `other` from `at` on; n_pulses in all.

        Raises ValueError where the two differ in more than their carriers.
        """
        validation.instance("other", other, AntennaArray)
        n_pulses = validation.count("n_pulses", n_pulses)
        validation.room(f"a plan of {n_pulses:.3g} pulses", 32.0 * n_pulses, "give fewer n_pulses")
        if (at := validation.count("at", at, least=0)) > n_pulses:
            raise ValueError(f"at is {at}; it must lie within the {n_pulses} pulses")
        for name in ("positions", "weights"):
            if not np.array_equal(getattr(self, name), getattr(other, name)):
                raise ValueError(f"other has {name} of its own; only carriers can be switched: use with_offsets")
        late = other._rows(n_pulses) + len(self.offsets)
        plan = np.where(np.arange(n_pulses) < at, self._rows(n_pulses), late)
        return self.with_offsets(np.concatenate([self.offsets, other.offsets]), plan=plan)

    def mirrored(self, at: int, n_pulses: int) -> AntennaArray:
        """Of n_pulses, from pulse `at` on the carriers run over the elements in reverse order: progressions change
        sign, the base frequency moves with them, and the centre frequency stays (Farooq 2009, equations 5.33 to 5.35).
        """
        return self.switched(replace(self, offsets=self.offsets[:, ::-1]), at, n_pulses)

    def _rows(self, n_pulses: int) -> np.ndarray:
        if self.plan is None:
            return np.zeros(n_pulses, np.int64)
        if len(self.plan) != n_pulses:
            raise ValueError(f"array plan has {len(self.plan)} pulses, wanted {n_pulses}; give as many")
        return np.asarray(self.plan)

    def offsets_at(self, pulse: int) -> np.ndarray:
        """Offsets of the elements at this pulse, Hz (n,)."""
        pulse = validation.count("pulse", pulse, least=0)
        if self.plan is None:
            return np.asarray(self.offsets[0])
        if pulse >= len(self.plan):
            raise ValueError(f"pulse is {pulse}; the array's plan has pulses 0 to {len(self.plan) - 1}")
        return np.asarray(self.offsets[self.plan[pulse]])

    @property
    def n(self) -> int:
        """Number of elements."""
        return len(self.positions)

    @property
    def is_constant(self) -> bool:
        """Whether all elements have one carrier in every plan: the constant-frequency array."""
        return bool((np.ptp(self.offsets, axis=1) == 0).all())

    @property
    def frequency_step(self) -> float | None:
        """Hz from element to element, where the offsets of every plan are linear in the element's number with one
        step; else None."""
        if self.n == 1:
            return 0.0
        step = (self.offsets[:, -1] - self.offsets[:, 0]) / (self.n - 1)
        line = self.offsets[:, :1] + np.arange(self.n) * step[:, None]
        fits = np.abs(self.offsets - line).max() <= 1e-12 * np.abs(self.offsets).max()
        return float(step[0]) if fits and np.ptp(step) <= 1e-12 * np.abs(step).max() else None

    @property
    def centers(self) -> np.ndarray:
        """Mean of the extreme offsets of each plan, Hz (n_plans,)."""
        return np.asarray((self.offsets.min(axis=1) + self.offsets.max(axis=1)) / 2)

    @property
    def center(self) -> float:
        """Mean of the extreme offsets over all plans, Hz."""
        return float((self.offsets.min() + self.offsets.max()) / 2)

    @property
    def span(self) -> float:
        """Highest minus lowest offset over all plans, Hz."""
        return float(np.ptp(self.offsets))

    @property
    def center_jump(self) -> float:
        """Largest difference of the centre frequency between two plans, Hz; it defocuses the sum of their pulses."""
        return float(np.ptp(self.centers))


def _size(name: str, n: object) -> int:
    size = validation.count(name, n)
    if size > MOST:
        raise ValueError(f"{name} is {size}; an array has at most {MOST} elements")
    return size


def _towards(steer: ArrayLike) -> np.ndarray:
    if np.shape(steer) == (2,):
        azimuth, elevation = validation.array("steer", steer, np.float64, (2,))
        level = np.cos(elevation)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    return validation.direction("steer", steer)
