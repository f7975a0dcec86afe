"""The files of echoes that are computed in blocks: their output, and their finished tiles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from typing import Any

from ..base.fingerprint import checksum, kernels, leaves
from ..base.options import described
from ..base.types import PathLike
from ..base.version import __version__
from ..blocks.bands import Run
from ..blocks.block_job import BlockJob
from ..blocks.block_options import BlockOptions
from ..blocks.checkpoint import Checkpoint
from ..blocks.fill_bands import BandFiller
from ..model.phase_history import PhaseHistory
from .echo_output import EchoOutput

# options that change nothing, or nothing but rounding
OF_A_RUN = {"device", "cluster", "progress", "out", "resume", "tile", "max_bytes", "check"}


class EchoFiles:
    """The output of one run, and the tile files beside it, until the run ends.

    piece       (i, n): only that piece of the bands is computed, and the output is opened when all others are finished
    checkpoint  None where the samples go to memory
    """

    def __init__(
        self,
        stack: ExitStack,
        job: BlockJob,
        opened: Callable[[], EchoOutput],
        *,
        out: PathLike | None,
        resume: bool | None,
        piece: tuple[int, int] | None,
    ) -> None:
        """stack  ends with the run;  opened  opens the output: room is found before the work"""
        self._stack, self._opened, self.piece = stack, opened, piece
        self._output = None if piece else stack.enter_context(opened())
        self.checkpoint: Checkpoint | None = None
        if out is not None:
            self.checkpoint = Checkpoint(out, job, True if piece else resume)
            stack.push(self.checkpoint)

    def finished(self) -> PhaseHistory | None:
        """The echoes, where this is a piece of a job that is complete already."""
        raw = self.checkpoint.finished() if self.piece and self.checkpoint else None
        return raw if isinstance(raw, PhaseHistory) else None

    def output(self, filler: BandFiller, runs: Sequence[Run] | None = None) -> EchoOutput | None:
        """The output, to be filled; None for a piece while others are missing: its tiles are in files then.

        runs  of bands that pieces share, default all
        """
        if self.piece and not filler.fill_piece(self.piece, runs):
            return None
        if self._output is None:
            try:
                self._output = self._stack.enter_context(self._opened())
            except FileExistsError:  # another run is assembling the echoes from all tiles
                return None
        if self.checkpoint:
            self.checkpoint.begin()
        return self._output

    def finish(self, **fields: Any) -> PhaseHistory:
        """The PhaseHistory of the samples in the output, and of these fields; tiles are removed."""
        assert self._output is not None
        raw = self._output.finish(self.checkpoint.mark if self.checkpoint else None, **fields)
        if self.checkpoint:
            self.checkpoint.done()
        return raw


def job_description(
    options: BlockOptions, subjects: dict[str, object], shape: tuple[int, ...], named: Mapping[str, object]
) -> dict[str, Any]:
    """Everything that samples of a shape depend on, as text and numbers; arrays as checksums.

    subjects  scene, waveform, track;  named  options that have an entry of their own, as messages show them
    The device and its memory are left out: they change nothing but rounding. TypeError for an option that cannot be
    described.
    """
    values = {name: getattr(options, name) for name in described(type(options))}
    others = [name for name in sorted(values) if name not in OF_A_RUN and name not in named]
    return {
        "sarcl": f"{__version__}, kernels {kernels()}",
        **named,
        "samples": " x ".join(map(str, shape)),
        **{name: checksum(*leaves(subject)) for name, subject in subjects.items()},
        "options": checksum(*(leaf for name in others for leaf in (name, *leaves(values[name])))),
    }
