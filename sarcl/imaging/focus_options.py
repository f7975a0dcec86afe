"""Options that the verbs which make images share: their records contain these."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from ..base.options import option
from ..numerics.run_options import RunOptions
from ..numerics.windows import Window


@dataclass(frozen=True, eq=False, kw_only=True)
class FocusOptions(RunOptions):
    """Options of every verb that makes an image."""

    window: Window | None = option(
        None,
        'None, "hamming", ("taylor", sidelobe_db, nbar), another name of scipy.signal.windows, such as "hann" or '
        '("kaiser", 8.6): over samples and over rows; or a pair (range, cross-range) of these, of None, or of arrays '
        "with a weight per sample and per row of a channel. In cross-range with a beam that leaves pixels out: over the "
        "aperture of each pixel, the rows that see it",
    )
    weights: ArrayLike | None = option(None, "one per row (n_rows,), multiplied with window and raw.weight")
