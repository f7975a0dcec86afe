"""How long the plan of spectral_echo may take: a few seconds, or as long as `echo` would take in all."""

from __future__ import annotations

from ...base.errors import NotApplicable
from ...base.text import duration
from ...numerics import cost_model

PLANNED = 5.0  # s, in any case


class PlanningTime:
    """Seconds that steps of a plan are expected to take, added up before each is taken.

    The steps transform responses as long as the scatterers are seen, at the interval of the pulses: a track of few
    pulses far from the scene, close to one another, has millions of these.
    """

    def __init__(self, n_pulses: int, echo_seconds: float, longest: float | None = None) -> None:
        """echo_seconds  that `echo` would take;  longest  s, default PLANNED or what `echo` takes."""
        self._n_pulses, self._echo = n_pulses, echo_seconds
        self._longest = max(PLANNED, echo_seconds) if longest is None else longest
        self._spent = 0.0

    @classmethod
    def of_echo(
        cls,
        n_pulses: int,
        n_scatterers: int,
        n_samples: int,
        n_polarizations: int,
        of_facets: bool,
        longest: float | None = None,
    ) -> PlanningTime:
        """No longer than `echo` takes for points or facets."""
        each = cost_model.ECHO_FACET if of_facets else cost_model.ECHO_POINT
        pulse = cost_model.ECHO_PULSE + cost_model.ECHO_SAMPLE * n_samples + each * n_scatterers
        return cls(n_pulses, 1e-6 * n_pulses * n_polarizations * pulse, longest)

    def spend(self, samples: float, n_lags: int) -> None:
        """Take a step that transforms so many samples, of responses over n_lags pulse intervals.

        NotApplicable where this plan would take longer than `echo`.
        """
        self._spent += 1e-6 * cost_model.SPECTRAL_PLANNED * samples
        if self._spent > self._longest:
            raise NotApplicable(
                f"scatterers are seen over {n_lags} pulse intervals, of which the track has {self._n_pulses}; to plan "
                f"their transforms would take spectral_echo more than {duration(self._spent)}, and echo takes about "
                f"{duration(self._echo)} in all: use echo"
            )
