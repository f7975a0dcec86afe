"""Runs a line of OpenCL on arrays, so that one function of kernels/*.clh can be tested alone."""

from __future__ import annotations

import numpy as np

from sarcl.opencl import programs


def probe(device, monkeypatch, body, inputs, n_out, headers=("common.clh", "doubleword.clh"), **macros):
    """Run `body` on VW lanes of every input at once; returns (n_out, n) float32."""
    lanes = device.info.vector_width
    n = -(-inputs.shape[1] // lanes) * lanes
    padded = np.ones((len(inputs), n), np.float32)
    padded[:, : inputs.shape[1]] = inputs
    text = "".join(f'#include "{h}"\n' for h in headers) + (
        "__kernel void probe(__global const float *x, __global const float *table, int n, __global float *out) {\n"
        f"    int i = get_global_id(0);\n    {body}\n}}\n"
    )
    placed(monkeypatch, "probe.cl", text)
    table = macros.pop("table", None)
    built = device._build("probe.cl", {"VW": lanes, "FP64": int(device.info.fp64), **macros})["probe"]
    buffer = device.upload(padded)
    weights = device.upload(np.zeros(1, np.float32) if table is None else table)
    out = device.zeros(4 * n_out * n)
    device.run(built, (n // lanes,), None, buffer, weights, n, out)
    return device.download(out, np.empty((n_out, n), np.float32))[:, : inputs.shape[1]]


def placed(monkeypatch, name, text):
    """OpenCL source text in place of the file kernels/<name>, with its #include lines expanded."""
    expanded = programs.source.__wrapped__

    def source(file):
        if file != name:
            return expanded(file)
        return "\n".join(expanded(line.split('"')[1]) if "#include" in line else line for line in text.split("\n"))

    for module in ("device", "launch_numbers"):
        monkeypatch.setattr(f"sarcl.opencl.{module}.source", source)
