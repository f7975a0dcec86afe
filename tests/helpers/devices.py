"""Which devices tests run on: every working one, and twins of it that compile other branches of the kernels."""

from __future__ import annotations

import functools
from dataclasses import replace

import pytest

from sarcl.opencl.choose_device import REMEDY, open_device
from sarcl.opencl.device import Device, Limits
from sarcl.opencl.device_list import devices

# Methods that make each twin, as far as they change a device. The first twin compiles, together with the device itself,
# each branch of the kernels' #if VW and #if FP64; the others change one of the two alone.
TWINS = {
    "simplest": ("one_lane", "without_fp64"),
    "no-fp64": ("without_fp64",),
    "one-lane": ("one_lane",),
}
ALONE = ("no-fp64", "one-lane")  # the twins that run with -m slow only


def variants(names=TWINS, slow=ALONE, fp64=False):
    """Parameters of a fixture that hands each to `opened`: every working device, and its twins of these names.

    slow  twins that run with `-m slow` only;  fp64  keep what has float64 only
    """
    found = []
    for info in devices():
        if not info.works or (fp64 and not info.fp64):
            continue
        changes = {"one_lane": info.vector_width > 1, "without_fp64": info.fp64 and not fp64}
        made = {(): ""}
        for name in names:
            made.setdefault(tuple(method for method in TWINS[name] if changes[method]), f"-{name}")
        for methods, name in made.items():
            marks = [pytest.mark.slow] if name[1:] in slow else []
            found.append(pytest.param((info.index, methods), id=f"{info.index}-{info.kind}{name}", marks=marks))
    return found or [pytest.param(None, id="none")]


@functools.cache
def opened(param):
    """The open device of a parameter. Tests share it, so that each kernel is built once per process."""
    if param is None:
        pytest.fail(f"no OpenCL device works. {REMEDY}")
    index, methods = param
    device = open_device(index)
    for method in methods:
        device = getattr(device, method)()
    return device


@functools.cache
def as_gpu(device, **limits):
    """A device of its own that runs all that a GPU runs: one lane, reikna's FFT, uploads beside the computation.

    limits  fields of Limits: what it does at a time
    """
    return Device(replace(device.info, kind="gpu", vector_width=1), device._raw, Limits(**limits))
