"""Echoes of several tracks over one scene: a plan of echo for each track, so that none depends on the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...base.errors import ToleranceMissed, warned_together
from ...base.forecast import Forecast, Plan
from ...base.rows import spread_over
from ...base.validation import instance
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene.scene import Scene
from ..echo_options import EchoOptions
from ._track_files import TrackFiles, fingerprint_of, job_of

FORECAST = 8  # tracks that are forecast, of more than these: planning one takes as long as an eighth of its echoes

OneTrack = Callable[[Scene, Waveform, Trajectory, EchoOptions], Plan[PhaseHistory]]


@dataclass(frozen=True, eq=False)
class EchoesOfTracks:
    """Echoes of several tracks to be computed: a Plan of the list of their phase histories.

    one        plans the echoes of one track;  receivers  one for each track, None: monostatic
    options    of all tracks, without receiver and output;  out  the folder of their files, None: memory
    """

    one: OneTrack
    scene: Scene
    waveform: Waveform
    tracks: tuple[Trajectory, ...]
    receivers: tuple[Trajectory | None, ...]
    options: EchoOptions
    out: object

    @classmethod
    def of(
        cls, one: OneTrack, scene: Scene, waveform: Waveform, track: Sequence[Trajectory], options: EchoOptions
    ) -> EchoesOfTracks:
        """The plan of these arguments; options.receiver is a list too. TypeError and ValueError name what is wrong."""
        if not track:
            raise ValueError("track is an empty list; give at least one sarcl.Trajectory")
        instance("scene", scene, Scene)
        instance("waveform", waveform, Waveform)
        for i, one_track in enumerate(track):
            instance(f"track[{i}]", one_track, Trajectory)
        if options.tile is not None:
            raise ValueError("tile is for one track; of a list, give each run its own tracks and folder")
        receivers = cls._receivers(options.receiver, len(track))
        return cls(
            one, scene, waveform, tuple(track), receivers, replace(options, receiver=None, out=None), options.out
        )

    @staticmethod
    def _receivers(tracks: object, n: int) -> tuple[Trajectory | None, ...]:
        if tracks is None:
            return (None,) * n
        if not isinstance(tracks, (list, tuple)):
            raise TypeError(
                f"receiver is a {type(tracks).__name__}, and track is a list of {n}; give a list of as many receivers"
            )
        if len(tracks) != n:
            raise ValueError(f"receiver is a list of {len(tracks)} tracks, and track of {n}; give one for each track")
        for i, receiver in enumerate(tracks):
            instance(f"receiver[{i}]", receiver, Trajectory)
        return tuple(tracks)

    def plan_of(self, i: int, out: Path | None = None) -> Plan[PhaseHistory]:
        """The plan of the echoes of track number i."""
        own = replace(self.options, receiver=self.receivers[i], out=out)
        return self.one(self.scene, self.waveform, self.tracks[i], own)

    def forecast(self) -> Forecast[list[PhaseHistory]]:
        """Its Forecast: of up to FORECAST tracks along the list, and of the others by their numbers of pulses.

        Where not all are planned, the predicted error is the tolerance, which bounds those of all.
        """
        n = len(self.tracks)
        sample = spread_over(n, FORECAST)
        with warned_together("tracks"):
            parts = [self.plan_of(i).forecast() for i in sample]
        lengths = [len(track) for track in self.tracks]
        share = sum(lengths) / sum(lengths[i] for i in sample)
        worst = max(parts, key=lambda part: part.predicted_error)
        return Forecast(
            method=worst.method,
            plan={**worst.plan, "tracks": n},
            seconds=share * sum(part.seconds for part in parts),
            bytes=share * sum(part.bytes for part in parts),
            predicted_error=worst.predicted_error if len(sample) == n else self.options.tolerance,
            error_terms=worst.error_terms if len(sample) == n else (),
            n_rows=round(share * sum(part.n_rows or 0 for part in parts)),
            n_samples=max(part.n_samples or 0 for part in parts),
            planning=sum(part.planning for part in parts),
            run=self.run,
        )

    def run(self) -> list[PhaseHistory]:
        """The echoes of all tracks. An exception names the track that it is of, and has the echoes before as `raws`.

        ToleranceMissed of one, or several, is raised when all are finished, with the list of all as its `raws`. What is
        warned of for several tracks is said once, when all are finished.
        """
        with warned_together("tracks"):
            return self._all_echoes()

    def _all_echoes(self) -> list[PhaseHistory]:
        files = None
        if self.out is not None:
            tracks = [fingerprint_of(*ends) for ends in zip(self.tracks, self.receivers, strict=True)]
            files = TrackFiles(self.out, job_of(self.scene, self.waveform, self.options), tracks)  # type: ignore[arg-type]
        echoes, missed = list[PhaseHistory](), None
        for i in range(len(self.tracks)):
            try:
                echoes.append(self._echoes(i, files))
            except ToleranceMissed as exc:
                assert exc.raw is not None
                echoes.append(exc.raw)
                missed = missed or exc
            except BaseException as exc:
                exc.raws = echoes  # type: ignore[attr-defined]  # what is finished is not lost
                exc.add_note(f"track[{i}], of a list of {len(self.tracks)}; `raws` has the echoes of those before it")
                raise
        if missed is not None:
            missed.raws = echoes
            raise missed
        return echoes

    def _echoes(self, i: int, files: TrackFiles | None) -> PhaseHistory:
        if files is None:
            return self.plan_of(i).run()
        finished = None if self.options.resume is False else files.finished(files.files[i])
        return self.plan_of(i, files.files[i]).run() if finished is None else finished
