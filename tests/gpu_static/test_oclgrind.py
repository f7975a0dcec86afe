"""Kernels under Oclgrind, a simulator that finds accesses outside of memory, races and reads of what nobody wrote."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from gpu_static.oclgrind_task import NAMES

OPTIONS = [
    "--build-options", "-cl-opt-disable",  # optimised code has instructions that Oclgrind 21.10 does not know
    "--uninitialized", "--data-races", "--local-mem-size", str(48 * 1024), "--max-errors", "20",
]  # fmt: skip
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("oclgrind") is None, reason="oclgrind is not installed: apt-get install oclgrind"),
]


def under_oclgrind(log: Path, *command: str) -> subprocess.CompletedProcess[str]:
    """Run Python under Oclgrind, which writes what it finds to `log`."""
    environment = {k: v for k, v in os.environ.items() if k not in ("SARCL_DEVICE", "OCL_ICD_VENDORS")}
    return subprocess.run(
        ["oclgrind", *OPTIONS, "--log", str(log), sys.executable, *command], env=environment, capture_output=True,
        text=True, timeout=900,
    )  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_found_in_a_task_whose_result_is_right(name, tmp_path):
    log = tmp_path / "log"
    done = under_oclgrind(log, str(Path(__file__).with_name("oclgrind_task.py")), name)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    found = log.read_text() if log.exists() else ""
    assert not found.strip(), found[:3000]


def test_a_kernel_with_three_mistakes_is_found_out(tmp_path):
    code = """
import numpy as np, pyopencl as cl
context = cl.Context(cl.get_platforms()[0].get_devices())
queue = cl.CommandQueue(context)
text = '''__kernel void bad(__global float *out, __global const float *given) {
    __local float shared[4];
    shared[0] = get_local_id(0);
    out[get_global_id(0)] = given[get_global_id(0)] + shared[0];
    if (get_global_id(0) == 3) out[5] = 1;
}'''
kernel = cl.Program(context, text).build().bad
out, given = (cl.Buffer(context, cl.mem_flags.READ_WRITE, 16) for _ in range(2))
kernel(queue, (4,), (4,), out, given)
queue.finish()
"""
    log = tmp_path / "log"
    done = under_oclgrind(log, "-c", code)
    assert done.returncode == 0, done.stderr
    found = log.read_text().lower()
    assert "invalid write of size 4" in found and "race" in found and "uninitialized value" in found, found
