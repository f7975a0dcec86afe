"""The operator in PyTorch, JAX and PyLops, each where it is installed."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from helpers.cases import noise_history

import sarcl

GRID = sarcl.ImageGrid.plane(shape=(3, 2), spacing=0.4)
POSITIONS = GRID.positions.reshape(-1, 3)


def operator(**options):
    like = noise_history(n_rows=3, n_samples=4, bistatic=True)
    return like, sarcl.linear.Echoes(POSITIONS, like, **({"exact": True, "tolerance": 1e-11} | options))


def random_vector(n, seed=0):
    random = np.random.default_rng(seed)
    return random.standard_normal(n) + 1j * random.standard_normal(n)


def parameters(like):
    """Each parameter near the operator's own, with phases."""
    values = {"positions": POSITIONS, "tx": like.tx, "rx": like.rx, "reference_range": like.reference_range}
    return values | {"phase": np.linspace(0.1, 0.9, 3)}


def test_torch_gradients_are_those_of_differences():
    torch = pytest.importorskip("torch")
    like, A = operator()
    f, x = A.torch(), torch.tensor(random_vector(6), requires_grad=True)
    assert torch.autograd.gradcheck(f, (x,))
    assert np.array_equal(f(x).detach().numpy(), A @ x.detach().numpy())
    for name, value in parameters(like).items():
        moved = torch.tensor(np.asarray(value), requires_grad=True)
        # antennas at 10 km change phases by 4 pi/lambda per metre: differences are over 0.1 mm
        step = {"eps": 1e-6} if name == "phase" else {"eps": 1e-5, "rtol": 1e-3, "atol": 0.1}
        assert torch.autograd.gradcheck(lambda x, v, name=name: f(x, **{name: v}), (x, moved), **step), name


def test_torch_moves_images_and_samples_in_batches_as_deepinv_calls_them():
    torch = pytest.importorskip("torch")
    like = noise_history(n_rows=3, n_samples=4)
    A = sarcl.linear.Echoes(GRID, like)
    images = torch.randn(2, 1, 3, 2, dtype=torch.complex64, requires_grad=True)
    samples = A.A(images)
    assert samples.shape == (2, 1, 3, 4)
    samples.abs().square().sum().backward()
    expected = 2 * A.A_adjoint(samples.detach()).numpy()
    assert np.allclose(images.grad.numpy(), expected, rtol=1e-3, atol=1e-3)


def test_jax_gradients_are_those_of_differences():
    jax = pytest.importorskip("jax")
    from jax.test_util import check_grads

    with jax.enable_x64(True) if hasattr(jax, "enable_x64") else jax.experimental.enable_x64():
        like, A = operator()
        f, x = A.jax(), jax.numpy.asarray(random_vector(6))
        assert np.allclose(f(x), A @ np.asarray(x))
        check_grads(f, (x,), order=1, modes=["rev"])
        for name, value in parameters(like).items():
            moved = jax.numpy.asarray(value)
            step = {"eps": 1e-6} if name == "phase" else {"eps": 1e-5, "rtol": 1e-3, "atol": 0.1}
            check_grads(lambda v, name=name: f(x, **{name: v}), (moved,), order=1, modes=["rev"], **step)


def test_pylops_takes_the_operator_as_it_is():
    pylops = pytest.importorskip("pylops")
    like = noise_history(n_rows=9, n_samples=16)
    A = sarcl.linear.Echoes(GRID, like, exact=True)
    wrapped = pylops.aslinearoperator(A)
    wrapped.dtype = np.dtype(np.complex128)
    assert pylops.utils.dottest(wrapped, *A.shape, complexflag=3, rtol=1e-12)


class Exchanged:
    """An array of another library: it has numbers by DLPack alone, and none to copy."""

    def __init__(self, array):
        self.array, self.shape, self.loans = array, array.shape, 0

    def __dlpack__(self, *, copy=None, **options):
        assert not copy
        self.loans += 1
        return self.array.__dlpack__(**options)

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


def test_arrays_come_by_dlpack_in_their_own_memory():
    _, A = operator(tolerance=1e-6)
    x, y = (Exchanged(random_vector(n, n)) for n in (6, 12))
    for got, expected in (
        (A @ x, A @ x.array),
        (A.H @ y, A.H @ y.array),
        (A.normal(x), A.normal(x.array)),
        (A.A(Exchanged(x.array[None])), A.A(x.array[None])),
        (A.gradients(x, y, of="tx")["tx"], A.gradients(x.array, y.array, of="tx")["tx"]),
    ):
        assert np.array_equal(got, expected)
    assert (x.loans, y.loans) == (3, 2)


@pytest.mark.parametrize("name", ["torch", "jax"])
def test_a_missing_library_is_named_with_the_remedy(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=rf"pip install 'sarcl\[{name}\]'"):
        getattr(operator(tolerance=1e-3)[1], name)()


@pytest.mark.parametrize("name", ["torch", "jax"])
def test_unknown_parameters_are_refused(name):
    library = pytest.importorskip(name)
    make = library.tensor if name == "torch" else library.numpy.asarray
    f = getattr(operator(tolerance=1e-3)[1], name)()
    with pytest.raises(TypeError, match="speed"):
        f(make(random_vector(6)), speed=make(1.0))
