"""What consecutive pulses see of facets, as kernels/spread_facets.cl reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..visibility.illumination import Span


@dataclass(eq=False)
class PulseLevels:
    """Consecutive pulses from `start` to `stop` - 1, and levels of facets, uint8 (k,), at some moments among them.

    A moment is the number of an array in `levels`.
    """

    start: int
    levels: list[np.ndarray] = field(default_factory=list)
    _moments: list[np.ndarray] = field(default_factory=list)
    _between: list[np.ndarray] = field(default_factory=list)

    @property
    def stop(self) -> int:
        """The pulse after the last."""
        return self.start + sum(len(part) for part in self._between)

    @property
    def moments(self) -> np.ndarray:
        """The moments around each pulse, int32 (n, 2)."""
        return np.concatenate(self._moments)

    @property
    def between(self) -> np.ndarray:
        """Where each pulse lies between its two moments, float32 (n,)."""
        return np.concatenate(self._between)

    def extend(self, span: Span, stop: int) -> int:
        """Take the pulses of a span up to stop - 1 too; returns `stop`."""
        pulses, which = np.arange(self.stop, stop), []
        for level in (span.level, span.later):
            if not self.levels or self.levels[-1] is not level:
                self.levels.append(level)
            which.append(len(self.levels) - 1)
        self._moments.append(np.tile(np.array(which, np.int32), (len(pulses), 1)))
        self._between.append(span.moments(pulses))
        return stop
