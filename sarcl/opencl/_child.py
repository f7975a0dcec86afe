"""Python code in a child process, which a driver that crashes or hangs ends alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress

PATIENCE = 60.0  # s for a child: trials with empty caches of kernels take 5 s on a busy machine
Variables = dict[str, str | None]  # of an environment; None: unset


def run(
    code: str, *arguments: str, environment: Variables | None = None, patience: float = PATIENCE
) -> tuple[str, str]:
    """Output of Python code in a child process, and how the child was ended; "" where it ended by itself.

    environment  variables that differ from those of this process
    patience     s, after which the child is ended
    """
    variables = {k: v for k, v in {**os.environ, **(environment or {})}.items() if v is not None}
    if not sys.executable or getattr(sys, "frozen", False):
        return "", "this program is no Python that can be started again"
    command, pipe = [sys.executable, "-c", code, *arguments], subprocess.PIPE
    with subprocess.Popen(command, env=variables, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe) as child:
        try:
            output, errors = child.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            child.kill()
            return child.communicate()[0].decode(errors="replace"), f"no answer within {patience:g} s"
    lines = errors.decode(errors="replace").strip().splitlines()
    words = next((line for line in lines if "error" in line.lower()), lines[-1] if lines else "")
    end = f"exit status {child.returncode}"
    with suppress(ValueError):
        end = signal.Signals(-child.returncode).name
    return output.decode(errors="replace"), f"{end}, {words:.160}".strip(", ") if child.returncode else ""


@contextmanager
def empty_caches() -> Iterator[Variables]:
    """Variables for a child whose caches of kernels are empty."""
    with tempfile.TemporaryDirectory(prefix="sarcl-trial-") as folder:
        yield {"XDG_CACHE_HOME": folder, "POCL_CACHE_DIR": folder, "PYOPENCL_NO_CACHE": "1"}
