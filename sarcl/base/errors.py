"""Warnings and errors of the library, and where a warning points to."""

from __future__ import annotations

import os
import sys
import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..model.image import Image

# the folder of the whole package, wherever in it this file lies
_HERE = os.path.dirname(os.path.realpath(str(sys.modules[__name__.partition(".")[0]].__file__))) + os.sep


class SarclWarning(UserWarning):
    """Something the user should know about a result that is still right."""


def warn(text: str) -> None:
    """A SarclWarning that points at the line which called the library, however deep inside it is found."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back and os.path.realpath(frame.f_code.co_filename).startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, SarclWarning, stacklevel=level)


class ToleranceMissed(ValueError):
    """A finished image errs more than was asked, where it was checked: `image`, `tolerance`, `measured`."""

    def __init__(self, tolerance: float, measured: float, image: Image) -> None:
        super().__init__(
            f"tolerance {tolerance:.1e} was missed, {measured:.1e} measured: these data are worse than the error "
            f"formulas allow for; ask for {tolerance**2 / measured / 2:.1e}, and please report it (the image is kept: "
            "in its file, or in this error's .image)"
        )
        self.tolerance, self.measured, self.image = tolerance, measured, image
