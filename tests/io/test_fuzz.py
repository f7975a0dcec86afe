"""Fuzzing: files of every format that is read, mutated. Each is read right, or refused in words that name the file.

`make fuzz` runs the long part: SARCL_FUZZ_CASES mutations per format (10000), from SARCL_FUZZ_SEED on (random,
printed). The slow tests read the same 300 of each format each time, so that a failure is due to the change under test.
A failure gives the number of its case: `SARCL_FUZZ_SEED=123 SARCL_FUZZ_CASES=1` repeats it. Inputs that fail are also
saved under SARCL_FUZZ_CORPUS, by default tests/io/corpus/FORMAT: what lies there is read again by the quick tests.
"""

import hashlib
import logging
import os
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from helpers import fuzz
from helpers.cases import SCENARIO
from scipy.io import savemat

import sarcl
from sarcl.experiments.fda import file as experiment
from sarcl.scenario import scenario

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork") or not Path("/proc/self/statm").exists(), reason="Linux alone"),
    pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning"),  # within sarkit
]
QUICK = 40  # mutations per format
BOX = trimesh.creation.box((1, 2, 3))
STATE = """<OSV><UTC>UTC=2021-12-23T05:{0:02d}:00.000000</UTC><X unit="m">{1}</X><Y unit="m">{2}</Y>
<Z unit="m">{3}</Z><VX unit="m/s">{4}</VX><VY unit="m/s">{5}</VY><VZ unit="m/s">{6}</VZ></OSV>"""


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


def netcdf_file(path):
    pytest.importorskip("h5netcdf", reason="no h5netcdf: pip install sarcl[xarray]")
    image_file(path)


def gotcha_file(path):
    angle = np.arange(4) * 1e-4
    tx = np.stack([7089 * np.cos(angle), 7089 * np.sin(angle), np.full(4, 7275.0)]).astype(np.float32)
    data = {
        "fp": np.ones((6, 4), np.complex64), "freq": (9e9 + 1e6 * np.arange(6))[:, None], "x": tx[0], "y": tx[1],
        "z": tx[2], "r0": np.linalg.norm(tx, axis=0),
    }  # fmt: skip
    savemat(path, {"data": data})


def raster_file(path):
    rasterio = pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    driver = {".tif": "GTiff", ".asc": "AAIGrid"}[path.suffix]
    made = path.with_name("made.tif")
    with rasterio.open(
        made, "w", driver="GTiff", height=6, width=5, count=1, dtype="float32", crs="EPSG:4326", nodata=-9999,
        transform=rasterio.Affine(0.001, 0, 12, 0, -0.001, 42), compress="deflate" if driver == "GTiff" else None,
    ) as file:  # fmt: skip
        file.write(np.linspace(100, 900, 30, dtype="float32").reshape(1, 6, 5))
    if driver == "GTiff":
        made.replace(path)
    else:
        from rasterio.shutil import copy

        copy(made, path, driver=driver)
        made.unlink()
        prj = path.with_suffix(".prj")  # the CRS lies beside the heights, also beside mutated ones
        prj.with_name(f"mutated-{prj.name}").write_bytes(prj.read_bytes())


def virtual_raster_file(path):
    raster_file(path.with_name("beside.tif"))
    path.write_text(VIRTUAL)


def product_source():
    """Echoes of 5 short chirps of an aircraft, Earth-fixed, and metadata that products need."""
    pytest.importorskip("sarkit", reason="no sarkit: pip install sarcl[formats]")
    tx = sarcl.wgs84.ecef(8.5, 47.2 + 1e-6 * np.arange(5.0), 6e3)
    center = sarcl.wgs84.ecef(8.4, 47.2, 420.0)
    raw = sarcl.PhaseHistory(
        np.exp(1j * np.arange(5 * 9)).reshape(5, 9).astype(np.complex64), frequency=9.596e9, frequency_step=1e6, tx=tx,
        reference_range=np.linalg.norm(tx - center, axis=1), time=1e-3 * np.arange(5), polarization=["VH"] * 5,
        tx_velocity=np.gradient(tx, 1e-3, axis=0), rx_velocity=np.gradient(tx, 1e-3, axis=0),
        waveform=sarcl.Waveform.chirp(center=9.6e9, bandwidth=9e6, duration=1e-6),
    )  # fmt: skip
    return raw, {**PRODUCT, "SRPPos": center}


def cphd_file(path):
    raw, words = product_source()
    raw.save(path, metadata=words, domain="TOA" if path.name.startswith("toa") else "FX")


def crsd_file(path):
    raw, words = product_source()
    raw.save(path, metadata={**words, **CRSD})


def sicd_file(path):
    raw, words = product_source()
    grid = sarcl.ImageGrid.plane(center=words["SRPPos"], shape=(4, 3), normal=words["SRPPos"] / 6.37e6, spacing=20.0)
    image = sarcl.backproject(raw, grid)
    image.save(path, collection=raw, metadata={n: words[n] for n in PRODUCT if n != "ReleaseInfo"})


def map_file(path):
    pytest.importorskip("rasterio", reason="no rasterio: pip install sarcl[maps]")
    grid = sarcl.ImageGrid.on_map("EPSG:32633", bounds=(291000, 4641000, 291010, 4641012), spacing=2.0, heights=HILL)
    data = np.exp(1j * np.arange(np.prod(grid.shape))).reshape(grid.shape).astype(np.complex64)
    sarcl.Image(data, grid, gain=2.0, time=[0.0, 1.0], frequency=9.6e9).save(path)


def orbit_file(path):
    made = sarcl.Orbit.kepler(7.07e6, 0.001, 1.7, span=(-60, 720))
    states = [(i, *made.positions(60.0 * i).round(3), *made.velocities(60.0 * i).round(6)) for i in range(12)]
    text = "".join(STATE.format(*state) for state in states)
    path.write_text(f"<Earth_Explorer_File><Ref_Frame>EARTH_FIXED</Ref_Frame>{text}</Earth_Explorer_File>")


def read_heights(path):
    return sarcl.ElevationModel.read(path, heights="ellipsoid")


def mesh_file(path, kind=None, **how):
    made = BOX.export(file_type=kind or path.suffix[1:], **how)
    path.write_bytes(made.encode() if isinstance(made, str) else made)


EXPERIMENT = """\
[fda]
title = "Widths"
n = 45
frequency_step = 20e6
center = 10e9
distance = 5000.0
points = [0.0, 2.0]
mappings = ["unmodified", "corrected"]

[[case]]
name = "first"
squint_deg = 10.0

[[case]]
progression = "planar"
n = [9, 5]
frequency_step = [20e6, 1e6]
mappings = ["channels"]

[sweep]
aperture = [100.0, 430.0]
"""
PRODUCT = {
    "CollectorName": "sarcl", "CoreName": "targets", "ModeType": "SPOTLIGHT", "Classification": "UNCLASSIFIED",
    "ReleaseInfo": "UNRESTRICTED", "CollectionStart": "2026-01-02T03:04:05.250000",
}  # fmt: skip
CRSD = {"TxRefRadIntensity": 1e6, "TxRadIntErrorStdDev": 0.1, "TxRefLAtm": 0.2, "RcvRefIrradiance": 1e-9}
HILL = 90 + np.arange(30.0).reshape(6, 5)  # m
CRSD |= {"RcvIrradianceErrorStdDev": 0.1, "RcvRefLAtm": 0.2, "PNCRSD": 1e-3, "BNCRSD": 0.9}
VIRTUAL = """\
<VRTDataset rasterXSize="5" rasterYSize="6"><SRS>EPSG:4326</SRS>
<GeoTransform>12, 0.001, 0, 42, 0, -0.001</GeoTransform>
<VRTRasterBand dataType="Float32" band="1"><NoDataValue>-9999</NoDataValue><SimpleSource>
<SourceFilename relativeToVRT="1">beside.tif</SourceFilename><SourceBand>1</SourceBand>
<SrcRect xOff="0" yOff="0" xSize="5" ySize="6"/><DstRect xOff="0" yOff="0" xSize="5" ySize="6"/>
</SimpleSource></VRTRasterBand></VRTDataset>
"""
FIRST = 564578582964  # case of the slow tests, where SARCL_FUZZ_CASES asks for no others
CHECKED = ".h5", ".nc"  # files with checksums
CORPUS = Path(os.environ.get("SARCL_FUZZ_CORPUS") or Path(__file__).parent / "corpus")

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
    "experiment.toml": (lambda path: path.write_text(EXPERIMENT), experiment.load),
    "heights.tif": (raster_file, read_heights),
    "heights.asc": (raster_file, read_heights),
    "heights.vrt": (virtual_raster_file, read_heights),
    "orbit.EOF": (orbit_file, sarcl.Orbit.read),
    "map.tif": (map_file, sarcl.read),
    "pass.cphd": (cphd_file, sarcl.read),
    "toa.cphd": (cphd_file, sarcl.read),
    "pass.crsd": (crsd_file, sarcl.read),
    "image.nitf": (sicd_file, sarcl.read),
    "image.nc": (netcdf_file, sarcl.read),
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
            rows = np.asarray(part[:] if part.shape else part)
            found.update(f"{rows.dtype} {rows.shape}".encode() + rows.tobytes())
        elif isinstance(part, (list, tuple)):
            for one in part:
                add(one)
        else:
            found.update(repr(part).encode())

    add(value)
    return found.hexdigest()


def kept(name, data):
    """Save an input that failed, by its checksum, so that later runs read it again."""
    folder = CORPUS / name
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{hashlib.sha256(data).hexdigest()[:16]}{Path(name).suffix}").write_bytes(data)


def fuzzed(folder, name, cases):
    """Read mutated files of a format. Only sarcl's own files have checksums: others may be other data."""
    write, read = FORMATS[name]
    write(folder / name)
    whole = (folder / name).read_bytes()
    wanted = digest(read(folder / name))

    def judge(case):
        path = folder / f"mutated-{name}"
        path.write_bytes(fuzz.mutated(whole, case))
        try:
            found = digest(read(path))
        except BaseException as exc:
            return fuzz.refusal(exc, path.name)
        return "right" if found == wanted else "other data"

    allowed = {"right", "refused"} | (set() if name.endswith(CHECKED) else {"other data"})
    logging.disable(logging.CRITICAL)
    try:
        found = fuzz.outcomes(cases, judge, lambda case, said: said in allowed or kept(name, fuzz.mutated(whole, case)))
    finally:
        logging.disable(logging.NOTSET)
    print(f"{name}: {len(cases)} mutations from {cases.start}: {dict(found)}")
    assert not set(found) - allowed, f"{name}, cases from {cases.start}: {dict(found)}"


@pytest.mark.parametrize("name", FORMATS)
def test_mutated_files_are_read_right_or_refused(tmp_path, name):
    fuzzed(tmp_path, name, range(QUICK))


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_many_mutated_files_are_read_right_or_refused(tmp_path, name):
    wanted = os.environ.get("SARCL_FUZZ_CASES")
    seed = os.environ.get("SARCL_FUZZ_SEED") or (int.from_bytes(os.urandom(5), "little") if wanted else FIRST)
    start = int(seed)
    fuzzed(tmp_path, name, range(start, start + int(wanted or 300)))


def saved_inputs():
    return sorted(p.relative_to(CORPUS).as_posix() for p in CORPUS.glob("*/*") if p.parent.name in FORMATS)


@pytest.mark.parametrize("path", saved_inputs())
def test_inputs_that_have_failed_are_read_right_or_refused(tmp_path, path):
    """Those that a run of `make fuzz` has saved. Each is read in a process of its own, which may crash or hang."""
    name = Path(path).parent.name
    write, read = FORMATS[name]
    write(tmp_path / name)  # with what lies beside it
    (tmp_path / f"mutated-{name}").write_bytes((CORPUS / path).read_bytes())

    def judge(_):
        try:
            read(tmp_path / f"mutated-{name}")
        except BaseException as exc:
            return fuzz.refusal(exc, f"mutated-{name}")
        return "read"

    found = fuzz.outcomes([0], judge)
    assert set(found) <= {"refused"} | (set() if name.endswith(CHECKED) else {"read"}), f"{path}: {dict(found)}"


def test_an_input_that_fails_is_saved_once_and_by_its_content(tmp_path, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "CORPUS", tmp_path / "corpus")

    def broken(path):
        if path.name.startswith("mutated"):
            raise KeyError("x")

    monkeypatch.setitem(FORMATS, "scenario.toml", (FORMATS["scenario.toml"][0], broken))
    for _ in range(2):
        with pytest.raises(AssertionError, match="bare KeyError"):
            fuzzed(tmp_path, "scenario.toml", range(3))
    saved = sorted((tmp_path / "corpus" / "scenario.toml").iterdir())
    wanted = {fuzz.mutated(SCENARIO.encode(), case) for case in range(3)}
    assert {path.read_bytes() for path in saved} == wanted and len(saved) == len(wanted)


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
