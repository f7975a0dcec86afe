"""A folder with a file of echoes for each of several tracks: a killed run is continued, other jobs are refused.

FOLDER holds track_0000.h5, track_0001.h5 and so on, in the order of the tracks, and job.json with the fingerprints of
what the samples follow from: those of all tracks, written before the first file, and that of each file's track.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...base.errors import confirm_tolerance
from ...base.fingerprint import checksum, kernels, leaves
from ...base.types import PathLike
from ...base.version import __version__
from ...io import output_paths
from ...model import store
from ...model.phase_history import PhaseHistory
from ...model.trajectory import Trajectory
from ...model.waveform import Waveform
from ...scene.scene import Scene
from ..echo_options import EchoOptions

log = logging.getLogger(__name__)

JOB = "job.json"
# options that change no sample, or are those of a track
RUN = ("out", "device", "progress", "max_bytes", "check", "receiver", "resume", "tile", "cluster")


class TrackFiles:
    """The files of several tracks in a folder.

    files  their paths, in the order of the tracks
    The constructor creates the folder and writes job.json. NotADirectoryError where `folder` is a file,
    FileNotFoundError where it would lie in a folder that is missing, ValueError where it holds files of another job.
    """

    def __init__(self, folder: PathLike, job: Mapping[str, str], tracks: Sequence[str]) -> None:
        """job  fingerprints of what all tracks share;  tracks  that of each"""
        self.folder = output_paths.place(folder)
        parent = self.folder.parent
        if self.folder.exists() and not self.folder.is_dir():
            raise NotADirectoryError(
                f"out is {str(folder)!r}, a file; echoes of several tracks go to a folder: give the name of one"
            )
        if not parent.is_dir():
            raise FileNotFoundError(f"out is {str(folder)!r}, and there is no folder {str(parent)!r}; create it")
        names = [f"track_{i:04d}.h5" for i in range(len(tracks))]
        self.files = [self.folder / name for name in names]
        self._sign(dict(job), dict(zip(names, tracks, strict=True)))

    def finished(self, file: Path) -> PhaseHistory | None:
        """The echoes of a file that is complete; None where there is none, or it is damaged. ToleranceMissed as when
        they were computed."""
        if not file.exists():
            return None
        try:
            raw = store.read(file)
        except (ValueError, OSError) as exc:
            log.warning("%s is computed again: %s", file, exc)
            return None
        assert isinstance(raw, PhaseHistory)
        confirm_tolerance(raw=raw)
        return raw

    def _sign(self, job: dict[str, str], tracks: dict[str, str]) -> None:
        """Write job.json with these tracks too. ValueError where it is of another job, or files are of none."""
        path, stored = self.folder / JOB, dict[str, str]()
        if path.exists():
            there = self._read(path)
            stored = there.pop("tracks", {})
            other = [f"another {name}" for name, value in job.items() if there.get(name) != value]
            self._refuse(f"the echoes of another job ({', '.join(other)})" if other else "")
        for name, own in tracks.items():
            if name in stored and stored[name] != own:
                self._refuse(f"{name}, the echoes of another track")
            if name not in stored and (self.folder / name).exists():
                self._refuse(f"{name}, which this job did not write")
        self.folder.mkdir(exist_ok=True)
        with output_paths.atomic(path) as part:
            part.write_text(json.dumps({**job, "tracks": {**stored, **tracks}}, indent=1) + "\n")

    def _read(self, path: Path) -> dict[str, Any]:
        try:
            there = json.loads(path.read_text())
            dict(there["tracks"])
        except (ValueError, KeyError, TypeError):
            self._refuse(f"{JOB}, which is damaged")
        return dict(there)

    def _refuse(self, what: str) -> None:
        """ValueError where the folder holds something that must not be overwritten."""
        if what:
            raise ValueError(
                f"out is {str(self.folder)!r}, which holds {what}; give the arguments of that job to continue it, or "
                "the name of another folder"
            )


def job_of(scene: Scene, waveform: Waveform, options: EchoOptions) -> dict[str, str]:
    """Fingerprints of what the samples of all tracks follow from. TypeError for an option that has none."""
    named = {name: getattr(options, name) for name in options.__dataclass_fields__ if name not in RUN}
    return {
        "sarcl": f"{__version__}, kernels {kernels()}",
        "scene": checksum(*leaves(scene)),
        "waveform": checksum(*leaves(waveform)),
        "options": checksum(*(leaf for name in sorted(named) for leaf in (name, *leaves(named[name])))),
    }


def fingerprint_of(track: Trajectory, receiver: Trajectory | None) -> str:
    """Fingerprint of the antennas of one track."""
    return checksum(*leaves(track), *leaves(receiver))
