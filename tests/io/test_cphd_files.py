"""CPHD files of other programs: kinds of samples, vectors and scenes; files that are damaged or of another kind."""

from __future__ import annotations

import io
import os
import pickle
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import sarcl
from sarcl.cli.parser import main

cphd = pytest.importorskip("sarkit.cphd", reason="no sarkit: pip install sarcl[formats]")
etree = pytest.importorskip("lxml.etree")
pytestmark = pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning")  # within sarkit

C = 299792458.0
METADATA = {
    "CollectorName": "sarcl",
    "CoreName": "x",
    "ModeType": "STRIPMAP",
    "Classification": "U",
    "ReleaseInfo": "any",
    "CollectionStart": "2026-01-02",
    "ImageArea": ((-6, -4), (6, 4)),
}
TARGET = np.array([2.0, -1.0, 0.0])
N, M = 40, 48  # vectors, samples


def simulated():
    time = 10 + np.arange(N) / 50
    tx = np.array([-8e3, -40.0, 6e3]) + (time - 10)[:, None] * np.array([0, 100.0, 0])
    velocity = np.tile([0, 100.0, 0], (N, 1))
    f = 9.6e9 + 2e6 * np.arange(M)
    reference = np.linalg.norm(tx, axis=1)
    delta = np.linalg.norm(tx - TARGET, axis=1) - reference
    samples = np.exp(-4j * np.pi / C * delta[:, None] * f).astype(np.complex64)
    return sarcl.PhaseHistory(
        samples,
        frequency=f[0],
        frequency_step=2e6,
        tx=tx,
        reference_range=reference,
        time=time,
        tx_velocity=velocity,
        rx_velocity=velocity,
        polarization=np.full(N, "HH"),
    )


@pytest.fixture
def path(tmp_path):
    simulated().save(tmp_path / "x.cphd", origin=(47.2, 8.5, 420.0), metadata=METADATA)
    return tmp_path / "x.cphd"


def parts(path):
    with open(path, "rb") as file, cphd.Reader(file) as reader:
        return (reader.metadata.xmltree, *reader.read_channel("1"))


def written(path, tree, signal, pvp):
    """A file by sarkit's writer."""
    with open(path, "wb") as file, cphd.Writer(file, cphd.Metadata(xmltree=tree)) as writer:
        writer.write_signal("1", signal)
        writer.write_pvp("1", pvp)
    return path


def set_text(tree, where, text):
    tree.find("/".join(f"{{*}}{name}" for name in where.split("/"))).text = text


def add_parameter(tree, pvp, name, kind, values):
    """One more per-vector parameter at the end of the vectors."""
    words = pvp.dtype.itemsize // 8
    root = cphd.ElementWrapper(tree.getroot())
    root["PVP"][name] = {"Offset": words, "Size": 1, "dtype": np.dtype(kind)}
    set_text(tree, "Data/NumBytesPVP", str(8 * (words + 1)))
    wider = np.zeros(len(pvp), cphd.get_pvp_dtype(tree))
    for field in pvp.dtype.names:
        wider[field] = pvp[field]
    wider[name] = values
    return wider


def test_integers_and_amplitude_factors_give_the_samples(path, tmp_path):
    tree, signal, pvp = parts(path)
    factors = np.linspace(1e-4, 3e-4, N)
    for form, kind in (("CI4", np.int16), ("CI2", np.int8)):
        full = np.iinfo(kind).max - 1
        whole = np.round(signal.astype(np.complex128) * full)
        pairs = np.zeros(signal.shape, cphd.binary_format_string_to_dtype(form))
        pairs["real"], pairs["imag"] = whole.real, whole.imag
        new = etree.ElementTree(etree.fromstring(etree.tostring(tree)))
        set_text(new, "Data/SignalArrayFormat", form)
        wider = add_parameter(new, pvp, "AmpSF", "f8", factors)
        raw = sarcl.read(written(tmp_path / "i.cphd", new, pairs, wider))
        assert raw.samples.dtype == np.complex64
        np.testing.assert_allclose(raw.read(0, N), whole * factors[:, None], rtol=1e-6)


def test_vectors_without_a_signal_are_left_out(path, tmp_path):
    tree, signal, pvp = parts(path)
    is_empty = np.isin(np.arange(N), (0, 5, 6, 39))
    signal[is_empty], pvp["SIGNAL"][is_empty] = 0, 0
    pvp["TxPos"][is_empty], pvp["FX1"][is_empty] = np.nan, np.nan
    raw = sarcl.read(written(tmp_path / "s.cphd", tree, signal, pvp))
    assert raw.n_rows == N - 4
    np.testing.assert_array_equal(raw.read(0, raw.n_rows), signal[~is_empty])
    np.testing.assert_array_equal(raw.read(3, 6), signal[~is_empty][3:6])
    np.testing.assert_array_equal(raw.tx, pvp["TxPos"][~is_empty])


def test_bands_that_change_from_vector_to_vector(path, tmp_path):
    tree, _, pvp = parts(path)
    raw = sarcl.read(path)
    pvp["SC0"] += 1e6 * np.sin(np.arange(N))
    pvp["SCSS"] *= np.linspace(1, 1.02, N)
    pvp["FX1"], pvp["FX2"] = pvp["SC0"], pvp["SC0"] + (M - 1) * pvp["SCSS"]
    place = raw.image_area[0] + TARGET[0] / 6 * raw.image_area[1] + TARGET[1] / 4 * raw.image_area[2]
    delay = 2 * np.linalg.norm(raw.tx - place, axis=1) / C - 2 * raw.reference_range / C
    axis = pvp["SC0"][:, None] + np.arange(M) * pvp["SCSS"][:, None]
    signal = np.exp(-2j * np.pi * axis * delay[:, None]).astype(np.complex64)
    back = sarcl.read(written(tmp_path / "v.cphd", tree, signal, pvp))
    value = sarcl.backproject(back, sarcl.ImageGrid.points(place[None]), tolerance=1e-5).normalized()
    assert complex(np.ravel(value)[0]) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("sgn", [-1, 1])
@pytest.mark.parametrize("swath", ["about the reference", "behind it"])
def test_records_by_time_of_arrival_follow_from_the_standard(path, tmp_path, sgn, swath):
    """s(t) = a sinc(B (t - D)) exp(j 2 pi SGN fc D), sampled as a program would, at times of its own."""
    tree, _, pvp = parts(path)
    raw = sarcl.read(path)
    far = 0.0 if swath == "about the reference" else 3.0e-6  # s: 450 m
    place = raw.image_area[0] + raw.image_area[1] / 6 * TARGET[0]
    toward = (place - raw.tx.mean(axis=0)) / np.linalg.norm(place - raw.tx.mean(axis=0))
    place = place + toward * far * C / 2
    delay = 2 * np.linalg.norm(raw.tx - place, axis=1) / C - 2 * raw.reference_range / C
    n, low, high = 700, 9.6e9, 9.7e9
    pvp["FX1"], pvp["FX2"] = low, high
    pvp["SCSS"] = 1 / (1.37 * (high - low))
    pvp["SC0"] = far - n / 2 * pvp["SCSS"] + 1e-9 * np.arange(N)
    pvp["TOA1"], pvp["TOA2"] = far - 1e-7, far + 1e-7
    times = pvp["SC0"][:, None] + np.arange(n) * pvp["SCSS"][:, None]
    record = np.sinc((high - low) * (times - delay[:, None])) * np.exp(
        2j * np.pi * sgn * (low + high) / 2 * delay[:, None]
    )
    set_text(tree, "Global/DomainType", "TOA")
    set_text(tree, "Global/SGN", f"{sgn:+d}")
    set_text(tree, "Data/Channel/NumSamples", str(n))
    back = sarcl.read(written(tmp_path / "t.cphd", tree, record.astype(np.complex64), pvp))
    assert back.n_samples == int(np.ceil(n / 1.37))
    assert float(back.frequency[0]) >= low - back.frequency_step[0]
    value = sarcl.backproject(back, sarcl.ImageGrid.points(place[None]), tolerance=1e-5).normalized()
    assert complex(np.ravel(value)[0]) == pytest.approx(1, abs=0.01)  # skirts of the sinc beyond the record


def test_a_swath_far_from_the_reference_point_is_seen(path, tmp_path):
    """FX samples whose swath lies 450 m behind the reference point, 6 times the unambiguous one of 75 m."""
    tree, _, pvp = parts(path)
    raw = sarcl.read(path)
    toward = (raw.image_area[0] - raw.tx.mean(axis=0)) / np.linalg.norm(raw.image_area[0] - raw.tx.mean(axis=0))
    place = raw.image_area[0] + 450.0 * toward
    delay = 2 * np.linalg.norm(raw.tx - place, axis=1) / C - 2 * raw.reference_range / C
    axis = pvp["SC0"][:, None] + np.arange(M) * pvp["SCSS"][:, None]
    signal = np.exp(-2j * np.pi * axis * delay[:, None]).astype(np.complex64)
    pvp["TOA1"], pvp["TOA2"] = 3e-6 - 2e-7, 3e-6 + 2e-7
    back = sarcl.read(written(tmp_path / "w.cphd", tree, signal, pvp))
    value = sarcl.backproject(back, sarcl.ImageGrid.points(place[None]), tolerance=1e-5).normalized()
    assert complex(np.ravel(value)[0]) == pytest.approx(1, abs=1e-3)


def test_echoes_of_moving_receivers_are_scaled_as_the_standard_says(path, tmp_path):
    """Phase(fx) = SGN fx dTOA (1 + aFDOP)(1 + v/c) of a target 20 m off, with factors that matter there."""
    tree, _, pvp = parts(path)
    raw = sarcl.read(path)
    place = raw.image_area[0] + TARGET[0] * 3 * raw.image_area[1] / 6
    pvp["aFDOP"] = np.linspace(-4e-4, 6e-4, N)
    line = pvp["RcvPos"] - pvp["SRPPos"]
    rate = (pvp["RcvVel"] * line).sum(axis=1) / np.linalg.norm(line, axis=1)
    delay = 2 * np.linalg.norm(raw.tx - place, axis=1) / C - 2 * raw.reference_range / C
    axis = pvp["SC0"][:, None] + np.arange(M) * pvp["SCSS"][:, None]
    factor = (1 + pvp["aFDOP"]) * (1 + rate / C)
    signal = np.exp(-2j * np.pi * axis * (delay * factor)[:, None]).astype(np.complex64)
    back = sarcl.read(written(tmp_path / "d.cphd", tree, signal, pvp))
    value = sarcl.backproject(back, sarcl.ImageGrid.points(place[None]), tolerance=1e-5).normalized()
    assert complex(np.ravel(value)[0]) == pytest.approx(1, abs=1e-3)
    pvp["aFDOP"] *= 1e-4  # of no effect within the swath: all rows keep one band
    back = sarcl.read(written(tmp_path / "d.cphd", tree, signal, pvp))
    np.testing.assert_array_equal(back.frequency, pvp["SC0"])


def test_a_curved_reference_surface_becomes_its_tangent(path, tmp_path):
    tree, signal, pvp = parts(path)
    longitude, latitude, _ = (float(v) for v in sarcl.wgs84.geodetic(sarcl.read(path).image_area[0]))
    step = 1e-3  # degrees
    east, north = (
        np.linalg.norm(
            sarcl.wgs84.ecef(longitude + dx, latitude + dy, 420.0) - sarcl.wgs84.ecef(longitude, latitude, 420.0)
        )
        for dx, dy in ((step, 0), (0, step))
    )
    root = cphd.ElementWrapper(tree.getroot())
    radians = np.radians(step)
    root["SceneCoordinates"]["ReferenceSurface"] = {
        "HAE": {"uIAXLL": [0.0, radians / east], "uIAYLL": [radians / north, 0.0]}
    }
    plane, curved = sarcl.read(path).image_area, sarcl.read(written(tmp_path / "h.cphd", tree, signal, pvp)).image_area
    np.testing.assert_allclose(curved, plane, atol=1e-3)


def test_an_image_area_in_lines_and_samples_becomes_metres(path, tmp_path):
    tree, signal, pvp = parts(path)
    scene = cphd.ElementWrapper(tree.getroot())["SceneCoordinates"]
    scene["ImageArea"] = {"X1Y1": [-60, -20], "X2Y2": [59, 19]}
    scene["ImageGrid"] = {
        "IARPLocation": [0.0, 0.0],
        "IAXExtent": {"LineSpacing": 0.1, "FirstLine": -60, "NumLines": 120},
        "IAYExtent": {"SampleSpacing": 0.2, "FirstSample": -20, "NumSamples": 40},
    }
    lines = sarcl.read(written(tmp_path / "g.cphd", tree, signal, pvp)).image_area
    np.testing.assert_allclose(np.linalg.norm(lines[1:], axis=1), (5.95, 3.9), rtol=1e-8)
    scene["ImageArea"] = {"X1Y1": [-6, -4], "X2Y2": [6, 4]}  # in metres
    metres = sarcl.read(written(tmp_path / "g.cphd", tree, signal, pvp)).image_area
    np.testing.assert_allclose(np.linalg.norm(metres[1:], axis=1), (6, 4), rtol=1e-8)


def test_an_open_file_is_read_as_its_path_is(path):
    raw = sarcl.read(path)
    for file in (open(path, "rb"), io.BytesIO(path.read_bytes())):
        back = sarcl.read(file)
        np.testing.assert_array_equal(back.read(3, 30), raw.read(3, 30))
        np.testing.assert_array_equal(back.tx, raw.tx)
    with pytest.raises(ValueError, match="open files are read as CPHD, CRSD or SICD"):
        sarcl.read(io.BytesIO(b"\x89HDF\r\n\x1a\n"))


def test_samples_stay_in_the_file(path):
    raw = sarcl.read(path)
    assert not isinstance(raw.samples, np.ndarray)
    np.testing.assert_array_equal(raw[5:9].read(0, 4), raw.read(5, 9))
    np.testing.assert_array_equal(raw.samples[7], raw.read(7, 8)[0])
    with pytest.raises(TypeError, match="cannot be copied or sent to another process"):
        pickle.dumps(raw.samples.source)


def test_a_file_that_changes_while_it_is_read_is_told(path):
    raw = sarcl.read(path)
    forecast = sarcl.plan(raw, sarcl.ImageGrid.plane(center=raw.image_area[0], shape=8, spacing=1))
    data = bytearray(path.read_bytes())
    data[-40] ^= 1
    with open(path, "r+b") as file:
        file.write(data)
    os.utime(path, ns=(1, 1))
    with pytest.raises(OSError, match=r"x.cphd' has changed since it was opened; read it again"):
        raw.read(0, 1)
    with pytest.raises(ValueError, match="has changed since the plan was made"):
        forecast.run()


def test_a_file_that_is_cut_while_it_is_read_is_told(path):
    raw = sarcl.read(io.BytesIO(path.read_bytes()[:]))
    raw.samples.source._file.truncate(path.stat().st_size - 8 * M)
    raw.read(0, N - 1)
    with pytest.raises(OSError, match=r"vectors 38 to 39 of channel '1'"):
        raw.read(38, 40)


@pytest.mark.parametrize("share", [0.02, 0.2, 0.5, 0.9, 0.9999])
def test_truncated_files_are_refused(path, share):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(ValueError, match=r"x.cphd' is truncated"):
        sarcl.read(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"<SGN>-1", b"<SGN>+2", r"SGN '\+2', wanted \+1 or -1"),
        (b"<DomainType>FX", b"<DomainType>FY", "DomainType 'FY', wanted FX or TOA"),
        (b"CPHD/1.1.0", b"CPHD/1.2.0", "is 'CPHD/1.2.0'; sarcl reads CPHD/1.0.1 and CPHD/1.1.0"),
        (b"cphd/1.1.0", b"cphd/1.3.0", "XML of 'http"),
        (b"<NumSamples>48", b"<NumSamples>49", "leaves its block"),
        (b"<NumVectors>40", b"<NumVectors>41", "leaves its block"),
        (b"<NumVectors>40", b"<NumVectors>-1", "is damaged|no channel with vectors"),
        (b"<SignalArrayFormat>CF8", b"<SignalArrayFormat>CF7", "truncated or damaged"),
        (b"</CPHD>", b"</CPHX>", "truncated or damaged"),
        (b"SIGNAL_BLOCK_SIZE := ", b"SIGNAL_BLOCK_SIZE := 9", "is truncated: its SIGNAL block"),
    ],
)
def test_files_that_are_wrong_are_refused(path, old, new, words):
    data = path.read_bytes()
    assert old in data
    data = data.replace(old, new) if len(old) == len(new) else data.replace(old + b"1", new + b"1", 1)
    path.write_bytes(data)
    with pytest.raises(ValueError, match=words):
        sarcl.read(path)


def test_a_polarisation_without_a_name_is_none(path):
    path.write_bytes(path.read_bytes().replace(b"<TxPol>H", b"<TxPol>?"))
    assert sarcl.read(path).polarization is None


@pytest.mark.parametrize(("name", "letters"), [("X", "XH"), ("Y", "YH"), ("RHC", "RH"), ("LHC", "LH"), ("E", "EH")])
def test_polarisations_have_letters(path, tmp_path, name, letters):
    tree, signal, pvp = parts(path)
    set_text(tree, "Channel/Parameters/Polarization/TxPol", name)
    raw = sarcl.read(written(tmp_path / "q.cphd", tree, signal, pvp))
    assert set(raw.polarization) == {letters}
    assert sarcl.read(tmp_path / "q.cphd", polarization=f"{name}:H").n_rows == N


def test_records_too_coarse_for_their_band_are_refused(path, tmp_path):
    tree, signal, pvp = parts(path)
    set_text(tree, "Global/DomainType", "TOA")
    pvp["SCSS"] = 1.01 / (pvp["FX2"] - pvp["FX1"])
    with pytest.raises(ValueError, match=r"has SCSS = .* too few for their band"):
        sarcl.read(written(tmp_path / "u.cphd", tree, signal, pvp))


def test_a_compressed_signal_is_refused(path, tmp_path):
    tree, signal, pvp = parts(path)
    data = cphd.ElementWrapper(tree.getroot())["Data"]
    data["SignalCompressionID"] = "private"
    with pytest.raises(ValueError, match="has a compressed signal"):
        sarcl.read(written(tmp_path / "c.cphd", tree, signal, pvp))


@pytest.mark.parametrize("name", ["TxTime", "TxPos", "RcvPos", "RcvVel", "SRPPos", "FX1", "FX2", "TOA1", "SC0", "SCSS"])
@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_parameters_that_are_not_finite_or_not_filled_in_are_refused(path, tmp_path, name, value):
    tree, signal, pvp = parts(path)
    pvp[name][7] = value
    path = written(tmp_path / "p.cphd", tree, signal, pvp)
    if value == 0 and name in ("TxTime", "RcvVel", "TOA1"):  # where 0 is a value as any other
        sarcl.read(path)
        return
    with pytest.raises(ValueError, match=rf"has {name} = .* in vector 7 of channel '1'"):
        sarcl.read(path)


def test_samples_that_are_not_finite_are_told_with_their_row(path, tmp_path):
    tree, signal, pvp = parts(path)
    signal[9, 3] = np.nan
    raw = sarcl.read(written(tmp_path / "n.cphd", tree, signal, pvp))
    with pytest.raises(ValueError, match=r"samples\[9, 3\]"):
        raw.read(0, N)


def test_channels_of_other_sizes_are_chosen_by_name(path, tmp_path):
    """Two files joined into one of two channels: the second has fewer samples."""
    tree, signal, pvp = parts(path)
    for block, where in (("Data/Channel", "Identifier"), ("Channel/Parameters", "Identifier")):
        node = tree.find("/".join(f"{{*}}{n}" for n in block.split("/")))
        twin = etree.fromstring(etree.tostring(node))
        twin.find(f"{{*}}{where}").text = "2"
        if block == "Data/Channel":
            twin.find("{*}NumSamples").text = str(M // 2)
            twin.find("{*}SignalArrayByteOffset").text = str(8 * N * M)
            twin.find("{*}PVPArrayByteOffset").text = str(N * pvp.dtype.itemsize)
        else:
            twin.find("{*}Polarization/{*}RcvPol").text = "V"
        node.addnext(twin)
    new = tmp_path / "two.cphd"
    with open(new, "wb") as file, cphd.Writer(file, cphd.Metadata(xmltree=tree)) as writer:
        for name, values in (("1", signal), ("2", np.ascontiguousarray(signal[:, : M // 2]))):
            writer.write_signal(name, values)
            writer.write_pvp(name, pvp)
    with pytest.raises(ValueError, match=r"differ in samples per vector: '1' \(48\), '2' \(24\); give channel="):
        sarcl.read(new)
    assert sarcl.read(new, channel="2").samples.shape == (N, M // 2)
    assert sarcl.read(new, polarization="HH").n_samples == M
    assert main(["focus", str(new), "--polarization", "HV", "-o", str(tmp_path / "y.png")]) == 0


def test_a_side_of_the_track_is_refused_where_the_file_names_an_area(path, capsys):
    assert main(["focus", str(path), "--side", "left"]) == 2
    assert "the file names an image area" in capsys.readouterr().err


def test_focus_needs_no_other_argument(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["focus", "x.cphd", "-o", "x.h5", "-o", "x.png"]) == 0
    assert "of the image area that the file names" in capsys.readouterr().out
    image = sarcl.read("x.h5")
    raw = sarcl.read("x.cphd")
    np.testing.assert_allclose(image.grid.center, raw.image_area[0])
    peak = image.grid.positions[np.unravel_index(np.abs(image.data).argmax(), image.data.shape)]
    wanted = raw.image_area[0] + TARGET[0] / 6 * raw.image_area[1] + TARGET[1] / 4 * raw.image_area[2]
    assert np.linalg.norm(peak - wanted) < max(image.grid.spacing)


def test_a_given_grid_replaces_the_image_area(path):
    raw = sarcl.read(path)
    grid = sarcl.default_grid(raw, shape=(5, 7), spacing=(0.5, 0.25))
    assert grid.shape == (5, 7) and grid.spacing == (0.5, 0.25)
    other = raw.image_area[0] + raw.image_area[1] / 2
    np.testing.assert_allclose(sarcl.default_grid(raw, center=other, shape=4).center, other)


def test_an_image_area_belongs_to_all_rows(path):
    raw = sarcl.read(path)
    np.testing.assert_array_equal(sarcl.concatenate([raw, raw[:3]]).image_area, raw.image_area)
    assert sarcl.concatenate([raw, replace(raw, image_area=None)]).image_area is None
    assert sarcl.read([path, path]).metadata == raw.metadata
    with pytest.raises(ValueError, match="span no plane"):
        replace(raw, image_area=np.zeros((3, 3)))


def test_without_sarkit_an_error_names_the_extra(path):
    code = f"import sys; sys.modules['sarkit'] = None; import sarcl; sarcl.read({str(path)!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert re.search(
        r"ImportError: CPHD files? needs? the package sarkit, with NumPy 2: pip install sarcl\[formats\]", done.stderr
    )


def test_polarization_and_channel_choose_rows_of_other_files_too(path, tmp_path):
    raw = sarcl.read(path)
    both = sarcl.concatenate([raw, replace(raw, polarization=np.full(N, "HV"))])
    both.save(tmp_path / "b.h5")
    assert set(sarcl.read(tmp_path / "b.h5", polarization="HV").polarization) == {"HV"}
    assert sarcl.read(tmp_path / "b.h5", channel="0").n_rows == 2 * N
    with pytest.raises(ValueError, match="polarization 'VV' is not in these data"):
        sarcl.read(tmp_path / "b.h5", polarization="VV")


def test_range_and_doppler_that_are_coupled_are_told(path, tmp_path):
    """aFRR1 dv B of a resolution: in the corners dv = 100 m/s times 4 m/10 km, B = 94 MHz."""
    tree, signal, pvp = parts(path)
    pvp = pvp.copy()
    pvp["aFRR1"] = 2.6e-12
    sarcl.read(written(tmp_path / "y.cphd", tree, signal, pvp))  # 1e-5 of a resolution: no warning, which is an error
    pvp["aFRR1"] = 1e-7
    with pytest.warns(sarcl.SarclWarning, match=r"coupled \(aFRR1, aFRR2\).* by 3[78]\.\d% of the range resolution"):
        sarcl.read(written(tmp_path / "y.cphd", tree, signal, pvp))
    pvp["aFRR1"] = -3e-7
    with pytest.raises(ValueError, match=r"y.cphd' has coupled range and Doppler .* by 1\.1 range resolutions"):
        sarcl.read(written(tmp_path / "y.cphd", tree, signal, pvp))
    pvp["aFRR1"], pvp["aFRR2"] = 0.0, 4e-7 / 94e6  # phases at the ends of the band as of aFRR1 = 1e-7
    with pytest.warns(sarcl.SarclWarning, match=r"by 3[78]\.\d% of the range resolution"):
        sarcl.read(written(tmp_path / "y.cphd", tree, signal, pvp))
    pvp["aFRR2"][3] = np.nan
    with pytest.raises(ValueError, match="aFRR2 = nan in vector 3"):
        sarcl.read(written(tmp_path / "y.cphd", tree, signal, pvp))
