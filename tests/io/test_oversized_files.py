"""Files that ask for far more memory than they have bytes: refused, in little memory."""

from __future__ import annotations

import subprocess
import sys

import pytest

import sarcl

MOST_MEMORY = 256e6  # bytes beyond the size of the file

READ = """
import re, sys
from pathlib import Path
import numpy, sarcl
from sarcl.io import elevation, orbit_files
from sarcl.model import store
try:
    import rasterio
except ImportError:
    pass

def peak(): return int(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]) * 1024

def heights(path): return sarcl.ElevationModel.read(path, heights="ellipsoid")

readers = {".EOF": sarcl.Orbit.read, ".vrt": heights}
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
    "a count of 5000 digits": (f'<List_of_OSVs count="{"9" * 5000}"/><OSV/>', "announces"),
    "a count in other digits": ('<List_of_OSVs count="²"/><OSV/>', "announces"),
}


@pytest.mark.parametrize("kind", ORBITS)
def test_an_orbit_file_that_announces_other_counts_is_refused(tmp_path, kind):
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
