"""A LinearOperator of SciPy whose errors of shape name what was given."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import issparse
from scipy.sparse.linalg import LinearOperator

from ._autograd import host_array


class NamedOperator(LinearOperator):
    """A LinearOperator whose errors of shape name what was given, and both shapes.

    domain  what a vector that it takes has a number for, in words
    """

    domain = "pixel"

    def dot(self, x: ArrayLike) -> np.ndarray:
        """self @ x of a vector (n,) or of columns (n, k); the product with a number or an operator is an operator."""
        if isinstance(x, LinearOperator) or np.isscalar(x):
            return super().dot(x)
        if issparse(x):
            raise TypeError(f"x is a {type(x).__name__}, and columns are dense arrays: give x.toarray()")
        x = host_array(x)
        if x.ndim not in (1, 2) or x.shape[0] != self.shape[1]:
            raise ValueError(
                f"x has shape {x.shape}, and the operator {self.shape}: give one number for each {self.domain}, "
                f"({self.shape[1]},), or columns of them, ({self.shape[1]}, k)"
            )
        return np.asarray(self.matvec(x) if x.ndim == 1 else self.matmat(x))

    def __matmul__(self, x: ArrayLike) -> np.ndarray:
        return super().__matmul__(x) if np.isscalar(x) else self.dot(x)

    def _matmat(self, x: np.ndarray) -> np.ndarray:
        columns = [self.matvec(column) for column in x.T]
        return np.stack(columns, axis=1) if columns else np.zeros((self.shape[0], 0), self.dtype)
