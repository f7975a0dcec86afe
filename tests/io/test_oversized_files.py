"""Files that ask for far more memory than they have bytes, or for far more steps: refused, in little memory."""

from __future__ import annotations

import struct
import subprocess
import sys
import zlib

import pytest

import sarcl

MOST_MEMORY = 256e6  # bytes beyond the size of the file

READ = """
import re, sys
from pathlib import Path
import numpy, scipy.io, sarcl
from sarcl.io import elevation, orbit_files
from sarcl.model import store
try:
    import rasterio
except ImportError:
    pass

def peak(): return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) * 1024

def heights(path): return sarcl.ElevationModel.read(path, heights="ellipsoid")

readers = {".EOF": sarcl.Orbit.read, ".mat": sarcl.read, ".vrt": heights}
path = Path(sys.argv[1])
before = peak()
try:
    readers[path.suffix](path)
    said = "read"
except Exception as exc:
    said = f"{type(exc).__name__}: {exc}"
print(peak() - before, said.replace(chr(10), " "))
"""


def reading(path):
    """Bytes that a fresh process took for a file beyond the file's size, and what it said."""
    run = subprocess.run([sys.executable, "-c", READ, str(path)], capture_output=True, text=True, timeout=120)
    taken, _, said = run.stdout.partition(" ")
    return int(taken or 2**62) - path.stat().st_size, said or run.stderr[-300:]


# State vectors ---------------------------------------------------------------------------------------------

HEAD, END = "<Earth_Explorer_File><Data_Block><List_of_OSVs>", "</List_of_OSVs></Data_Block></Earth_Explorer_File>"
ORBITS = {
    "nested state vectors": ("<OSV>" * 300_000 + "</OSV>" * 300_000, "within one another"),
    "nested elements": ("<a>" * 400_000 + "</a>" * 400_000, "within one another"),
    "many elements": ("<a/>" * 3_000_000, "more than 500,000 elements"),
    "a number of a million digits": (
        "<OSV><UTC>UTC=2021-12-23T00:00:00</UTC><X>" + "1" * 1_000_000 + "x</X></OSV>", "of 1000001 characters",
    ),
    "a count of 5000 digits": (f'<List_of_OSVs count="{"9" * 5000}"/><OSV/>', "announces"),
    "a count in other digits": ('<List_of_OSVs count="²"/><OSV/>', "announces"),
}  # fmt: skip


@pytest.mark.parametrize("kind", ORBITS)
def test_an_orbit_file_that_takes_far_more_than_its_size_is_refused(tmp_path, kind):
    body, wanted = ORBITS[kind]
    path = tmp_path / "a.EOF"
    path.write_text(HEAD + body + END)
    taken, said = reading(path)
    assert said.startswith("ValueError: orbit file 'a.EOF'") and wanted in said[:300], said[:300]
    assert len(said) < 500
    assert taken < MOST_MEMORY


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_an_orbit_file_that_defines_entities_is_refused(tmp_path, encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?><!DOCTYPE a [<!ENTITY x "{"<OSV/>" * 50}">]>{HEAD}&x;&x;{END}'
    (tmp_path / "a.EOF").write_text(text, encoding)
    with pytest.raises(ValueError, match=r"orbit file 'a\.EOF' .*document type"):
        sarcl.Orbit.read(tmp_path / "a.EOF")


# Elevation models ------------------------------------------------------------------------------------------

RASTER = (
    '<VRTDataset rasterXSize="{n}" rasterYSize="{m}"><SRS>EPSG:4979</SRS>'
    "<GeoTransform>12, {step}, 0, 42, 0, -{step}</GeoTransform>"
    '<VRTRasterBand dataType="Float32" band="1"></VRTRasterBand></VRTDataset>'
)
SIZES = {"square": (2_000_000_000, 2_000_000_000), "line": (2_147_483_647, 2)}


@pytest.mark.parametrize("kind", SIZES)
def test_a_virtual_raster_of_far_more_points_than_bytes_is_refused(tmp_path, kind):
    pytest.importorskip("rasterio")
    n, m = SIZES[kind]
    (tmp_path / "a.vrt").write_text(RASTER.format(n=n, m=m, step=1e-9))
    taken, said = reading(tmp_path / "a.vrt")
    assert said.startswith(f"MemoryError: DEM 'a.vrt' has {m} x {n} points, more than 25,000,000; give bounds")
    assert taken < MOST_MEMORY


# MATLAB 5 --------------------------------------------------------------------------------------------------


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def array(class_code, dims, *parts, name=b"x"):
    """An array of a MATLAB 5 file: flags, dimensions, name, and the elements of its numbers or cells."""
    head = element(6, struct.pack("<II", class_code, 0)) + element(5, struct.pack("<II", *dims)) + element(1, name)
    return element(14, head + b"".join(parts))


def matlab(*elements):
    return b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"".join(elements)


def packed(count, kind):
    """A compressed array of `count` zeros, of the data type 2 (bytes) or 9 (doubles), which is never whole in memory
    here."""
    size = count * {2: 1, 9: 8}[kind]
    head = array(9, (count, 1), struct.pack("<II", kind, size))
    stream, left = zlib.compressobj(6), size + -size % 8
    out = stream.compress(head[:4] + struct.pack("<I", len(head) - 8 + left) + head[8:])
    while left:
        out, left = out + stream.compress(bytes(min(left, 2**20))), left - min(left, 2**20)
    out += stream.flush()
    return struct.pack("<II", 15, len(out)) + out


EMPTY = struct.pack("<II", 14, 0)
MATLAB = {
    "two of 320 MB": (lambda: matlab(*[packed(40_000_000, 9)] * 2), "unpacks to more than 8 times"),
    "many of 12 MB": (lambda: matlab(*[packed(1_500_000, 9)] * 25), "unpacks to more than 8 times"),
    "cells": (lambda: matlab(array(1, (3_000_000, 1), EMPTY * 3_000_000)), "more than 100,000 arrays"),
    "elements": (lambda: matlab(EMPTY * 3_000_000), "more than 100,000 arrays"),
    "numbers of a byte": (lambda: matlab(packed(15_000_000, 2)), "more than 2 numbers per byte"),
}


@pytest.mark.parametrize("kind", MATLAB)
def test_a_matlab_file_that_takes_far_more_than_its_size_is_refused(tmp_path, kind):
    path = tmp_path / "a.mat"
    data, wanted = MATLAB[kind]
    path.write_bytes(data())
    taken, said = reading(path)
    assert said.startswith("ValueError: a.mat ") and wanted in said, said
    assert taken < MOST_MEMORY
