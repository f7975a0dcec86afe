"""One run of a command: its printed lines, progress bar, output files, and its interruption by Ctrl-C or SIGTERM."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Any

from ..base.progress import Bar
from ..base.types import PathLike
from ..io import formats, output_paths

Outputs = dict[str, tuple[int, int] | None]


def identity(path: PathLike) -> tuple[int, int] | None:
    """Inode and time of a file, which change when another file replaces it; None where there is no file."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def complete(outputs: Outputs) -> list[str]:
    """The output paths that hold a new file. Files are put in place whole, so these are complete."""
    return [path for path, before in outputs.items() if identity(path) not in (None, before)]


class Job:
    """Used as `with Job(outputs) as job`; outputs gets the `identity` each output path has before the work.

    Ctrl-C raises KeyboardInterrupt at once, except while an output file is begun or put in its place: then the next
    report of progress or printed line raises it. The same happens where Python drops the exception, in a destructor or
    a callback of a C library; an error that follows from that becomes a KeyboardInterrupt too. SIGTERM, with which
    batch systems end a job, does the same. The argument of the KeyboardInterrupt is the number of the signal.
    """

    def __init__(self, outputs: Outputs) -> None:
        self.outputs = outputs
        self.bar = Bar()
        self.interrupted = 0  # number of the signal
        self._before: dict[int, Any] = {}
        self._hook = sys.unraisablehook

    def __enter__(self) -> Job:
        # Left alone: processes in which Ctrl-C is ignored (nohup, background jobs), programs that handle it themselves.
        for number, default in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_DFL)):
            if signal.getsignal(number) is default:
                try:
                    self._before[number] = signal.signal(number, self._interrupt)
                except ValueError:  # not the main thread, where no signal arrives
                    return self
        if self._before:
            sys.unraisablehook = self._unraisable
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.bar.wipe()
        for number, before in self._before.items():
            signal.signal(number, before)
        if self._before:
            sys.unraisablehook = self._hook
        if kind is not None:
            self.check()

    def check(self) -> None:
        """Raise KeyboardInterrupt where a signal has arrived."""
        if self.interrupted:
            raise KeyboardInterrupt(self.interrupted)

    def progress(self, stage: str, done: int, total: int) -> None:
        """The progress callback of verbs: draws the bar, and raises a KeyboardInterrupt that is due."""
        self.check()
        self.bar(stage, done, total)

    def say(self, text: str) -> None:
        """Print a line; the bar is removed before."""
        self.check()
        self.bar.wipe()
        print(text, flush=True)

    def expect(self, path: PathLike, n_bytes: int = 0) -> None:
        """Register an output path of at least n_bytes; raises what `formats.check_writable` raises where it cannot
        be written."""
        formats.check_writable(path, n_bytes)
        self.outputs[str(path)] = identity(path)

    def expect_named(self, paths: list[str], among: list[formats.Format], inputs: list[str], n_bytes: int = 0) -> None:
        """Refuse outputs that cannot be written, that are inputs, or that are named twice."""
        sources = {Path(p).resolve() for p in inputs}
        for path in paths:
            if Path(path).resolve() in sources:
                raise ValueError(f"output {path!r} is also read by this command; choose another name")
            if formats.named(path, among) is None and formats.added(path) is None:
                endings = formats.suggested(among)
                raise ValueError(f"output {path!r} {formats.ending_of(path)}; choose a name that ends in {endings}")
            self.expect(path, n_bytes)
        if len({Path(p).resolve() for p in paths}) < len(paths):
            raise ValueError(f"outputs {', '.join(paths)} name one file twice")

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.interrupted = number
        while frame is not None:
            if frame.f_code.co_filename in output_paths.FILES:
                return  # a file is being begun or put in its place, which must not be interrupted
            frame = frame.f_back
        raise KeyboardInterrupt(number)

    def _unraisable(self, unraisable: sys.UnraisableHookArgs) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._hook(unraisable)
