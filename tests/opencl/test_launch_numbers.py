"""Structs by value: every number arrives where its name says, on every device; other names are refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.kernel_probe import placed

from sarcl.opencl import launch_numbers as module
from sarcl.opencl.launch_numbers import launch_numbers
from sarcl.opencl.programs import source

PROBE = """
typedef struct {
    int a, b;  // a comment; with a semicolon
    float eye[3];
    ulong far;
    int last;
    float ratio;
} probe_numbers;

__kernel void probe(probe_numbers given, __global float *out) {
    size_t i = get_global_id(0);
    out += 8 * i;
    out[0] = given.a;
    out[1] = given.b;
    vstore3(vload3(0, given.eye), 0, out + 2);
    out[5] = (float)(given.far >> 32);
    out[6] = given.last;
    out[7] = given.ratio;
}
"""
VALUES = {"last": -3, "a": 1, "b": 2**31 - 1, "eye": [0.5, -1.5, 2.0], "far": 5 * 2**32 + 7, "ratio": 0.25}
KERNELS = sorted(path.name for path in (Path(__file__).parents[2] / "kernels").glob("*.cl"))
KERNEL = re.compile(r"__kernel\s+(?:__attribute__\(\(.*?\)\)\s+)?void\s+(\w+)\s*\((.*?)\)\s*\{", re.S)
STRUCT = re.compile(r"typedef struct \{[^}]*\} (\w+_numbers);")


@pytest.fixture
def probe(monkeypatch):
    placed(monkeypatch, "probe.cl", PROBE)
    module.struct_layout.cache_clear()
    yield
    module.struct_layout.cache_clear()


def test_every_number_arrives_where_its_name_says(device, probe):
    given = launch_numbers("probe.cl", "probe", **VALUES)
    assert given.nbytes == 40
    out = device.zeros(4 * 8 * 3)
    device.run(device._build("probe.cl", {})["probe"], (3,), None, given, out)
    wanted = [1, np.float32(2**31 - 1), 0.5, -1.5, 2, 5, -3, 0.25]
    assert np.array_equal(device.download(out, np.empty((3, 8), np.float32)), np.tile(np.float32(wanted), (3, 1)))


def test_other_names_and_numbers_that_do_not_fit_are_refused(probe):
    with pytest.raises(TypeError, match=re.escape("probe_numbers of probe.cl: missing ['a'], unknown ['c']")):
        launch_numbers("probe.cl", "probe", **{**{k: v for k, v in VALUES.items() if k != "a"}, "c": 1})
    with pytest.raises(OverflowError):
        launch_numbers("probe.cl", "probe", **{**VALUES, "b": 2**31})
    with pytest.raises(TypeError, match=re.escape("kernels/probe.cl has no `typedef struct { ... } other_numbers;`")):
        launch_numbers("probe.cl", "other")


def test_every_struct_has_the_same_size_and_places_on_the_device(device, monkeypatch):
    """Sizes and the places of the members of every kernel's numbers: a device's compiler lays structs out by itself."""
    layouts, text, body = [], "", ""
    for file in KERNELS:
        for struct in STRUCT.finditer(source(file)):
            layout, name = module.struct_layout(file, struct[1]), f"{file[:-3]}_{struct[1]}"
            text += struct[0].replace(f" {struct[1]};", f" {name};") + "\n"
            body += f"    {{ {name} s; *out++ = sizeof(s);"
            body += "".join(f" *out++ = (char *)&s.{member} - (char *)&s;" for member in layout.names) + " }\n"
            layouts.append(layout)
    assert len(layouts) > 20
    wanted = [n for layout in layouts for n in (layout.itemsize, *(layout.fields[name][1] for name in layout.names))]
    placed(monkeypatch, "places.cl", f"{text}__kernel void places(__global int *out) {{\n{body}}}\n")
    out = device.empty(4 * len(wanted))
    device.run(device._build("places.cl", {})["places"], (1,), (1,), out)
    assert device.download(out, np.empty(len(wanted), np.int32)).tolist() == wanted


@pytest.mark.parametrize("file", KERNELS)
def test_a_kernel_takes_few_numbers_by_their_place(file):
    """More come in a struct, by name: two numbers that change places are no error of a compiler."""
    text = re.sub(r"//.*|^#.*$", "", source(file), flags=re.M)
    for name, arguments in re.findall(
        r"__kernel\s+(?:__attribute__\(\(.*?\)\)\s+)?void\s+(\w+)\s*\((.*?)\)\s*\{", text, re.S
    ):
        numbers = [a for a in arguments.split(",") if re.fullmatch(r"\s*(int|uint|ulong|float|double)\s+\w+\s*", a)]
        assert len(numbers) <= 4, f"{name} of kernels/{file} takes {numbers}"


def test_a_launch_of_too_few_or_many_arguments_is_refused(device):
    """PoCL ends the process where it is given an argument that the kernel does not have."""
    device._counts.clear()  # a kernel's first launch is checked
    kernel, buffer = device.kernel("assemble_image.cl", "untile"), device.zeros(64)
    for given in ([buffer], [np.int32(1)] * 9):
        with pytest.raises(TypeError, match=f"untile takes 4 arguments, not {len(given)}"):
            device.run(kernel, (16, 1), None, *given)
        device._counts.clear()
