"""Echoes: the echo of points as a linear operator of their amplitudes, and its adjoint."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from inspect import cleandoc
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from ..base.errors import ToleranceUnreachable
from ..base.validation import choice, converted, count, finite, number
from ..base.verb import MARK, constructor, listed
from ..imaging.backproject_options import BackprojectOptions
from ..model.phase_history import PhaseHistory
from ..numerics.plan import LEAST_TOLERANCE
from ..opencl.choose_device import open_device
from ..opencl.memory_budget import budget
from ..scattering.antenna_weights import AntennaWeights
from ._autograd import host_array, jax_function, rows_of_batch, torch_batch, torch_function
from ._float32_pair import Image, PointEchoes
from ._float64_pair import ROWS, TransposedImage, choice_of
from ._gradients import KINDS, Gradients, Kind
from ._measurement import Domain, RowsAsRead, measurement_of
from ._options import EchoesOptions
from ._shape_errors import NamedOperator

MOST_ROUNDS = 200  # of the power iteration
# Errors of both directions are independent: <y, A x> - <A.H y, x> is smaller than they are by the root of the numbers
# that it adds up. With fewer numbers than MANY plans are made for a smaller tolerance, which costs little there.
MANY, LEAST_SHARE = 1000, 0.1


class _Adjoint(NamedOperator):
    """The adjoint of Echoes."""

    domain = "sample"

    def __init__(self, of: Echoes) -> None:
        super().__init__(of.dtype, (of.shape[1], of.shape[0]))
        self._of = of

    def _matvec(self, y: np.ndarray) -> np.ndarray:
        return self._of._rmatvec(y)

    def _rmatvec(self, x: np.ndarray) -> np.ndarray:
        return self._of._matvec(x)

    def _adjoint(self) -> Echoes:
        return self._of


@dataclass(frozen=True, eq=False)
class _Call(EchoesOptions):
    """Arguments of Echoes, for type checkers."""

    domain: Domain
    like: PhaseHistory


class Echoes(NamedOperator):
    """Echoes of points as a linear operator A of their amplitudes; A.H is the image of samples.

            (A x)_pn = w_p w_n W(f_pn) sum_k v_p(x_k) g_p(x_k) x_k exp(-j 2 pi f_pn (tau_k(p) - tau_ref(p)))

        domain     the points: an ImageGrid, or positions, m (n, 3)
        like       PhaseHistory whose positions, frequencies, reference ranges, channels and `weight` the rows have; its
                   samples are not read
    {options}

        A has shape (rows times samples, points): samples are raw.samples.ravel(), amplitudes image.data.ravel(). It is
        planned once; `predicted_error` is the larger one of both directions. Data are complex64, and complex128 for
        tolerances below 1e-6; with exact=True also where the input is. Threads may share an operator: they take turns.

        TypeError, ValueError: arguments that do not fit, naming them. ToleranceUnreachable, a ValueError: the tolerance
        cannot be met. An operator cannot be pickled, and a process that was forked cannot use it: make it there.
        Source: Farooq 2009, sections 2.2.2 and 2.3; docs/theory/linear.md.

        >>> operator = sarcl.linear.Echoes(grid, raw)
        >>> pixels = operator.H @ raw.samples.ravel()
        >>> np.allclose(pixels.reshape(grid.shape), image.data, atol=1e-2 * image.gain)
        True
        >>> x = np.ones(operator.shape[1], np.complex64)
        >>> np.allclose(operator.normal(x), operator.H @ operator.dot(x), rtol=1e-2, atol=1e-2 * operator.norm())
        True
        >>> gradients = operator.gradients(x, raw.samples.ravel(), of="tx")
        >>> moved = operator.at(tx=raw.tx + 0.01)
        >>> y = operator.A(x.reshape(grid.shape))
        >>> operator.A_adjoint(y).shape
        (128, 128)
        >>> f = operator.torch()  # needs sarcl[torch]
        >>> g = operator.jax()  # needs sarcl[jax]
    """

    @constructor(EchoesOptions, _Call)
    def __init__(self, domain: Domain, like: PhaseHistory, options: EchoesOptions) -> None:
        self._prepare(domain, like, options)

    def _prepare(
        self,
        domain: Domain,
        like: PhaseHistory,
        options: EchoesOptions,
        known: TransposedImage | None = None,
        aimed: AntennaWeights | None = None,
    ) -> None:
        """Plan; in float64 as a known pair, where that plan holds; aimed  gains whose axes the antennas keep."""
        self._domain, self._like, self._options = domain, like, options
        self.tolerance, self.exact = float(options.tolerance), bool(options.exact)
        self._device, self._lock = open_device(options.device), threading.RLock()
        self._measurement = measurement = measurement_of(domain, like, options, aimed)
        self._available = budget(self._device, options.max_bytes)
        self._gradients: Gradients | None = None
        self._forward: PointEchoes | TransposedImage
        if self.exact or self.tolerance < LEAST_TOLERANCE or measurement.is_cut or not self._plan_in_float32():
            self._forward = self._float64_pair(options.method, known)
            self._image = Image(self._image_options(self.tolerance), measurement, self._forward.choice)
        self._pair = self._forward if isinstance(self._forward, TransposedImage) else None
        self.predicted_error = max(self._forward.predicted_error, self._image.choice.predicted_error)
        dtype = np.complex128 if self.tolerance < LEAST_TOLERANCE else np.complex64
        rows, samples = measurement.shape
        super().__init__(dtype, (rows * samples, measurement.task.grid.size))

    def _image_options(self, tolerance: float) -> BackprojectOptions:
        method, most = self._options.method, self._options.max_bytes
        return BackprojectOptions(tolerance=tolerance, method=method, device=self._device, max_bytes=most)

    def _plan_in_float32(self) -> bool:
        """Plan each direction by itself; False where gains of an antenna need float64, which the device has."""
        measurement = self._measurement
        few = math.sqrt(min(measurement.seen_pixels, math.prod(measurement.shape)) / MANY)
        least = max(self.tolerance * min(max(few, LEAST_SHARE), 1.0), LEAST_TOLERANCE)
        for tolerance in sorted({least, self.tolerance}):
            options, method = self._image_options(tolerance), self._options.method
            try:
                chosen = options.choose(measurement.task, [self._device])
                self._forward = PointEchoes(self._device, measurement, tolerance, method, self._available)
            except ToleranceUnreachable:
                if tolerance < self.tolerance:
                    continue
                if measurement.task.antenna is None or not self._device.info.fp64 or method == "factorized":
                    raise
                return False
            self._image = Image(options, measurement, chosen)
            break
        return True

    def normal(self, x: ArrayLike) -> np.ndarray:
        """A.H @ A @ x of amplitudes (n,). Samples are made when the image reads them, in blocks of rows.

        They are in memory only where max_bytes is so small that the image, or a factorised echo, is made in parts.
        """
        values = host_array(x)
        if values.shape != self.shape[1:]:
            raise ValueError(f"x has shape {values.shape}, wanted one number per pixel ({self.shape[1]},)")
        measurement, row_bytes = self._measurement, 16 * self._measurement.shape[1]
        at_once = max(1, min(ROWS, int(self._available / 16 / row_bytes)))

        def pixels(amplitudes: np.ndarray) -> np.ndarray:
            rows_of = self._forward.rows_of(amplitudes)

            def rows(start: int, stop: int) -> np.ndarray:
                return measurement.weighted(measurement.weighted(rows_of(start, stop), start), start)

            return self._image(RowsAsRead(rows, self.n_rows, at_once, np.dtype(self._forward.dtype)))

        return self._applied("x", pixels, values)

    def norm(self, tolerance: float = 1e-3, seed: int = 0) -> float:
        """The largest singular value, by power iteration from random amplitudes (`seed`); a lower bound.

        Changes from round to round shrink by a ratio: iterations stop where the rest of that series is below
        `tolerance`, at most after 200.
        """
        least = number("tolerance", tolerance, above=0)
        random = np.random.default_rng(count("seed", seed, 0))
        x = random.standard_normal(self.shape[1]) + 1j * random.standard_normal(self.shape[1])
        value, change = 0.0, np.inf
        for _ in range(MOST_ROUNDS):
            y = self @ (x / np.linalg.norm(x)).astype(self.dtype)
            before, value = value, float(np.linalg.norm(y))
            earlier, change = change, abs(value - before)
            rest = change**2 / (earlier - change) if change < earlier < np.inf else np.inf
            if rest <= least * value or value == 0:
                break
            x = self.H @ y
        return value

    def gradients(self, x: ArrayLike, y: ArrayLike, of: Kind | Sequence[Kind] | None = None) -> dict[str, np.ndarray]:
        """Gradients of Re <y, A x>, <y, z> = sum conj(y) z: the derivatives with respect to each kind of parameter.

        x, y  amplitudes (n,) and samples (rows times samples,)
        of    kinds, None: all. "amplitudes": complex (n,), A.H y, of which Re <A.H y, dx> is the change. "positions"
              of points, per m (n, 3). "heights", along the normal of a plane or the vertical, per m (n,). "tx", "rx",
              per m (n_rows, 3): where like has one antenna both move with "tx", and "rx" is refused.
              "reference_range", per m, and "phase", of samples times exp(j phase), per rad (n_rows,). "pointing", of
              rotation vectors of both antennas' axes in the scene, per rad (n_rows, 3): with antenna= alone

        All but "amplitudes" are float64 and computed in float64, within about the tolerance of their norms at random
        phases. Gains of antennas change with positions, and their axes keep their directions. What range windows,
        beams and windows over the aperture cut does not move. ValueError: unknown kinds, "pointing" without antenna=,
        "rx" of one antenna, a device without float64.
        """
        is_one_antenna = self._like.rx is self._like.tx
        has_gains = self._measurement.task.antenna is not None
        absent = {"rx": is_one_antenna, "pointing": not has_gains}
        if of is None:
            of = [kind for kind in KINDS if not absent.get(kind)]
        kinds: list[Kind] = [of] if isinstance(of, str) or not isinstance(of, Iterable) else [*of]
        for kind in kinds:
            choice("of", kind, KINDS)
        if "pointing" in kinds and not has_gains:
            raise ValueError('of has "pointing", which needs gains that depend on directions: give antenna=')
        x, y = (self._vector(name, value, n) for name, value, n in (("x", x, 1), ("y", y, 0)))
        out = {"amplitudes": self.H @ y} if "amplitudes" in kinds else {}
        if [kind for kind in kinds if kind != "amplitudes"]:
            if "rx" in kinds and is_one_antenna:
                raise ValueError(
                    'of has "rx", but like has one antenna: ask for "tx", or make it with rx=raw.rx.copy()'
                )
            samples = y.reshape(self._measurement.shape)
            with self._lock:
                if self._gradients is None:
                    pair = self._pair or self._float64_pair()
                    self._gradients = Gradients(pair, self._measurement, self._available)
                out |= self._gradients.of(x, samples, kinds)
        return {kind: out[kind] for kind in kinds}

    def at(
        self,
        *,
        positions: ArrayLike | None = None,
        tx: ArrayLike | None = None,
        rx: ArrayLike | None = None,
        reference_range: ArrayLike | None = None,
    ) -> Echoes:
        """The operator at other positions of points, m (n, 3), antennas tx, rx, m (n_rows, 3), or reference_range, m.

        Other arguments are as they were, and the axes of antennas too. In float64 the plan is kept as long as it meets
        the tolerance, else, and in float32, it is planned for the new geometry.
        """
        like = self._like
        if tx is not None:
            like = replace(like, tx=converted("tx", tx, np.float64))
        if rx is not None:
            like = replace(like, rx=converted("rx", rx, np.float64))
        if reference_range is not None:
            like = replace(like, reference_range=converted("reference_range", reference_range, np.float64))
        moved = Echoes.__new__(Echoes)
        domain = self._domain if positions is None else positions
        moved._prepare(domain, like, self._options, self._pair, self._measurement.task.antenna)
        return moved

    def torch(self) -> Callable[..., object]:
        """f(x, positions=None, tx=None, rx=None, reference_range=None, phase=None) of tensors, for PyTorch's autograd.

        It gives samples (rows times samples,), each row times exp(j phase). At other positions it is `at`, in each
        call. Real values have real gradients. It is differentiated once. ImportError: pip install 'sarcl[torch]'.
        """
        return torch_function(self)

    def jax(self) -> Callable[..., object]:
        """As `torch`, of JAX arrays, with a custom_vjp that calls the host. ImportError: pip install 'sarcl[jax]'."""
        return jax_function(self)

    @property
    def n_rows(self) -> int:
        """Rows of samples."""
        return self._measurement.shape[0]

    def result_type(self, kind: np.dtype[np.generic]) -> np.dtype[np.complexfloating]:
        """Data type of results of input of a type: complex64 or complex128."""
        double = self.dtype == np.complex128 or (self.exact and np.result_type(kind, np.complex64) == np.complex128)
        return np.dtype(np.complex128 if double else np.complex64)

    def _float64_pair(self, method: str = "auto", known: TransposedImage | None = None) -> TransposedImage:
        """A pair in float64 with the tolerance; its plan is that of a known pair, where that holds."""
        if self._measurement.task.antenna is not None and self._measurement.task.taper is not None:
            raise ValueError(
                "antenna= weighs the rows in each pixel, and so does window over the aperture with beam=: leave one out"
            )
        if method == "factorized":
            raise ValueError("method='factorized' is not possible in float64, which exact=True asks for: take 'auto'")
        chosen = choice_of(self._measurement, self.tolerance, known)
        return TransposedImage(self._device, self._measurement, chosen, self._available)

    def _vector(self, name: str, values: ArrayLike, axis: int) -> np.ndarray:
        """Finite values, complex128, of as many elements as an axis of the operator has."""
        array = converted(name, host_array(values), np.complex128)
        if array.shape != (self.shape[axis],):
            raise ValueError(
                f"{name} has shape {array.shape}, wanted ({self.shape[axis]},), as the operator {self.shape}"
            )
        finite(name, array)
        open_device(self._device)  # refused in a process that was forked
        return array

    def A(self, x: ArrayLike) -> np.ndarray:
        """Samples (..., n_rows, n_samples) of images x (..., *shape of the domain): the forward operator of deepinv.

        Tensors of PyTorch give tensors, which are differentiated.
        """
        return self._of_batch(self, x, self._measurement.task.grid.shape, self._measurement.shape)

    def A_adjoint(self, y: ArrayLike) -> np.ndarray:
        """Images (..., *shape of the domain) of samples y (..., n_rows, n_samples): the adjoint operator of deepinv.

        Tensors of PyTorch give tensors, which are differentiated.
        """
        return self._of_batch(self.H, y, self._measurement.shape, self._measurement.task.grid.shape)

    @staticmethod
    def _of_batch(operator: LinearOperator, x: ArrayLike, inside: tuple[int, ...], out: tuple[int, ...]) -> np.ndarray:
        if hasattr(x, "detach"):
            return torch_batch(operator, x, inside, out)
        array = host_array(x)
        vectors, shape = rows_of_batch(array, inside, out)
        return np.ascontiguousarray((operator @ vectors.T).T).reshape(shape)

    def _matvec(self, x: np.ndarray) -> np.ndarray:
        measurement = self._measurement

        def samples(amplitudes: np.ndarray) -> np.ndarray:
            return measurement.weighted(self._forward.rows_of(amplitudes)(0, self.n_rows)).ravel()

        return self._applied("x", samples, x.ravel())

    def _rmatvec(self, y: np.ndarray) -> np.ndarray:
        measurement = self._measurement

        def pixels(samples: np.ndarray) -> np.ndarray:
            return self._image(measurement.weighted(samples.reshape(measurement.shape)))

        return self._applied("y", pixels, y.ravel())

    def _applied(self, name: str, apply: Callable[[np.ndarray], np.ndarray], values: np.ndarray) -> np.ndarray:
        """`apply` to finite values (n,) of any size: scaled by a power of two, and the result scaled back."""
        out = self.result_type(values.dtype)
        values = converted(name, values, np.result_type(values.dtype, out))
        finite(name, values)
        open_device(self._device)  # refused in a process that was forked
        numbers = values.view(values.real.dtype)
        largest = float(np.abs(numbers).max(initial=0.0))
        exponent = np.frexp(largest)[1]
        scaled = np.ldexp(numbers, -exponent).view(values.dtype).astype(out)
        with self._lock:
            result = np.array(apply(scaled), np.complex128, order="C")
        parts = np.ldexp(result.view(np.float64), exponent)
        with np.errstate(over="ignore"):
            final = parts.view(np.complex128).astype(out)
        if not np.isfinite(final).all() or (result.any() and not final.any()):
            raise ValueError(
                f"{name} has numbers to {largest:.3g}, and the result leaves the range of {out}: scale {name}"
            )
        return final

    def _adjoint(self) -> _Adjoint:
        return _Adjoint(self)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "sarcl.linear.Echoes holds memory of a device and cannot be pickled or copied; make it in the process that "
            "uses it"
        )


Echoes.__doc__ = cleandoc(Echoes.__doc__ or "").replace(MARK, listed(EchoesOptions))
