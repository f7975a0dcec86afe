"""Libraries in another environment: a process that answers through a pipe, kept alive so that runs can alternate."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.threads import threads
from ._cases import BenchCase
from ._competitor import Absent, Competitor, Reading

SCRIPT = Path(__file__).with_name("fastsar_peer.py")
PATIENCE = 1800.0  # s for one answer

# Every setting that changes speed or error; other settings were tried and are dominated by these.
EXACT = [("linear", 4), ("linear", 8), ("linear", 16), ("cubic", 4), ("cubic", 8), ("cubic", 16)]
FACTORIZED: list[dict[str, Any]] = [{}, {"T": 16}, {"levels": 2}, {"pmax": 0.6}]


def environment() -> dict[str, str]:
    """Environment with as many threads as CPU devices get, as fastsar's page says; variables that are set stay."""
    return {
        "OMP_NUM_THREADS": str(threads()),
        "OMP_PLACES": "cores",
        "OMP_PROC_BIND": "close",
        "PYTHONNOUSERSITE": "1",
    } | dict(os.environ)


def check_python(path: str | None) -> str:
    """The interpreter to use, this one by default; ValueError where there is none at `path`."""
    import shutil

    if path is None:
        return sys.executable
    program = shutil.which(path)
    if program is None:
        raise ValueError(
            f"--peer-python {path!r} is no program; give the path of a Python that has the peer, such as env/bin/python"
        )
    return program


class Peer:
    """A running peer with `name`, `version` and `python`. Use as a context; `load` a case, then `run`.

    Absent where the interpreter lacks the library or does not run. `load` starts a peer again that has ended.
    """

    def __init__(self, python: str) -> None:
        self.command = [python, str(SCRIPT)]
        self.folder: Path | None = None
        self._start()

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()

    def load(self, folder: Path) -> None:
        """Load the case saved in `folder`."""
        self.folder = folder
        if self.process.poll() is not None:
            self._stop()
            self._start()
        self._answer({"do": "load", "folder": str(folder)})

    def run(self, spec: dict[str, Any]) -> dict[str, Any]:
        """An image: {"seconds": {"setup", "form", "cpu"}, "values"}; Absent with its last output if it ends."""
        if self.process.poll() is not None and self.folder is not None:
            self.load(self.folder)
        return self._answer({"do": "run", "spec": spec})

    def once(self, spec: dict[str, Any]) -> float:
        """Seconds of a whole new process that reads the case and makes one image."""
        command = [*self.command, "once", str(self.folder), json.dumps(spec)]
        start = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, env=environment())
        seconds = time.perf_counter() - start
        if done.returncode:
            raise Absent(f"the process ended with {done.returncode}: {done.stderr.strip()[-400:]}")
        return seconds

    def _start(self) -> None:
        self.stderr = tempfile.TemporaryFile("w+", errors="replace")
        try:
            self.process = subprocess.Popen(
                self.command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self.stderr,
                text=True,
                env=environment(),
            )
        except OSError as exc:
            self.stderr.close()
            raise Absent(f"{self.command[0]} does not run: {exc.strerror}") from None
        try:
            hello = self._read()
        except Absent:
            self._stop()
            raise
        if "missing" in hello:
            self._stop()
            raise Absent(hello["missing"])
        self.name, self.version, self.python = hello["name"], hello["version"], hello["python"]

    def _stop(self) -> None:
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout, self.stderr):
            try:
                stream.close()  # type: ignore[union-attr]
            except OSError:  # data not flushed to a peer that has ended
                pass

    def _answer(self, request: dict[str, Any]) -> dict[str, Any]:
        try:
            self.process.stdin.write(json.dumps(request) + "\n")  # type: ignore[union-attr]
            self.process.stdin.flush()  # type: ignore[union-attr]
        except OSError:
            pass  # the process has ended: reading gives its last output
        answer = self._read()
        if "error" in answer:
            raise Absent(answer["error"])
        return answer

    def _read(self) -> dict[str, Any]:
        late = threading.Timer(PATIENCE, self.process.kill)
        late.start()
        try:
            line = self.process.stdout.readline()  # type: ignore[union-attr]
        finally:
            late.cancel()
        try:
            answer = json.loads(line)
            if not isinstance(answer, dict):
                raise ValueError
            return answer
        except ValueError:
            if line:  # the program is not a peer, and may not end by itself
                self.process.kill()
            code = self.process.wait()
            self.stderr.seek(0)
            reply = " ".join((line + self.stderr.read()).split())[-400:] or "nothing said"
            raise Absent(f"{Path(self.command[0]).name} ended with {code}: {reply}") from None


def competitors(case: BenchCase, peer: Peer, methods: Sequence[str], backend: str = "cpu") -> list[Competitor]:
    """fastsar's formers with the settings above; `peer` has the case loaded."""
    others = []
    if "direct" in methods:
        for interp, upsample in EXACT:
            spec = {"former": "exact", "options": {"interp": interp, "upsample": upsample, "backend": backend}}
            others.append(_competitor(peer, "direct", f"{interp}, {upsample} x", spec, backend))
    if "factorized" in methods:
        for options in FACTORIZED:
            spec = {"former": "factorized", "options": {**options, "backend": backend}}
            words = ", ".join(f"{k} {v}" for k, v in options.items()) or "default"
            others.append(_competitor(peer, "factorized", words, spec, backend))
    return others


def _competitor(peer: Peer, method: str, setting: str, spec: dict[str, Any], backend: str) -> Competitor:
    def run() -> Reading:
        answer = peer.run(spec)
        seconds = answer["seconds"]
        values = np.array(answer["values"]).reshape(-1, 2)
        form = seconds["form"]
        timed = {"call": seconds["setup"] + form, "form": form}
        if backend == "cpu":
            timed["cpu"] = seconds["cpu"]
        return Reading(values[:, 0] + 1j * values[:, 1], timed)

    return Competitor(f"{peer.name} {peer.version}", backend, method, setting, run, lambda: peer.once(spec))
