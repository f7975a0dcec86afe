"""SICD files of other programs: kinds of pixels, signs, carriers, grids; files that are damaged or of another kind."""

from __future__ import annotations

import copy
import io
import os
import pickle
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pytest
from earth_targets import aircraft

import sarcl
from sarcl.cli.parser import main

sicd = pytest.importorskip("sarkit.sicd", reason="no sarkit: pip install sarcl[formats]")
pytestmark = pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning")  # within sarkit
METADATA = {
    "CollectorName": "sarcl",
    "CoreName": "x",
    "ModeType": "SPOTLIGHT",
    "Classification": "UNCLASSIFIED",
    "CollectionStart": "2026-01-02",
}
SIDES = "Row", "Col"


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """A file of 50 x 60 pixels, its tree and pixels as sarkit reads them, and the image that it gives."""
    case = aircraft(False)
    grid = sarcl.ImageGrid.plane(shape=(60, 50), spacing=(0.3, 0.4))
    path = tmp_path_factory.mktemp("sicd") / "x.nitf"
    image = sarcl.backproject(case.raw, grid)
    image.save(path, collection=case.raw, metadata=METADATA, origin=case.origin)
    with open(path, "rb") as file, sicd.NitfReader(file) as reader:
        return path, reader.metadata, reader.read_image()


def place(name):
    return "/".join(f"{{*}}{part}" for part in name.split("/"))


def written(path, metadata, pixels, **changes):
    """The file with other texts and pixels, by sarkit's writer; a text of None takes an element out."""
    metadata = copy.deepcopy(metadata)
    for name, text in changes.items():
        element = metadata.xmltree.find(place(name.replace("__", "/")))
        if text is None:
            element.getparent().remove(element)
        else:
            element.text = str(text)
    with open(path, "wb") as file, sicd.NitfWriter(file, metadata) as writer:
        writer.write_image(np.ascontiguousarray(pixels))
    return path


def test_the_other_sign_is_the_conjugate(base, tmp_path):
    path, metadata, pixels = base
    same = written(tmp_path / "x.nitf", metadata, pixels.conj(), Grid__Row__Sgn="+1", Grid__Col__Sgn="+1")
    np.testing.assert_array_equal(np.asarray(sarcl.read(same)), np.asarray(sarcl.read(path)))


def test_any_carrier_is_put_back(base, tmp_path):
    """Pixels about other spatial frequencies than sarcl writes: the phase of the image is that of the geometry."""
    path, metadata, pixels = base
    texts, waves = {}, []
    for axis, (side, shift) in enumerate(zip(SIDES, (0.123, -0.317), strict=True)):
        center = float(metadata.xmltree.findtext(place(f"Grid/{side}/KCtr"))) + shift
        step = float(metadata.xmltree.findtext(place(f"Grid/{side}/SS")))
        origin = int(metadata.xmltree.findtext(place(f"ImageData/SCPPixel/{side}")))
        waves.append(np.exp(-2j * np.pi * shift * step * (np.arange(pixels.shape[axis]) - origin)))
        texts[f"Grid__{side}__KCtr"] = repr(center)
    other = written(tmp_path / "x.nitf", metadata, (pixels * np.outer(*waves)).astype("c8"), **texts)
    expected = np.asarray(sarcl.read(path))
    assert np.abs(np.asarray(sarcl.read(other)) - expected).max() < 1e-5 * np.abs(expected).max()


def test_integers_are_read(base, tmp_path):
    _, metadata, pixels = base
    scale = 32000 / np.abs(pixels).max()
    pairs = np.zeros(pixels.shape, sicd.PIXEL_TYPES["RE16I_IM16I"]["dtype"])
    pairs["real"], pairs["imag"] = np.rint(pixels.real * scale), np.rint(pixels.imag * scale)
    path = written(tmp_path / "x.nitf", metadata, pairs, ImageData__PixelType="RE16I_IM16I")
    expected = np.asarray(sarcl.read(base[0]))
    np.testing.assert_allclose(np.asarray(sarcl.read(path)), expected * scale, atol=1)


@pytest.mark.parametrize("has_table", [False, True])
def test_amplitude_and_phase_are_read(base, tmp_path, has_table):
    from lxml import etree

    _, metadata, pixels = base
    metadata = copy.deepcopy(metadata)
    steps = np.arange(256.0) if not has_table else np.arange(256.0) ** 2
    if has_table:
        kind = metadata.xmltree.find(place("ImageData/PixelType"))
        table = etree.Element(kind.tag.replace("PixelType", "AmpTable"), size="256")
        for i, value in enumerate(steps):
            etree.SubElement(table, kind.tag.replace("PixelType", "Amplitude"), index=str(i)).text = str(value)
        kind.addnext(table)
    scale = steps[-1] / np.abs(pixels).max()
    pairs = np.zeros(pixels.shape, sicd.PIXEL_TYPES["AMP8I_PHS8I"]["dtype"])
    pairs["amp"] = np.abs(np.abs(pixels)[..., None] * scale - steps).argmin(axis=-1)
    pairs["phase"] = np.rint(np.angle(pixels) / (2 * np.pi) * 256).astype(int) % 256
    path = written(tmp_path / "x.nitf", metadata, pairs, ImageData__PixelType="AMP8I_PHS8I")
    expected, error = np.asarray(sarcl.read(base[0])) * scale, np.pi / 256
    values = np.asarray(sarcl.read(path))
    amplitude_error = np.abs(np.abs(values) - np.abs(expected))
    assert amplitude_error.max() < (256 if has_table else 0.51)
    bright = np.abs(expected) > 0.1 * np.abs(expected).max()
    assert np.abs(np.angle(values[bright] / expected[bright])).max() < 1.05 * error


def test_a_part_of_a_larger_image_lies_where_it_lay(base, tmp_path):
    path, metadata, _ = base
    with open(path, "rb") as file, sicd.NitfReader(file) as reader:
        part, tree = reader.read_sub_image(10, 5, 40, 45)
    metadata = copy.deepcopy(metadata)
    metadata.xmltree = tree
    small, whole = sarcl.read(written(tmp_path / "x.nitf", metadata, part.astype("c8"))), sarcl.read(path)
    index = np.rint(whole.grid.index(small.grid.positions)).astype(int)
    np.testing.assert_allclose(whole.grid.at(*np.moveaxis(index, -1, 0)), small.grid.positions, atol=1e-8)
    np.testing.assert_array_equal(np.asarray(small), np.asarray(whole)[index[..., 0], index[..., 1]])


@pytest.mark.parametrize("kind", ["XRGYCR", "XCTYAT", "RGAZIM"])
def test_planes_of_other_kinds_are_read(base, tmp_path, kind):
    """A grid of polar format without its element PFA does not say where it shows the scene, which is told."""
    _, metadata, pixels = base
    path = written(tmp_path / "x.nitf", metadata, pixels, Grid__Type=kind)
    words = pytest.warns(sarcl.SarclWarning, match="RGAZIM.* it does not say how far from where")
    with words if kind == "RGAZIM" else nullcontext():
        image = sarcl.read(path)
    np.testing.assert_array_equal(image.grid.positions, sarcl.read(base[0]).grid.positions)


def test_planes_that_show_the_scene_elsewhere_are_told(base, tmp_path):
    """Polar format: a target 600 m beside the centre is shown where a plane wave would put it, x^2/2R = 18 m off."""
    _, metadata, pixels = base
    metadata = copy.deepcopy(metadata)
    root = sicd.ElementWrapper(metadata.xmltree.getroot())
    root["PFA"] = {
        "FPN": [0.0, 0.0, 1.0],
        "IPN": [0.0, 0.0, 1.0],
        "PolarAngRefTime": 1.0,
        "PolarAngPoly": [-0.01, 0.01],
        "SpatialFreqSFPoly": [1.0],
        **dict.fromkeys(("Krg1", "Kaz1"), -0.5),
        **dict.fromkeys(("Krg2", "Kaz2"), 0.5),
    }
    changes = {"Grid__Type": "RGAZIM", "ImageFormation__ImageFormAlgo": "PFA", "Grid__Col__SS": "20.0"}
    path = written(tmp_path / "x.nitf", metadata, pixels, **changes)
    with pytest.warns(sarcl.SarclWarning, match=r"RGAZIM.* up to [\d.e+]+ m from where"):
        sarcl.read(path)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"Grid__Type": "RGZERO"}, "has a grid of type 'RGZERO' .* do not lie on a plane"),
        ({"Grid__Type": "RGAZIM", "ImageFormation__ImageFormAlgo": "RGAZCOMP"}, "RGAZCOMP"),
        ({"Grid__Row__SS": "-0.4"}, "wanted steps in m"),
        ({"Grid__Row__SS": "nan"}, "wanted steps in m"),
        ({"Grid__Row__UVectECF__X": "0.5"}, "unit vectors"),
        ({"Grid__Row__Sgn": "+1"}, "has the signs"),
        ({"Grid__Row__KCtr": "nan"}, "KCtr that is not finite"),
        ({"ImageData__NumRows": "49"}, "its XML has 49 x 60 pixels, its image segments 3000"),
        ({"Grid__Row__SS": None}, "it has no Grid/Row/SS"),
        ({"SCPCOA__ARPPos__X": "much"}, "damaged"),
        ({"GeoData__SCP__ECF__X": "inf"}, "wanted steps"),
    ],
)
def test_wrong_metadata_are_refused(base, tmp_path, changes, words):
    path = tmp_path / "x.nitf"
    path.write_bytes(with_texts(base[0].read_bytes(), changes))
    with pytest.raises(ValueError, match=words) as caught:
        sarcl.read(path)
    assert "x.nitf" in str(caught.value)


def with_texts(data, changes):
    """A file whose XML has other texts, as long as before: what the writer would not write."""
    from lxml import etree

    start, end = data.index(b"<SICD"), data.index(b"</SICD>") + len(b"</SICD>")
    tree = etree.fromstring(data[start:end])
    for name, text in changes.items():
        element = tree.find(place(name.replace("__", "/")))
        if text is None:
            element.getparent().remove(element)
        else:
            element.text = text
    new = etree.tostring(tree)
    for removable in ("GeoData/ImageCorners", "CollectionInfo/CoreName"):
        if len(new) > end - start:
            element = tree.find(place(removable))
            element.getparent().remove(element)
            new = etree.tostring(tree)
    assert len(new) <= end - start
    return data[:start] + new.ljust(end - start) + data[end:]


def test_pixels_of_another_type_are_refused(base, tmp_path):
    path = tmp_path / "x.nitf"
    path.write_bytes(base[0].read_bytes().replace(b"<PixelType>RE32F_IM32F<", b"<PixelType>RE64F_IM64F<"))
    with pytest.raises(ValueError, match="has pixels of type 'RE64F_IM64F'; sarcl reads RE32F_IM32F"):
        sarcl.read(path)


def test_truncated_files_are_refused(base, tmp_path):
    data = base[0].read_bytes()
    for length in (12, 200, 400, 1000, len(data) // 3, len(data) - 9000, len(data) - 1):
        (tmp_path / "x.nitf").write_bytes(data[:length])
        with pytest.raises(ValueError, match=r"x\.nitf' (is|:)"):
            sarcl.read(tmp_path / "x.nitf")


def test_changed_bytes_are_an_error_or_an_image(base, tmp_path):
    """Never another exception, whatever is damaged."""
    data, random = base[0].read_bytes(), np.random.default_rng(4)
    text = data.index(b"<SICD")
    for _ in range(60):
        damaged = bytearray(data)
        for at in random.integers(9, 900, 2).tolist() + random.integers(text, len(data), 2).tolist():
            damaged[at] = int(random.integers(256))
        (tmp_path / "x.nitf").write_bytes(bytes(damaged))
        try:
            np.asarray(sarcl.read(tmp_path / "x.nitf"))
        except (ValueError, OSError) as exc:
            assert "x.nitf" in str(exc)


def test_a_damaged_file_is_one_error_and_nothing_else_on_stderr(base, tmp_path):
    path = tmp_path / "x.nitf"
    path.write_bytes(base[0].read_bytes()[:9000])
    code = f"import sarcl\ntry:\n    sarcl.read({str(path)!r})\nexcept ValueError as exc:\n    print(exc)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "x.nitf' is truncated or damaged" in run.stdout and run.stderr == ""


def test_nitf_without_sicd_is_refused(tmp_path):
    import jbpy

    nitf = jbpy.Jbp()
    nitf["FileHeader"]["OSTAID"].value = "x"
    nitf["FileHeader"]["FSCLAS"].value = "U"
    nitf.finalize()
    with open(tmp_path / "x.nitf", "wb") as file:
        nitf.dump(file)
    with pytest.raises(ValueError, match="is a NITF file without SICD metadata"):
        sarcl.read(tmp_path / "x.nitf")


def test_pixels_that_are_not_finite_are_named(base, tmp_path):
    _, metadata, pixels = base
    pixels = pixels.copy()
    pixels[7, 3] = np.nan
    image = sarcl.read(written(tmp_path / "x.nitf", metadata, pixels))
    assert np.isfinite(image.data[:20]).all()  # the other end of the file
    with pytest.raises(ValueError, match=r"pixel \(?nan.* in row 7, column 3"):
        np.asarray(image)


def test_a_file_that_changes_is_an_error(base, tmp_path):
    path = tmp_path / "x.nitf"
    path.write_bytes(base[0].read_bytes())
    image = sarcl.read(path)
    with open(path, "r+b") as file:
        file.seek(-8, io.SEEK_END)
        file.write(b"\0" * 8)
    os.utime(path, ns=(1, 1))
    with pytest.raises(OSError, match="has changed since it was opened"):
        np.asarray(image)


def test_open_files_are_read_in_place(base):
    expected = np.asarray(sarcl.read(base[0]))
    memory = io.BytesIO(base[0].read_bytes())
    image = sarcl.read(memory)
    np.testing.assert_array_equal(image.data[3:9], expected[3:9])
    with open(base[0], "rb") as file:
        np.testing.assert_array_equal(np.asarray(sarcl.read(file)), expected)
        assert not file.closed
    memory.close()
    with pytest.raises(OSError, match="was closed"):
        np.asarray(image)


def test_rows_are_read_when_they_are_asked_for(base, tmp_path):
    image = sarcl.read(base[0])
    assert not isinstance(image.data, np.ndarray)
    with pytest.raises(TypeError, match="rows of the open file"):
        pickle.dumps(image.data)
    with pytest.raises(IndexError):
        image.data[70]
    image.save(tmp_path / "x.h5")  # by blocks of rows
    np.testing.assert_array_equal(np.asarray(sarcl.read(tmp_path / "x.h5")), np.asarray(image))
    assert len(image.data) == 50
    assert image.show().size[0] > 100


def test_channels_are_of_echoes(base):
    with pytest.raises(ValueError, match="holds an image"):
        sarcl.read(base[0], channel=0)
    with pytest.raises(ValueError, match="holds an image"):
        sarcl.read([base[0], base[0]])


def test_a_missing_library_names_the_extra(base):
    code = f"""
import sys
sys.modules["sarkit"] = None
import sarcl
try:
    sarcl.read({str(base[0])!r})
except ImportError as exc:
    print(exc)
"""
    text = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "SICD files need the package sarkit, with NumPy 2: pip install sarcl[formats]" in text


def test_the_command_line_writes_sicd_of_cphd(tmp_path, capsys):
    case = aircraft(False)
    words = {**METADATA, "ReleaseInfo": "any", "ImageArea": ((-14, -12), (14, 12))}
    case.raw.save(tmp_path / "x.cphd", origin=case.origin, metadata=words)
    target = tmp_path / "x.nitf"
    assert main(["focus", str(tmp_path / "x.cphd"), "-o", str(target)]) == 0
    image = sarcl.read(target)
    assert abs(sarcl.measure(image, near=case.targets[1]).peak) / image.gain == pytest.approx(0.8, abs=0.05)
    capsys.readouterr()
    case.raw.save(tmp_path / "x.h5")
    other = tmp_path / "other.nitf"
    assert main(["focus", str(tmp_path / "x.h5"), "-o", str(other)]) != 0  # before the work: names are missing
    assert "give metadata={'CollectorName'" in capsys.readouterr().err
    words = str(tmp_path / "x.cphd"), "-o", str(other)
    assert main(["focus", *words, "--method", "range_doppler"]) != 0
    assert "leave out --method range_doppler" in capsys.readouterr().err
    assert main(["focus", *words, "--spacing", "3", "3"]) != 0
    assert "focus on a finer grid" in capsys.readouterr().err
    assert not other.exists()
