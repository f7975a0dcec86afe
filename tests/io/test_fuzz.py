"""Fuzzing: files of every format that is read, mutated. Each is read right, or refused in words that name the file.

`make fuzz` runs the long part: SARCL_FUZZ_CASES mutations per format (10000), from SARCL_FUZZ_SEED on (random). A
failure gives the number of its case: `SARCL_FUZZ_SEED=123 SARCL_FUZZ_CASES=1` repeats it.
"""

import hashlib
import logging
import os
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers import fuzz
from helpers.scenario_cases import SCENARIO
from scipy.io import savemat

import sarcl
from sarcl.scenario import scenario

pytestmark = pytest.mark.skipif(not hasattr(os, "fork") or not Path("/proc/self/statm").exists(), reason="Linux alone")
QUICK = 40  # mutations per format
BOX = trimesh.creation.box((1, 2, 3))
STATE = """<OSV><UTC>UTC=2021-12-23T05:{0:02d}:00.000000</UTC><X unit="m">7071000.{0}</X><Y unit="m">{0}000.0</Y>
<Z unit="m">0.5</Z><VX unit="m/s">0.1</VX><VY unit="m/s">7500.0</VY><VZ unit="m/s">{0}.5</VZ></OSV>"""


def raw_file(path):
    y = np.linspace(-5, 5, 12)
    tx = np.stack([0 * y, y, 0 * y + 1e3], axis=1)
    samples = np.exp(1j * np.arange(12 * 9)).reshape(12, 9).astype(np.complex64)
    sarcl.PhaseHistory(
        samples, frequency=9e9, frequency_step=1e6, tx=tx, reference_range=np.linalg.norm(tx, axis=1),
        polarization=["HH"] * 12, array=sarcl.AntennaArray.linear(3, spacing=0.01),
        waveform=sarcl.Waveform.chirp(center=9e9, bandwidth=9e6, duration=1e-6),
    ).save(path)  # fmt: skip


def image_file(path):
    grid = sarcl.ImageGrid.plane(shape=(6, 4), spacing=0.1)
    sarcl.Image(np.arange(24, dtype=np.complex64).reshape(6, 4), grid, gain=2.0).save(path)


def gotcha_file(path):
    angle = np.arange(4) * 1e-4
    tx = np.stack([7089 * np.cos(angle), 7089 * np.sin(angle), np.full(4, 7275.0)]).astype(np.float32)
    data = {
        "fp": np.ones((6, 4), np.complex64), "freq": (9e9 + 1e6 * np.arange(6))[:, None], "x": tx[0], "y": tx[1],
        "z": tx[2], "r0": np.linalg.norm(tx, axis=0),
    }  # fmt: skip
    savemat(path, {"data": data})


def mesh_file(path, kind=None, **how):
    made = BOX.export(file_type=kind or path.suffix[1:], **how)
    path.write_bytes(made.encode() if isinstance(made, str) else made)


# name of the file: what writes it, what reads it
FORMATS = {
    "raw.h5": (raw_file, sarcl.read),
    "image.h5": (image_file, sarcl.read),
    "gotcha.mat": (gotcha_file, sarcl.read),
    "binary.stl": (mesh_file, sarcl.Scene.from_mesh),
    "text.stl": (lambda path: mesh_file(path, "stl_ascii"), sarcl.Scene.from_mesh),
    "binary.ply": (mesh_file, sarcl.Scene.from_mesh),
    "text.ply": (lambda path: mesh_file(path, encoding="ascii"), sarcl.Scene.from_mesh),
    "mesh.off": (mesh_file, sarcl.Scene.from_mesh),
    "mesh.obj": (mesh_file, sarcl.Scene.from_mesh),
    "mesh.glb": (mesh_file, sarcl.Scene.from_mesh),
    "mesh.dae": (mesh_file, sarcl.Scene.from_mesh),
    "scenario.toml": (lambda path: path.write_text(SCENARIO), scenario.load),
    "orbit.EOF": (
        lambda path: path.write_text(
            "<Earth_Explorer_File><Ref_Frame>EARTH_FIXED</Ref_Frame>"
            + "".join(STATE.format(i) for i in range(12)) + "</Earth_Explorer_File>"
        ),
        sarcl.Orbit.read,
    ),
}  # fmt: skip


def digest(value):
    """A checksum of an object, its arrays and their types included."""
    found = hashlib.sha256()

    def add(part):
        if is_dataclass(part) and not isinstance(part, type):
            for field in fields(part):
                found.update(field.name.encode())
                add(getattr(part, field.name))
        elif hasattr(part, "dtype") and hasattr(part, "shape"):
            rows = np.asarray(part[...])
            found.update(f"{rows.dtype} {rows.shape}".encode() + rows.tobytes())
        elif isinstance(part, (list, tuple)):
            for one in part:
                add(one)
        else:
            found.update(repr(part).encode())

    add(value)
    return found.hexdigest()


def fuzzed(folder, name, cases):
    """Read mutated files of a format. Only sarcl's own files have checksums: others may be other data."""
    write, read = FORMATS[name]
    write(folder / name)
    whole = (folder / name).read_bytes()
    try:
        wanted = digest(read(folder / name))
    except ValueError:  # the states of an orbit need not be those of a satellite
        wanted = ""

    def judge(case):
        path = folder / f"mutated-{name}"
        path.write_bytes(fuzz.mutated(whole, case))
        try:
            found = digest(read(path))
        except BaseException as exc:
            return fuzz.refusal(exc, path.name)
        return "right" if found == wanted else "other data"

    logging.disable(logging.CRITICAL)
    try:
        found = fuzz.outcomes(cases, judge)
    finally:
        logging.disable(logging.NOTSET)
    print(f"{name}: {len(cases)} mutations from {cases.start}: {dict(found)}")
    allowed = {"right", "refused"} | (set() if name.endswith(".h5") else {"other data"})
    assert not set(found) - allowed, f"{name}, cases from {cases.start}: {dict(found)}"


@pytest.mark.parametrize("name", FORMATS)
def test_mutated_files_are_read_right_or_refused(tmp_path, name):
    fuzzed(tmp_path, name, range(QUICK))


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_many_mutated_files_are_read_right_or_refused(tmp_path, name):
    start = int(os.environ.get("SARCL_FUZZ_SEED") or int.from_bytes(os.urandom(5), "little"))
    fuzzed(tmp_path, name, range(start, start + int(os.environ.get("SARCL_FUZZ_CASES", "300"))))


def test_the_harness_sees_crashes_hangs_and_errors_without_a_name():
    def judge(case):
        if case == 1:
            os.abort()
        if case == 3:
            os.kill(os.getpid(), 14)  # SIGALRM, as after PATIENCE
        return fuzz.refusal(KeyError("x") if case == 4 else ValueError("no name"), "a.h5") if case > 3 else "right"

    found = fuzz.outcomes(range(6), judge)
    assert found == {
        "right": 2, "crashed by signal 6: case 1": 1, "hung: case 3": 1, "bare KeyError: 'x'": 1,
        "nameless ValueError: no name": 1,
    }  # fmt: skip
    assert fuzz.mutated(b"0123456789", 5) == fuzz.mutated(b"0123456789", 5) != fuzz.mutated(b"0123456789", 6)
