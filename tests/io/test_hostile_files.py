"""Files that are damaged or hostile: refused by name and in words; never a crash, never other data in silence."""

import io
import json
import os
import re
import socket
import subprocess
import sys
import time
import zipfile
import zlib

import h5py
import numpy as np
import pytest
import trimesh

import sarcl
from sarcl.cli.parser import main
from sarcl.figures import decibels
from sarcl.io import hdf5, output_paths, sarcl_hdf5
from sarcl.scenario import scenario

N, M = 300, 700
# behind the HDF5 file: text, its CRC-32 in 4 bytes, its length in 8, and this; a CRC for each MiB of rows, about
MAGIC, END, BLOCK_BYTES = b"sarcl checksums 1\n", 30, 2**20


def saved(path, n=N, m=M):
    y = np.linspace(-5, 5, n)
    tx = np.stack([0 * y, y, 0 * y + 1e3], axis=1)
    rng = np.random.default_rng(0)
    raw = sarcl.PhaseHistory(
        (rng.normal(size=(n, m)) + 1j).astype(np.complex64), frequency=9e9, frequency_step=1e6, tx=tx,
        reference_range=np.linalg.norm(tx, axis=1),
    )  # fmt: skip
    raw.save(path)
    return raw


def checksums_of(path):
    """Their text, behind an HDF5 file."""
    data = path.read_bytes()
    length = int.from_bytes(data[-len(MAGIC) - 8 : -len(MAGIC)], "little")
    return data[-END - length : -END]


def without_checksums(path):
    """As a file of an earlier version."""
    path.write_bytes(path.read_bytes()[: -END - len(checksums_of(path))])


def flipped(path, at, bit=0):
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << bit
    path.write_bytes(data)


# Checksums -------------------------------------------------------------------------------------------------


def test_damaged_rows_are_named_and_the_others_can_be_read(tmp_path):
    m = BLOCK_BYTES // (8 * 50)  # samples, so that a block has 50 rows
    raw = saved(tmp_path / "a.h5", m=m)
    with h5py.File(tmp_path / "a.h5") as file:
        start = file["samples"].id.get_offset()
    flipped(tmp_path / "a.h5", start + 8 * m * 120 + 5)
    found = sarcl.read(tmp_path / "a.h5")
    for rows in (slice(120, 121), slice(0, 300), slice(149, 90, -1), 120, [3, 120], (slice(100, 130), slice(2, 3))):
        with pytest.raises(OSError, match=r"a\.h5' is damaged: rows 100 to 149 of samples are not as they were"):
            found.samples[rows]
    with pytest.raises(OSError, match="rows 100 to 149"):
        np.asarray(found.samples)
    with pytest.raises(OSError, match="rows 100 to 149"):
        sarcl.backproject(found, sarcl.ImageGrid.plane(shape=8, spacing=0.1), tolerance=1e-2)
    for a, b in ((0, 100), (150, 300), (7, 8), (40, 60)):
        assert np.array_equal(found.samples[a:b], raw.samples[a:b])
    assert np.array_equal(found.samples[-1], raw.samples[-1])


def test_rows_in_any_order_get_the_checksums_of_what_was_written(tmp_path):
    m = BLOCK_BYTES // (8 * 4)  # columns, so that a block has 4 rows
    values = np.random.default_rng(1).normal(size=(2, 30, m)).astype(np.float32)
    values = values[0] + 1j * values[1]
    orders = {
        "in order": [(slice(a, a + 3), values[a : a + 3]) for a in range(0, 30, 3)],
        "backwards": [(slice(a, a + 3), values[a : a + 3]) for a in range(27, -1, -3)],
        "twice": [(slice(0, 30), -values), (slice(0, 30), values)],
        "by columns": [((slice(None), slice(j, j + m // 4)), values[:, j : j + m // 4]) for j in range(0, m, m // 4)],
        "row by row": [(i, values[i]) for i in range(30)],
        "of another type": [(slice(None), values.astype(np.complex128))],
        "in part": [(slice(4, 9), values[4:9])],
    }
    for name, writes in orders.items():
        wanted = np.zeros_like(values)
        with sarcl_hdf5.ImageWriter(tmp_path / "a.h5", {"shape": (30, m), "center": np.zeros(3)}) as out:
            for at, block in writes:
                out.data[at] = wanted[at] = block
            out.close({"gain": 1.0})
        rows = sarcl_hdf5.open_rows(tmp_path / "a.h5", "data")
        assert type(rows).__name__ == "CheckedRows", name
        assert np.array_equal(rows[:], wanted) and np.array_equal(rows[3:21:5], wanted[3:21:5]), name
        rows.file.close()


def test_rows_written_in_order_are_not_read_again_for_their_checksums(tmp_path, monkeypatch):
    rows = np.arange(BLOCK_BYTES // 8 * 5 // 2, dtype=np.complex64).reshape(-1, 8)
    each, reads, read = len(rows) // 7, [], h5py.Dataset.__getitem__
    monkeypatch.setattr(h5py.Dataset, "__getitem__", lambda dataset, at: reads.append(at) or read(dataset, at))
    for again in (False, True):
        with sarcl_hdf5.ImageWriter(tmp_path / "a.h5", {"shape": rows.shape, "center": np.zeros(3)}) as out:
            for first in range(0, len(rows), each):
                out.data[first : first + each] = rows[first : first + each]
            if again:
                out.data[3:4] = rows[3:4]
            out.close({"gain": 1.0})
        blocks = json.loads(checksums_of(tmp_path / "a.h5"))["blocks"]
        assert len(blocks) == 3 and blocks == [zlib.crc32(rows[a : a + 2**14]) for a in range(0, len(rows), 2**14)]
        assert len(reads) == again  # the block of row 3 alone


@pytest.mark.parametrize("name", ["tx", "frequency", "reference_range"])
def test_a_damaged_field_is_named(tmp_path, name):
    saved(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        at = file[name].id.get_offset()
    flipped(tmp_path / "a.h5", at + 3)
    with pytest.raises(ValueError, match=rf"a\.h5' is damaged: {name} is not as it was written; save or copy it again"):
        sarcl.read(tmp_path / "a.h5")


def test_every_byte_outside_the_rows_is_covered(tmp_path):
    saved(tmp_path / "a.h5", 4, 6)
    whole = (tmp_path / "a.h5").read_bytes()
    with h5py.File(tmp_path / "a.h5") as file:
        start, size = file["samples"].id.get_offset(), file["samples"].id.get_storage_size()
    for at in [*range(0, len(whole), 41), len(whole) - 1]:
        if start <= at < start + size:
            continue
        (tmp_path / "b.h5").write_bytes(whole)
        flipped(tmp_path / "b.h5", at, at % 8)
        with pytest.raises(ValueError, match=r"b\.h5"):
            sarcl.read(tmp_path / "b.h5")


def test_the_checksums_are_crc_32_of_the_bytes_of_whole_rows(tmp_path):
    raw = saved(tmp_path / "a.h5")
    found = json.loads(checksums_of(tmp_path / "a.h5"))
    data = raw.samples.tobytes()
    step = found["step"] * 8 * M
    wanted = [zlib.crc32(data[a : a + step]) for a in range(0, len(data), step)]
    assert found["blocks"] == wanted and len(wanted) == 2
    end = (tmp_path / "a.h5").read_bytes()[found["size"] :]
    assert json.loads(end[:-END]) == found and end.endswith(MAGIC)


def test_files_without_checksums_are_read_as_before_and_by_h5py_too(tmp_path):
    raw = saved(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["samples"][...], raw.samples)
    without_checksums(tmp_path / "a.h5")
    again = sarcl.read(tmp_path / "a.h5")
    assert type(again.samples) is h5py.Dataset and np.array_equal(again.samples[...], raw.samples)


def test_a_file_that_h5py_has_changed_is_read_without_checksums(tmp_path):
    raw = saved(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["note"] = "mine"
    assert np.array_equal(sarcl.read(tmp_path / "a.h5").samples[...], raw.samples)


# HDF5 that leads elsewhere --------------------------------------------------------------------------------


def leads_away(path, how):
    """A file of sarcl's whose positions lie in another file."""
    raw = saved(path)
    np.asarray(raw.tx).tofile(path.parent / "secret.bin")
    with h5py.File(path.parent / "other.h5", "w") as other:
        other["tx"] = raw.tx
    with h5py.File(path, "a") as file:
        del file["tx"]
        if how == "external storage":
            file.create_dataset("tx", (N, 3), "f8", external=[(str(path.parent / "secret.bin"), 0, 24 * N)])
        elif how == "virtual":
            layout = h5py.VirtualLayout((N, 3), "f8")
            layout[:] = h5py.VirtualSource(str(path.parent / "other.h5"), "tx", (N, 3))
            file.create_virtual_dataset("tx", layout)
        else:
            file["tx"] = h5py.ExternalLink(str(path.parent / "other.h5"), "/tx")
    return raw


@pytest.mark.parametrize("how", ["external storage", "virtual", "external link"])
def test_a_file_that_leads_into_another_is_refused_unless_allowed(tmp_path, how):
    raw = leads_away(tmp_path / "a.h5", how)
    with pytest.raises(ValueError, match=r"a\.h5' leads into another file: tx .*external=True"):
        sarcl.read(tmp_path / "a.h5")
    assert np.array_equal(sarcl.read(tmp_path / "a.h5", external=True).tx, raw.tx)


# Pipes and other files that are no regular files -----------------------------------------------------------


@pytest.mark.parametrize("kind", ["pipe", "socket", "folder", "missing"])
@pytest.mark.parametrize("reader", ["read", "mesh", "orbit", "scenario", "dem"])
def test_what_is_no_regular_file_is_said_to_be_none(tmp_path, kind, reader):
    if (reader, kind) == ("dem", "folder"):
        pytest.importorskip("rasterio")  # some formats are folders, which it alone knows
    path = tmp_path / {"mesh": "a.stl", "orbit": "a.EOF", "scenario": "a.toml", "dem": "a.tif"}.get(reader, "a.h5")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "socket":
        bound = socket.socket(socket.AF_UNIX)
        bound.bind(os.path.relpath(path))
    elif kind == "folder":
        path.mkdir()
    make = {
        "read": sarcl.read, "mesh": sarcl.Scene.from_mesh, "orbit": sarcl.Orbit.read, "scenario": scenario.load,
        "dem": sarcl.Scene.from_dem,
    }[reader]  # fmt: skip
    words = {"pipe": "is a pipe, wanted a regular file", "socket": "is a socket", "folder": "folder|no raster"}
    with pytest.raises((ValueError, OSError), match=words.get(kind, "does not exist")) as caught:
        make(path)
    assert path.name in str(caught.value)


# Meshes ----------------------------------------------------------------------------------------------------

BOX = trimesh.creation.box((1, 2, 3))
CUT = {
    "off": lambda text: "\n".join(text.splitlines()[:13]),
    "ply": lambda text: "\n".join(text.splitlines()[:-3]),
    "stl": lambda text: text[: text.rindex("endfacet") - 40],
}


@pytest.mark.parametrize("kind", CUT)
def test_a_mesh_that_is_cut_off_is_refused(tmp_path, kind):
    how = {
        "off": {"file_type": "off"},
        "ply": {"file_type": "ply", "encoding": "ascii"},
        "stl": {"file_type": "stl_ascii"},
    }
    text = BOX.export(**how[kind])
    text = text.decode() if isinstance(text, bytes) else text
    (tmp_path / f"a.{kind}").write_text(text)
    assert len(sarcl.Scene.from_mesh(tmp_path / f"a.{kind}").triangles) == 12
    (tmp_path / f"b.{kind}").write_text(CUT[kind](text))
    with pytest.raises(ValueError, match=rf"mesh file 'b\.{kind}'.*(declares 12 faces and holds|whole facets|read as)"):
        sarcl.Scene.from_mesh(tmp_path / f"b.{kind}")


@pytest.mark.parametrize("n", [11, 13, 2**31])
def test_a_binary_stl_of_another_length_is_refused(tmp_path, n):
    data = bytearray(BOX.export(file_type="stl"))
    data[80:84] = n.to_bytes(4, "little")
    (tmp_path / "a.stl").write_bytes(data)
    with pytest.raises(ValueError, match=rf"'a\.stl' declares {n} facets, \d+ bytes, and has 684 bytes"):
        sarcl.Scene.from_mesh(tmp_path / "a.stl")


@pytest.mark.parametrize("index", [8, -1, 2**30])
@pytest.mark.parametrize("kind", ["ply", "off"])
def test_a_face_of_a_vertex_that_there_is_not_is_refused(tmp_path, index, kind):
    faces = BOX.faces.copy()
    faces[5, 1] = index
    text = {
        "off": f"OFF\n8 12 0\n{_lines(BOX.vertices)}\n{_lines(faces, '3 ')}\n",
        "ply": "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face 12\nproperty list uchar int vertex_indices\nend_header\n{_lines(BOX.vertices)}\n"
        f"{_lines(faces, '3 ')}\n",
    }[kind]
    (tmp_path / f"a.{kind}").write_text(text)
    with pytest.raises(ValueError, match=rf"'a\.{kind}'.*(face 5 names vertex {index} of 8|cannot be read)"):
        sarcl.Scene.from_mesh(tmp_path / f"a.{kind}")


def _lines(rows, start=""):
    return "\n".join(start + " ".join(str(v) for v in row) for row in rows)


def test_a_mesh_in_an_archive_is_read(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.stl", BOX.export(file_type="stl"))
    assert len(sarcl.Scene.from_mesh(tmp_path / "a.zip").triangles) == 12


# Files in the making ---------------------------------------------------------------------------------------


def parts(folder):
    return sorted(p.name for p in folder.iterdir() if p.name.endswith(".part"))


KILLED = """
import os, signal, sys
from sarcl.io import sarcl_hdf5
out = sarcl_hdf5.EchoWriter(sys.argv[1], 4, 4)
print("ready", flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_run_left_is_removed_by_the_next_in_that_folder(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "a.h5")], timeout=60, capture_output=True)
    assert len(parts(tmp_path)) == 1
    with output_paths.atomic(tmp_path / "b.txt") as part:
        assert parts(tmp_path) == [part.name]
        part.write_text("b")
    assert [p.name for p in tmp_path.iterdir()] == ["b.txt"]


def test_the_file_of_a_living_run_stays(tmp_path):
    first = output_paths.begin(tmp_path / "a.h5")
    with output_paths.atomic(tmp_path / "b.txt") as part:
        assert first.path.exists() and len(parts(tmp_path)) == 2
        part.write_text("b")
    first.path.write_text("a")
    first.commit()
    assert (tmp_path / "a.h5").read_text() == "a" and parts(tmp_path) == []


def test_of_two_runs_on_one_output_the_second_is_told(tmp_path):
    first = output_paths.begin(tmp_path / "a.h5", alone=True)
    with pytest.raises(FileExistsError, match=r"a\.h5': another run is writing it; wait for that one"):
        output_paths.begin(tmp_path / "a.h5", alone=True)
    output_paths.begin(tmp_path / "b.h5", alone=True).remove()
    first.remove()
    output_paths.begin(tmp_path / "a.h5", alone=True).remove()
    assert list(tmp_path.iterdir()) == []


def test_files_in_the_making_have_names_that_nobody_knows_and_links_stay_as_they_are(tmp_path):
    (tmp_path / "victim").write_text("mine")
    (tmp_path / ".sarcl-a.h5.part").symlink_to("victim")
    names = set()
    for _ in range(3):
        made = output_paths.begin(tmp_path / "a.h5", alone=True)
        names.add(made.path.name)
        made.remove()
    assert len(names) == 3
    raw = saved(tmp_path / "a.h5", 4, 4)
    sarcl.backproject(raw, sarcl.ImageGrid.plane(shape=4, spacing=0.1), out=tmp_path / "a.h5")
    assert (tmp_path / "victim").read_text() == "mine" and (tmp_path / ".sarcl-a.h5.part").is_symlink()


def test_files_of_other_machines_stay_for_a_day(tmp_path):
    old = tmp_path / ".sarcl-00000000-00000000-0123456789ab.part"
    for age, left in ((3600, True), (2 * 86400, False)):
        old.write_text("half")
        os.utime(old, (time.time() - age, time.time() - age))
        output_paths.begin(tmp_path / "a.h5").remove()
        assert old.exists() is left


# A full disk -----------------------------------------------------------------------------------------------


class Usage:
    free = 1000


def test_a_full_disk_is_named_before_the_work_in_units_that_show_the_need(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(output_paths.shutil, "disk_usage", lambda path: Usage)
    with pytest.raises(OSError, match=r"a\.h5': it needs 5 MB, its disk has 1 kB free; make room there or choose"):
        output_paths.check_writable(tmp_path / "a.h5", 5e6)
    with pytest.raises(OSError, match=r"a\.png': it is on a disk with 1 kB free; make room"):
        output_paths.check_writable(tmp_path / "a.png")
    assert main(["demo", "--quick", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert str(tmp_path) in said and "1 kB free" in said and "0.00" not in said


def test_room_for_pictures_and_pages_is_looked_for_before_the_work(tmp_path, monkeypatch, capsys):
    raw = saved(tmp_path / "a.h5", 20, 30)
    (tmp_path / "e.toml").write_text("".join(f"[[case]]\nn_pulses = {11 + i}\n" for i in range(20)))
    monkeypatch.setattr(output_paths.shutil, "disk_usage", lambda path: type("Usage", (), {"free": 300_000}))
    monkeypatch.setattr("sarcl.imaging.backproject.backproject", None)  # no work is begun
    grid = ["--shape", "900", "900", "--spacing", "0.1", "0.1"]
    for command, words in (
        (["focus", str(tmp_path / "a.h5"), *grid, "-o", str(tmp_path / "a.png")], r"a\.png': it needs 1\.8\d* MB"),
        (
            ["focus", str(tmp_path / "a.h5"), "--shape", "170", "170", "--spacing", "0.1", "0.1",
             "-o", str(tmp_path / "b.h5"), "-o", str(tmp_path / "b.png")],
            r"b\.png': it, with the outputs before it, needs 355 kB",
        ),
        (["fda", str(tmp_path / "e.toml"), "-o", str(tmp_path / "e.html")], r"e\.html': it needs 800 kB"),
    ):  # fmt: skip
        assert main(command) == 2, command
        assert re.search(words + r", its disk has 300 kB free; make room there", capsys.readouterr().err)
    assert raw.n_rows == 20 and not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("shape", [(30, 40), (170, 90), (600, 600), (1, 300)])
def test_a_picture_needs_no_more_room_than_is_looked_for(shape):
    random = np.random.default_rng(0)
    noise = 20 * np.log10(np.abs(random.normal(size=shape) + 1j * random.normal(size=shape)))
    file = io.BytesIO()
    decibels.picture(noise, decibels.PixelAxes((0.1, 0.1))).save(file, format="PNG")
    assert len(file.getvalue()) <= decibels.picture_bytes(shape, (0.1, 0.1))


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full")
def test_a_disk_that_fills_while_a_picture_is_written_is_named(tmp_path):
    with pytest.raises(OSError, match=r"a\.png': No space left on device; it needs 3 MB, its disk has .*B free"):
        with output_paths.atomic(tmp_path / "a.png", 3_000_000), open("/dev/full", "wb", buffering=0) as full:
            full.write(b"x")
    assert list(tmp_path.iterdir()) == []


def test_versions_of_the_file_stay_the_same():
    assert hdf5.FORMAT == 1
