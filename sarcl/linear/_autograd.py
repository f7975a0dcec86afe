"""The operator as a function that PyTorch and JAX differentiate.

    s = exp(j phase_p) A(positions, tx, rx, reference_range) x

source  PyTorch's and JAX's conventions for complex numbers: PyTorch passes on derivatives of Re <y, ds>, JAX those of
        Re sum(y ds)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ._gradients import KINDS

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

    from ._echoes import Echoes

PLACES = ("positions", "tx", "rx", "reference_range")  # what `Echoes.at` takes
PARAMETERS = (*PLACES, "phase")
Value = TypeVar("Value")


def library(name: str, extra: str) -> ModuleType:
    """A module that is no dependency; ImportError with the remedy where it is missing."""
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError as exc:
        raise ImportError(f"A.{extra}() needs the package {name} ({exc}): pip install 'sarcl[{extra}]'") from exc


class Applied:
    """One application: samples (rows times samples,) of amplitudes x (n,) and values of PARAMETERS, and gradients."""

    def __init__(self, operator: Echoes, x: np.ndarray, values: Mapping[str, np.ndarray]) -> None:
        places = {name: value for name, value in values.items() if name in PLACES}
        self.operator, self.x, self.values = operator.at(**places) if places else operator, x, values
        self.turn = np.ones((1, 1))
        if "phase" in values:
            n_rows = self.operator.n_rows
            if np.shape(values["phase"]) != (n_rows,):
                raise ValueError(f"phase has shape {np.shape(values['phase'])}, wanted one per row ({n_rows},)")
            self.turn = np.exp(1j * values["phase"])[:, None]

    def _turned(self, samples: np.ndarray, factors: np.ndarray) -> np.ndarray:
        kind = samples.dtype
        return (samples.reshape(self.operator.n_rows, -1) * factors).ravel().astype(kind)

    def samples(self) -> np.ndarray:
        """s."""
        return self._turned(self.operator @ self.x, self.turn)

    def gradients(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """Derivatives of Re <y, s> by "x" and each parameter that has a value."""
        back = self._turned(y, self.turn.conj())
        out = {"x": self.operator.H @ back}
        return out | (
            self.operator.gradients(self.x, back, of=[kind for kind in KINDS if kind in self.values])
            if self.values
            else {}
        )


def torch_function(operator: Echoes) -> Callable[..., object]:
    """f(x, **values) of tensors, which PyTorch differentiates once: see `Echoes.torch`."""
    torch = library("torch", "torch")

    class Apply(torch.autograd.Function):  # type: ignore[name-defined]
        """The application of an operator to x, for the names of the values that follow."""

        @staticmethod
        def forward(ctx, x, names, *values):
            arrays = {name: _array(value) for name, value in zip(names, values, strict=True)}
            ctx.applied, ctx.kinds, ctx.names = Applied(operator, _array(x), arrays), (x, *values), names
            return torch.from_numpy(ctx.applied.samples()).to(x.device)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx, y):
            gradients, names = ctx.applied.gradients(_array(y)), ("x", *ctx.names)
            of_x, *others = (_like(torch, gradients[name], kind) for name, kind in zip(names, ctx.kinds, strict=True))
            return (of_x, None, *others)

    def function(x, **values):
        """Samples (rows times samples,) of amplitudes x (n,)."""
        values = _known(values)
        return Apply.apply(x, tuple(values), *values.values())

    return function


def rows_of_batch(x, inside: tuple[int, ...], out: tuple[int, ...]):
    """Vectors (k, n) of an array or tensor (..., *inside), and the shape (..., *out) of results."""
    leading = tuple(x.shape)[: max(0, x.ndim - len(inside))]
    if tuple(x.shape) != (*leading, *inside):
        raise ValueError(f"x has shape {tuple(x.shape)}, and the operator takes arrays (..., {str(inside)[1:-1]})")
    return x.reshape(-1, math.prod(inside)), (*leading, *out)


def torch_batch(operator: LinearOperator, x, inside: tuple[int, ...], out: tuple[int, ...]):
    """Tensors (..., *out) of tensors (..., *inside), differentiated by the adjoint of the operator."""
    torch = library("torch", "torch")

    class Apply(torch.autograd.Function):  # type: ignore[name-defined]
        """The operator and its adjoint."""

        @staticmethod
        def forward(ctx, x):
            ctx.kind = x
            return torch.from_numpy(np.stack([operator @ one for one in _array(x)])).to(x.device)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx, y):
            return _like(torch, np.stack([operator.H @ one for one in _array(y)]), ctx.kind)

    vectors, shape = rows_of_batch(x, inside, out)
    return Apply.apply(vectors).reshape(shape)


def host_array(x) -> np.ndarray:
    """A NumPy array in the memory of x where x lends it by DLPack, as tensors of the host do; else np.asarray(x)."""
    if not isinstance(x, np.ndarray) and hasattr(x, "__dlpack__"):
        try:
            return np.from_dlpack(x)
        except (BufferError, RuntimeError, TypeError, ValueError):  # of another device, or with derivatives
            pass
    return np.asarray(x)


def _array(tensor) -> np.ndarray:
    """The numbers of a tensor, in the tensor's own memory where that is the host's."""
    return np.asarray(tensor.detach().cpu().resolve_conj().numpy())


def _like(torch: ModuleType, values: np.ndarray, tensor):
    """Values as a tensor of the type and device of another: of a real one their real parts."""
    values = values if tensor.is_complex() else values.real
    return torch.from_numpy(np.ascontiguousarray(values)).to(tensor)


def _known(values: Mapping[str, Value | None]) -> dict[str, Value]:
    """The values that are not None; TypeError for other names than PARAMETERS."""
    unknown = [name for name in values if name not in PARAMETERS]
    if unknown:
        raise TypeError(f"{unknown[0]} is no parameter of the operator; it has x and {', '.join(PARAMETERS)}")
    return {name: value for name, value in values.items() if value is not None}


def jax_function(operator: Echoes) -> Callable[..., object]:
    """f(x, **values) of JAX arrays, with a custom_vjp: see `Echoes.jax`."""
    jax = library("jax", "jax")

    def result_of(x):
        return jax.ShapeDtypeStruct((operator.shape[0],), operator.result_type(np.dtype(x.dtype)))

    def on_host(x, values):
        return Applied(operator, host_array(x), {k: host_array(v) for k, v in values.items()}).samples()

    def gradients_on_host(x, values, y):
        applied = Applied(operator, host_array(x), {k: host_array(v) for k, v in values.items()})
        gradients = applied.gradients(host_array(y).conj())
        of_x = gradients.pop("x").conj()
        of_x = (of_x if np.iscomplexobj(x) else of_x.real).astype(x.dtype)
        return of_x, {name: np.asarray(gradients[name], values[name].dtype) for name in values}

    @jax.custom_vjp
    def apply(x, values):
        return jax.pure_callback(on_host, result_of(x), x, values)

    def forward(x, values):
        return apply(x, values), (x, values)

    def backward(known, y):
        shapes = jax.tree.map(lambda a: jax.ShapeDtypeStruct(a.shape, a.dtype), known)
        return jax.pure_callback(gradients_on_host, shapes, *known, y)

    apply.defvjp(forward, backward)

    def function(x, **values):
        """Samples (rows times samples,) of amplitudes x (n,)."""
        numbers = {name: jax.numpy.asarray(value) for name, value in _known(values).items()}
        return apply(jax.numpy.asarray(x), numbers)

    return function
