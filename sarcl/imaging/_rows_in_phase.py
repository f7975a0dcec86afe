"""Errors of interpolation that add up in phase over a few rows.

A row p of spectrum S_p[k] contributes c_p P_p(d_p) to a pixel: P_p(d) = sum_k S_p[k] exp(j 2 pi k d), the delay d_p in
fractions of the range window, and c_p the phase of the carrier. Interpolated from a profile of L samples it has the
error (docs/theory/accuracy.md, "Evenly spaced scatterers")

    c_p sum_k S_p[k] exp(j 2 pi k d_p) sum_m exp(j 2 pi m L d_p) T(k/L + m)/T(k/L),   m = +-1, ...

Of a kernel whose error is at most E, the sum over the rows is about E times, and hardly more than E times the largest
value, over small delays d beside the pixel, of

    N_m(d) = sum_p c_p exp(j 2 pi m L d_p) Q_p(d_p + d)

where Q_p is P_p with frequencies weighted as the errors of kernels are, which are largest at the edge of the band.
Over many rows and pixels it is that of random phases, sqrt(sum_p |P_p|^2). Over few it need not be: where all rows have
a pixel at the same place between their samples, the errors add up as the profiles beside the pixel do, even if their
values at the pixel cancel.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

FAINTEST = 1e-20  # share of the power beside the pixels, taken where every pixel is at an exact null of every row


@dataclass(eq=False)
class RowsInPhase:
    """Contributions of a few rows to some pixels, and beside them; 0 where a row does not see a pixel.

    delays  d_p (n_rows, n), in fractions of the range window
    values  c_p P_p(d_p), complex128 (n_rows, n);  beside  c_p Q_p(d_p + d) at some delays d, (n_rows, n, n_beside)
    """

    delays: np.ndarray
    values: np.ndarray
    beside: np.ndarray
    _known: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, n_rows: int, n: int, n_beside: int) -> RowsInPhase:
        """Rows that see no pixel yet."""
        zeros = np.zeros((n_rows, n, n_beside), np.complex128)
        return cls(np.zeros((n_rows, n)), zeros[..., 0].copy(), zeros)

    def add(self, row: int, inside: np.ndarray, delays: np.ndarray, values: np.ndarray, beside: np.ndarray) -> None:
        """Contributions of a row.

        inside  whether it sees each pixel (n,);  delays  d_p (n,)
        values, beside  c_p P_p(d_p) and c_p Q_p(d_p + d) of the pixels that it sees, (m,) and (m, n_beside)
        """
        self.delays[row] = delays
        self.values[row, inside] = values
        self.beside[row, inside] = beside

    def ratio(self, length: int = 0) -> float:
        """Largest norm of N_m over the pixels at any d, relative to the pixels themselves, for m = -1, 0, 1.

        length  L of the profiles of a plan; 0: for m = 0 alone, which stands for lines and sub-apertures too

        The pixels count with the larger of their norm and that of the same contributions with random phases, as they
        do for a tolerance.
        """
        if length not in self._known:
            images = np.array([0, length, -length] if length else [0])
            turns = np.exp(2j * np.pi * ((self.delays[..., None] * images) % 1))  # (n_rows, n, images)
            sums = self.beside.transpose(1, 2, 0) @ turns.transpose(1, 0, 2)
            power = float((np.abs(sums) ** 2).sum(axis=0).max())
            self._known[length] = float(np.sqrt(power / self._power))
        return self._known[length]

    @cached_property
    def _power(self) -> float:
        """Of the pixels."""
        in_phase = float((np.abs(self.values.sum(axis=0)) ** 2).sum())
        power = float((np.abs(self.values) ** 2).sum())
        return max(in_phase, power, FAINTEST * float((np.abs(self.beside) ** 2).sum()))
