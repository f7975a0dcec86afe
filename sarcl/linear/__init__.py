"""Echoes as a linear operator of the amplitudes: forward, adjoint, and gradients with respect to what moves.


For this folder alone:

    _autograd      the operator as a function that PyTorch and JAX differentiate
    _echoes        Echoes: the operator
    _float32_pair  both directions in float32: the plans of echo and backproject, made once
    _float64_pair  both directions in float64, one the transpose of the other to rounding
    _gradients     gradients of Re <y, A x> with respect to amplitudes and to what moves
    _measurement   what both directions share: rows, weights, pixels
    _options       EchoesOptions: the options of the operator
    _shape_errors  a LinearOperator whose errors of shape name what was given
"""

from ._echoes import Echoes as Echoes

__all__ = ["Echoes"]
