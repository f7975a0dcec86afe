"""The room opencl: choice of a device, errors, and programs that are built once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sarcl
from sarcl.base import float_pairs
from sarcl.base.threads import threads
from sarcl.fullwave.fields import Fields
from sarcl.fullwave.lattice import Lattice
from sarcl.fullwave.target import Target
from sarcl.opencl import fft, programs
from sarcl.opencl.choose_device import open_device
from sarcl.opencl.device import Device, Limits


def run_python(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True, text=True, timeout=100
    )


def test_every_working_device_gave_the_right_numbers_in_a_trial():
    working = [d for d in sarcl.devices() if d.works]
    assert working
    for info in working:
        assert info.why == "" and info.memory > 0 and info.max_alloc > 0 and info.vector_width in (1, 8)


def test_device_is_chosen_by_argument_then_environment_then_kind(monkeypatch):
    info = next(d for d in sarcl.devices() if d.works)
    assert open_device(info.index).info == info
    assert open_device(str(info.index)).info == info
    assert open_device(info.name[:12].upper()).info.name == info.name
    if info.platform == "Portable Computing Language":
        assert open_device("PoCL").info.platform == info.platform
    opened = open_device(info.kind)
    assert open_device(opened) is opened
    monkeypatch.setenv("SARCL_DEVICE", "no such thing")
    assert open_device(info.index).info == info
    with pytest.raises(sarcl.NoDeviceError, match="SARCL_DEVICE 'no such thing' matches no working"):
        open_device()
    monkeypatch.setenv("SARCL_DEVICE", "")
    best = open_device()
    if any(d.works and d.kind == "gpu" for d in sarcl.devices()):
        assert best.info.kind == "gpu"


def test_a_name_that_matches_nothing_lists_what_there_is():
    with pytest.raises(sarcl.NoDeviceError) as caught:
        open_device("abacus")
    assert "'abacus'" in str(caught.value)
    for info in sarcl.devices():
        assert info.name in str(caught.value)


def test_without_any_platform_the_remedy_is_named(tmp_path):
    code = (
        "import sarcl\nprint(sarcl.devices())\nsarcl.backproject.__module__\n"
        "from sarcl.opencl.choose_device import open_device\nopen_device()"
    )
    run = run_python(code, OCL_ICD_VENDORS=str(tmp_path))
    if "()" not in run.stdout:
        pytest.skip("this loader does not heed OCL_ICD_VENDORS")
    assert "NoDeviceError: no OpenCL device could build a kernel" in run.stderr
    assert "sarcl doctor says what is wrong and how to mend it" in run.stderr


def test_import_probes_no_device_and_loads_no_pyopencl():
    run = run_python("import sys, sarcl; print('pyopencl' in sys.modules, 'numpy' in sys.modules)")
    assert run.stdout.split() == ["False", "False"], run.stderr


def test_verbs_stay_verbs_after_their_modules_are_imported():
    code = (
        "import sarcl.imaging.backproject, sarcl.simulation.echo, sarcl.model.store, sarcl; "
        "print(callable(sarcl.echo), callable(sarcl.read))"
    )
    run = run_python(code)
    assert run.stdout.split() == ["True", "True"], run.stderr


def test_only_the_room_opencl_imports_pyopencl():
    package = Path(sarcl.__file__).parent
    guilty = [p for p in package.rglob("*.py") if "import pyopencl" in p.read_text() and p.parent.name != "opencl"]
    assert guilty == []


def test_kernels_are_built_once_for_each_set_of_macros(device):
    first = device.kernel("ray_casting.cl", "hidden")
    assert device.kernel("ray_casting.cl", "hidden") is first


def test_a_kernel_of_many_launches_is_told_the_types_of_its_numbers_and_gives_the_same_bits(device, monkeypatch):
    import pyopencl

    told, tell = [], pyopencl.Kernel.set_scalar_arg_dtypes

    def counted(kernel, types):
        told.append((kernel.function_name, [t and t.name for t in types]))
        return tell(kernel, types)

    monkeypatch.setattr(pyopencl.Kernel, "set_scalar_arg_dtypes", counted)
    grid, fields = Lattice(0.01, (3, 4, 16), np.zeros(3)), []
    start = np.random.default_rng(1).uniform(-1, 1, (2, 3, *grid.shape))
    for many in (10**9, 3):
        one = Device(device.info, device._raw, Limits(launches=many))
        run = Fields(one, grid, Target.nothing())
        run.start(*start)
        run.advance(8)
        fields.append(run.download())
    assert sorted(name for name, _ in told) == ["update_e", "update_h"]
    # one struct of numbers, then buffers
    assert all(types[0] == "void768" and set(types[1:]) == {None} for _, types in told)
    assert np.array_equal(*fields)


def test_includes_are_expanded_once_and_lines_point_at_the_files():
    text = programs.source("backproject.cl")
    assert "#include" not in text
    assert text.count('#line 1 "doubleword.clh"') == 1
    line = text.split("\n").index(
        "__kernel void backproject(backproject_numbers given, __global const float *restrict profiles,"
    )
    directive = max(i for i, t in enumerate(text.split("\n")[:line]) if t.startswith("#line"))
    number = int(text.split("\n")[directive].split()[1]) + line - directive - 1
    from importlib.resources import files

    original = files("sarcl.kernels").joinpath("backproject.cl").read_text().split("\n")
    assert original[number - 1].startswith("__kernel void backproject(")


def test_programs_are_given_only_the_macros_they_name(device, monkeypatch):
    import pyopencl

    given = []

    class Program(pyopencl.Program):
        def build(self, options):
            given.append(options)
            return super().build(options)

    monkeypatch.setattr(pyopencl, "Program", Program)
    device._build("ray_casting.cl", {"VW": device.info.vector_width, "FP64": 0, "TAPS": 4})
    assert [option for option in given[-1] if option != "-D_OPENCL_H_"] == []
    assert {"VW", "FP64", "TAPS"} <= programs.names_in(programs.source("backproject.cl"))
    # tests/visibility runs on no twin of a device: none would change these
    assert not {"VW", "FP64"} & programs.names_in(programs.source("ray_casting.cl"))


# a value of each macro that some program needs
MACROS = {
    "BISTATIC": 1, "BEAM": 1, "WRAP": 0, "TAPS": 8, "TERMS": 5, "RANGE": 1, "ORDER": 2, "LOCAL": 0, "CHUNK": 64,
    "VECTORS": 2, "SIDE": 16, "FINE": 2, "FINE_BITS": 1, "LINE_TAPS": 4, "LINE_TERMS": 4, "GROUP": 8, "SLOPE": 1,
    "DOUBLE": 0, "ROWS": 4, "USED": 4, "LANES": 8, "FLUSH": 64, "FILTER_TAPS": 8, "SPAN": 2, "FROM_CENTRE": 1,
    "NODES": 1, "PULSE_NODES": 1, "TILE": 32, "HH": 1, "HV": 1, "VH": 1, "VV": 1, "METAL": 0, "DISPERSIVE": 1,
    "ROUGH": 1, "DIAGRAM_ISOTROPIC": 0, "DIAGRAM_COS": 1, "DIAGRAM_COS2": 2, "DIAGRAM_EXP": 3,
    "GAINS": 1, "ALIKE": 0, "VARIES": 1, "CULL": 1, "SPREADING": 1, "SEGMENT": 64,
    "SHARED": 1, "ITEMS": 16, "SLOPE_TAPS": 2, "SLOPE_TERMS": 2, "ABSORB": 1, "LINEAR": 1, "WEIGHT": 1, "TAPER": 64,
    "FROM64": 0, "NUMBER64": 0, "GROUPED": 0, "ENDS": 2, "FORWARD": 1, "WAVES": 2, "PARTLY": 1, "SHADED": 1,
    "ROOM": 64, "PULSES": 16, "SUMS": 4, "NEAR": 2, "FACETS": 1, "COHERENT": 1, "PARTS": 4, "GRADIENT": 1,
    "CHANNELS": 0,
}  # fmt: skip
GROUPED = {"GROUPED": 1, "VW": 1, "TILE": 64}
GAINS = "row_gradients_float64.cl", {"WEIGHT": 2, "GAINS": 2}
SHARED = "nufft2d.cl", "spectral_echo.cl", "facet_amplitudes.cl", "spread_facets.cl", "spread_points.cl"
PROGRAMS = sorted(path.name for path in (Path(__file__).parents[2] / "kernels").glob("*.cl"))


@pytest.mark.parametrize(
    "file, other",
    [*((file, {}) for file in PROGRAMS), ("beam.cl", {"DOUBLE": 1}), GAINS, *((file, GROUPED) for file in SHARED)],
    ids=str,
)
def test_pocl_needs_the_short_header_alone(device, monkeypatch, file, other):
    if device.info.platform != programs.POCL:
        pytest.skip("not PoCL")
    if not device.info.fp64 and ("float64" in file or "DOUBLE" in other):
        pytest.skip("no float64")
    import pyopencl

    given = []

    class Program(pyopencl.Program):
        def build(self, options):
            given.append("-D_OPENCL_H_" in options)
            return super().build(options)

    monkeypatch.setattr(pyopencl, "Program", Program)
    assert device._build(file, {"VW": device.info.vector_width, "FP64": int(device.info.fp64), **MACROS, **other})
    assert given == [True]


def test_a_version_of_pocl_that_refuses_the_short_header_gets_the_text_alone(device, monkeypatch):
    if device.info.platform != programs.POCL:
        pytest.skip("needs PoCL")
    whole = programs.source
    monkeypatch.setattr(programs, "source", lambda file: "refused;" if file == "builtins.clh" else whole(file))
    assert "hidden" in device._build("ray_casting.cl", {})


def test_a_kernel_that_does_not_build_names_file_device_and_log(device, monkeypatch):
    monkeypatch.setattr("sarcl.opencl.device.source", lambda file: "__kernel void broken(int x) { y = 1; }")
    with pytest.raises(RuntimeError, match=r"kernels/broken.cl does not build on '.*'") as caught:
        device.kernel("broken.cl", "broken")
    assert "undeclared" in str(caught.value) or "error" in str(caught.value)


def test_a_buffer_larger_than_the_device_allows_says_need_have_and_remedy(device):
    need = device.info.max_alloc + 1
    with pytest.raises(MemoryError, match=r"allows .* per buffer; pass a smaller max_bytes"):
        device.empty(need)


def test_threads_follow_the_environment(monkeypatch):
    monkeypatch.setenv("SARCL_THREADS", "1")
    assert threads() == 1
    monkeypatch.setenv("SARCL_THREADS", "many")
    with pytest.raises(ValueError, match="SARCL_THREADS is 'many'"):
        threads()


def test_one_thread_gives_the_same_image_as_all(tmp_path):
    code = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parents[1])!r})\n"
        "from helpers.cases import noise_history\nimport sarcl\nfrom sarcl.opencl.choose_device import open_device\n"
        "image = sarcl.backproject(noise_history(), sarcl.ImageGrid.plane(shape=40, spacing=.2), device='cpu')\n"
        "print(open_device('cpu').queue.device.max_compute_units, complex(image.data.sum()))"
    )
    if not any(d.works and d.kind == "cpu" for d in sarcl.devices()):
        pytest.skip("no CPU device")
    all_threads, one = run_python(code), run_python(code, SARCL_THREADS="1")
    assert one.stdout.split()[0] == "1", one.stderr
    assert one.stdout.split()[1] == all_threads.stdout.split()[1]


@pytest.mark.parametrize("engine", ["scipy", "reikna"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 17), (5, 64), (2, 1000)])
def test_both_fft_engines_are_the_unnormalised_dft_of_rows(device, engine, shape):
    random = np.random.default_rng(0)
    data = (random.standard_normal(shape) + 1j * random.standard_normal(shape)).astype(np.complex64)
    for inverse in (False, True):
        wanted = np.fft.ifft(data) * shape[1] if inverse else np.fft.fft(data)
        rows = fft.reikna_rows(device, data, inverse) if engine == "reikna" else None
        got = fft.rows(None, data, inverse=inverse) if rows is None else rows
        assert got.dtype == np.complex64
        assert np.linalg.norm(got - wanted) <= 2e-6 * np.linalg.norm(wanted)


def test_wide_pairs_keep_48_bits():
    values = np.random.default_rng(0).uniform(-1, 1, 1000) * 8e5
    hi, lo = float_pairs.wide(values)
    assert np.abs(hi.astype(np.float64) + lo - values).max() <= 8e5 * 2.0**-48
