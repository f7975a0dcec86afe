"""How long the plan of spectral_echo may take: a few seconds, or as long as `echo` would take in all."""

from __future__ import annotations

import functools
from collections.abc import Callable

from ...base.errors import NotApplicable
from ...base.text import duration
from ...numerics import cost_model

PLANNED = 5.0  # s, in any case


class PlanningTime:
    """Seconds that steps of a plan are expected to take, added up before each is taken.

    The steps transform responses as long as the scatterers are seen, at the interval of the pulses: a track of few
    pulses far from the scene, close to one another, has millions of these.
    """

    def __init__(self, n_pulses: int, echo_seconds: Callable[[], float], longest: float | None = None) -> None:
        """echo_seconds  that `echo` would take;  longest  s, default PLANNED or what `echo` takes."""
        self._n_pulses, self._echo_seconds, self._longest = n_pulses, functools.cache(echo_seconds), longest
        self._spent = 0.0

    def spend(self, samples: float, n_lags: int) -> None:
        """Take a step that transforms so many samples, of responses over n_lags pulse intervals.

        NotApplicable where this plan would take longer than `echo`.
        """
        self._spent += 1e-6 * cost_model.SPECTRAL_PLANNED * samples
        if self._spent <= (PLANNED if self._longest is None else self._longest):
            return
        if self._longest is not None or self._spent > self._echo_seconds():
            raise NotApplicable(
                f"scatterers are seen over {n_lags} pulse intervals, of which the track has {self._n_pulses}; to plan "
                f"their transforms would take spectral_echo more than {duration(self._spent)}, and echo takes about "
                f"{duration(self._echo_seconds())} in all: use echo"
            )
