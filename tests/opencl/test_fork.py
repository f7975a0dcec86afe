"""A forked process says why it cannot compute, instead of waiting for a driver without threads."""

import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import sarcl
from sarcl.opencl.choose_device import open_device

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="a system without fork")
WORDS = "before this process was forked"


def said_by_a_child(work):
    """What a forked process raises in `work`; it is ended after 20 s."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(20)
        said = "nothing"
        try:
            work()
        except BaseException as exc:
            said = f"{type(exc).__name__}: {exc}"
        os.write(writing, said.encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as file:
        said = file.read()
    assert os.waitpid(child, 0)[1] == 0
    return said


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_child_of_a_process_that_used_opencl_is_told_so_and_the_parent_goes_on():
    device = open_device()
    for work in (
        lambda: sarcl.devices(),
        lambda: open_device(),
        lambda: device.upload(np.zeros(4)),
        lambda: sarcl.beam(sarcl.AntennaArray.linear(3, spacing=0.01), 1e10, times=[0.0], positions=[[1e3, 0, 0]]),
    ):
        said = said_by_a_child(work)
        assert said.startswith("RuntimeError") and WORDS in said and "spawn" in said
    assert device.download(device.upload(np.arange(4.0)), np.zeros(4)).tolist() == [0, 1, 2, 3]


def test_a_process_that_forks_before_it_uses_opencl_computes_in_the_child():
    text = """
        import os, sys, sarcl
        if os.fork():
            sys.exit(os.wait()[1])
        array = sarcl.AntennaArray.linear(3, spacing=0.01)
        sarcl.beam(array, 1e10, times=[0.0], positions=[[1e3, 0, 0]])
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(text)], check=True, timeout=60)
