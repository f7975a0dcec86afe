"""SICD: files that sarcl writes, as sarkit's checker judges them, located by the standard's projection, and read."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from earth_targets import CASES, C, aircraft, two_way
from helpers.cases import quick_of, thinned

import sarcl

sicd = pytest.importorskip("sarkit.sicd", reason="no sarkit: pip install sarcl[formats]")
pytestmark = pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning")  # within sarkit
verification = pytest.importorskip("sarkit.verification")
projection = pytest.importorskip("sarkit.sicd.projection")

METADATA = {
    "CollectorName": "sarcl",
    "CoreName": "targets",
    "ModeType": "SPOTLIGHT",
    "Classification": "UNCLASSIFIED",
    "CollectionStart": "2026-01-02T03:04:05.250000",
}
SIDES = "Row", "Col"
TURNS = {"as it is": 0.0, "turned by 100 deg": np.radians(100), "turned by 200 deg": np.radians(200)}


def words_of(case):
    return METADATA if case.raw.is_monostatic or not is_bistatic(case) else {**METADATA, "IlluminatorName": "other"}


def is_bistatic(case):
    return np.linalg.norm(case.raw.rx[0] - case.raw.tx[0]) > 500


def focused(case, turn=0.0, normal=1.0, shape=(150, 170), **options):
    """The image on a level plane through the reference point, its x axis turned from east."""
    if case.origin:
        center, (east, north, up) = np.zeros(3), np.eye(3)
    else:
        center = case.targets[0]
        longitude, latitude, _ = (float(v) for v in sarcl.wgs84.geodetic(center))
        east, north, up = sarcl.wgs84.local_axes(longitude, latitude)
    x_axis = np.cos(turn) * east + np.sin(turn) * north
    grid = sarcl.ImageGrid.plane(center=center, shape=shape, spacing=(0.24, 0.2), normal=normal * up, x_axis=x_axis)
    return sarcl.backproject(case.raw, grid, **options)


def saved(case, image, path, **options):
    image.save(path, **{"collection": case.raw, "metadata": words_of(case), "origin": case.origin, **options})
    return path


def contents(path):
    """Tree and pixels as sarkit reads them."""
    with open(path, "rb") as file, sicd.NitfReader(file) as reader:
        return reader.metadata.xmltree, reader.read_image()


def number(tree, place):
    return float(tree.findtext("/".join(f"{{*}}{name}" for name in place.split("/"))))


def errors(path):
    """Errors and warnings of sarkit's checker by name."""
    with open(path, "rb") as file:
        judge = verification.SicdConsistency.from_file(file)
        judge.check()
    kinds = {"Error": set(), "Warning": set()}
    for name, outcome in judge.failures().items():
        for detail in outcome["details"]:
            if not detail["passed"]:
                kinds[detail["severity"]].add(name)
    return kinds["Error"], kinds["Warning"]


QUICK = ("aircraft", True), ("orbit", False)  # with SLOW, both platforms, mono- and bistatic
SLOW = ("aircraft", False), ("orbit", True)


@pytest.fixture(
    scope="module",
    params=[*QUICK, *(pytest.param(each, marks=pytest.mark.slow) for each in SLOW)],
    ids=lambda p: f"{p[0]}-{'bi' * p[1] or 'mono'}",
)
def case(request):
    name, bistatic = request.param
    return CASES[name](bistatic)


@pytest.fixture(scope="module")
def written(case, tmp_path_factory):
    """An image and its file."""
    image = focused(case)
    return image, saved(case, image, tmp_path_factory.mktemp("sicd") / "x.nitf")


def test_the_checker_of_sarkit_finds_no_error(written):
    wrong, advice = errors(written[1])
    assert wrong == set()
    assert advice <= {"check_iprbw_to_ss_osr_row", "check_iprbw_to_ss_osr_col"}  # finer pixels than a reader needs


@pytest.mark.parametrize("normal, turn", thinned([1.0, -1.0], TURNS))
def test_rows_lead_away_from_the_antenna_however_the_grid_lies(tmp_path, turn, normal):
    case = aircraft(False)
    image = focused(case, TURNS[turn], normal)
    path = saved(case, image, tmp_path / "x.ntf", version="1.4.0")
    assert errors(path)[0] == set()
    back = sarcl.read(path)
    corner, axes = frame(case)
    index = back.grid.index(corner + image.grid.positions @ axes)
    i, j = np.rint(index).astype(int).reshape(-1, 2).T
    assert np.abs(index.reshape(-1, 2) - np.stack([i, j], axis=1)).max() < 1e-6
    assert np.asarray(back)[i, j].tobytes() == image.data.tobytes()  # every bit


def test_targets_are_located_by_the_projection_of_the_standard(case, written):
    """The brightest place of a target in the file's own pixels, projected to the target's height, by sarkit alone."""
    tree, pixels = contents(written[1])
    known = projection.MetadataParams.from_xml(tree)
    limit = min(case.resolution / 10, 0.03)
    for target in case.targets:
        place, _, found = projection.scene_to_image(known, target)
        assert found
        peak = brightest(tree, pixels, place)
        height = float(sarcl.wgs84.geodetic(target)[2])
        shown, *_ = sicd.image_to_constant_hae_surface(tree, peak, height)
        assert np.linalg.norm(shown - target) < limit


def test_a_target_above_the_plane_is_located_by_the_tracks(case, tmp_path):
    """It lies elsewhere on the plane, by its layover: the file's times and tracks lead back to its height."""
    raw = case.raw
    corner, axes = frame(case)
    longitude, latitude, height = (float(v) for v in sarcl.wgs84.geodetic(case.targets[0]))
    target = sarcl.wgs84.ecef(longitude, latitude, height + 3.0) + np.array([3.0, -2.0, 0.0])
    delay = two_way(raw.tx, raw.rx, axes @ (target - corner)) - 2 * raw.reference_range
    frequency = raw.frequency[:, None] + np.arange(raw.n_samples) * raw.frequency_step[:, None]
    one = replace(case, raw=replace(raw, samples=np.exp(-2j * np.pi / C * delay[:, None] * frequency).astype("c8")))
    tree, pixels = contents(saved(one, focused(one), tmp_path / "x.nitf"))
    place, _, found = projection.scene_to_image(projection.MetadataParams.from_xml(tree), target)
    assert found
    assert 3 < np.linalg.norm(place) < 11
    shown, *_ = sicd.image_to_constant_hae_surface(
        tree, brightest(tree, pixels, place), float(sarcl.wgs84.geodetic(target)[2])
    )
    assert np.linalg.norm(shown - target) < min(case.resolution / 10, 0.03)


def frame(case):
    """Origin and axes (3, 3) of the case's coordinates, Earth-fixed."""
    if not case.origin:
        return np.zeros(3), np.eye(3)
    latitude, longitude, height = case.origin
    return sarcl.wgs84.ecef(longitude, latitude, height), sarcl.wgs84.local_axes(longitude, latitude)


def brightest(tree, pixels, place):
    """Image coordinates, m (2,), of the largest sum of waves near a place: the spectrum of the pixels, evaluated."""
    row, column = np.rint(sicd.xrowycol_to_rowcol(tree, place)).astype(int)
    part = pixels[row - 24 : row + 24, column - 24 : column + 24]
    values = np.fft.fft2(part * np.outer(np.hanning(49)[:48], np.hanning(49)[:48]))
    fine = np.linspace(-1.5, 1.5, 121)
    k = np.fft.fftfreq(48)
    rows = np.exp(2j * np.pi * np.outer(fine + 24, k))
    power = np.abs(rows @ values @ rows.T) ** 2
    i, j = np.unravel_index(int(np.argmax(power)), power.shape)
    return sicd.rowcol_to_xrowycol(tree, np.array([row + fine[i], column + fine[j]]))


def test_the_spectrum_lies_where_the_metadata_say(case, written):
    """Of the whole image: within DeltaK1 ... DeltaK2, about the middles of DeltaKCOA, and no wider than ImpRespBW."""
    tree, pixels = contents(written[1])
    power = np.abs(np.fft.fft2(pixels)) ** 2  # Sgn = -1: S(k) = sum s exp(-j 2 pi k r)
    helper = sicd.XmlHelper(tree)
    for axis, side in enumerate(SIDES):
        assert number(tree, f"Grid/{side}/Sgn") == -1
        step, width = number(tree, f"Grid/{side}/SS"), number(tree, f"Grid/{side}/ImpRespBW")
        low, high = (number(tree, f"Grid/{side}/DeltaK{i}") for i in (1, 2))
        k = np.fft.fftfreq(pixels.shape[axis], step)
        share = power.sum(axis=1 - axis) / power.sum()
        assert high - low < 0.7 / step  # it does not go around the band of the samples
        assert share[(k > low) & (k < high)].sum() > 0.97
        middle = helper.load(f"{{*}}Grid/{{*}}{side}/{{*}}DeltaKCOAPoly")[0, 0]
        assert (share * k).sum() == pytest.approx(middle, abs=0.1 * width)


def test_the_carrier_is_that_of_the_geometry(case, written):
    """KCtr + DeltaKCOA at the centre: f grad tau at the middle of the pulses and of the band, by differences."""
    tree, _ = contents(written[1])
    raw, helper = case.raw, sicd.XmlHelper(tree)
    axes = [helper.load(f"{{*}}Grid/{{*}}{side}/{{*}}UVectECF") for side in SIDES]
    if case.origin:
        axes = [frame(case)[1] @ axis for axis in axes]
    point = np.zeros(3) if case.origin else case.targets[0]
    tx, rx, f = raw.tx[raw.n_rows // 2], raw.rx[raw.n_rows // 2], raw.center_frequency[0]
    for side, axis in zip(SIDES, axes, strict=True):
        ends = [np.linalg.norm(tx - x) + np.linalg.norm(rx - x) for x in (point - 0.5 * axis, point + 0.5 * axis)]
        k = number(tree, f"Grid/{side}/KCtr") + helper.load(f"{{*}}Grid/{{*}}{side}/{{*}}DeltaKCOAPoly")[0, 0]
        assert k == pytest.approx(f / C * (ends[1] - ends[0]), abs=0.1 * number(tree, f"Grid/{side}/ImpRespBW"))


def test_half_power_widths_are_those_of_the_pixels(case, tmp_path):
    one = replace(case, raw=replace(case.raw, samples=np.ones_like(case.raw.samples)))  # a target at the reference
    tree, pixels = contents(saved(one, focused(one, shape=(80, 80)), tmp_path / "x.nitf"))
    row, column = (int(number(tree, f"ImageData/SCPPixel/{side}")) for side in SIDES)
    for axis, side in enumerate(SIDES):
        cut = pixels[:, column] if axis == 0 else pixels[row]
        at = (row, column)[axis]
        fine = np.linspace(-12, 12, 2401)
        spectrum = np.fft.fft(cut[at - 32 : at + 32])
        power = np.abs(np.exp(2j * np.pi * np.outer(fine + 32, np.fft.fftfreq(64))) @ spectrum) ** 2
        half = fine[power > power.max() / 2]
        measured = np.ptp(half[np.abs(half) < 8]) * number(tree, f"Grid/{side}/SS")
        assert measured == pytest.approx(number(tree, f"Grid/{side}/ImpRespWid"), rel=0.03)


def test_the_image_returns(case, written):
    image, path = written
    back = sarcl.read(path)
    assert back.frame == "earth-fixed"
    assert back.frequency == pytest.approx(image.frequency, abs=float(case.raw.frequency_step[0]))
    assert back.polarization == "VH"
    assert back.gain == image.gain
    np.testing.assert_allclose(back.band, image.band)
    assert "<CollectorName>sarcl</CollectorName>" in back.metadata
    for target in case.targets:
        assert np.linalg.norm(sarcl.measure(back, near=target).position - target) < 0.03
    assert not np.asarray(back)[:0].size
    np.testing.assert_array_equal(back.data[10:20, 3:7], np.asarray(back)[10:20, 3:7])
    np.testing.assert_array_equal(back.data[5:50:9], np.asarray(back)[5:50:9])
    np.testing.assert_array_equal(back.data[-1], np.asarray(back)[-1])


def test_times_and_tracks_are_those_of_the_pulses(case, written):
    tree, _ = contents(written[1])
    known = projection.MetadataParams.from_xml(tree)
    raw, middle = case.raw, case.raw.n_rows // 2
    ends = projection.compute_coa_pos_vel(known, known.t_SCP_COA)
    corner, axes = frame(case)
    tx, rx = corner + raw.tx[middle] @ axes, corner + raw.rx[middle] @ axes
    if is_bistatic(case):
        np.testing.assert_allclose(ends.Xmt_COA, tx, atol=2e-3)
        np.testing.assert_allclose(ends.Rcv_COA, rx, atol=2e-3)
        assert known.Collect_Type == "BISTATIC"
    else:
        np.testing.assert_allclose(ends.ARP_COA, (tx + rx) / 2, atol=2e-3)
    start = np.datetime64(tree.findtext("{*}Timeline/{*}CollectStart").rstrip("Z"))
    sent = start + np.timedelta64(round(known.t_SCP_COA * 1e9), "ns") - np.datetime64(METADATA["CollectionStart"])
    flight = 0.0 if raw.is_monostatic else np.linalg.norm(tx - case.targets[0]) / C
    assert sent / np.timedelta64(1, "s") == pytest.approx(raw.time[middle] + flight, abs=2e-6)


def test_an_image_under_a_beam_is_seen_pixel_by_pixel(tmp_path):
    """A strip map: every pixel has the middle of its own pulses, and the same bandwidth."""
    time = np.linspace(-2.0, 2.0, 321)
    velocity = np.array([0, 100.0, 0])
    tx = np.array([-8e3, 0, 6e3]) + time[:, None] * velocity
    raw = sarcl.echo(
        sarcl.Scene.points([[0.0, 60.0, 0.0]]),
        sarcl.Waveform.chirp(center=9.6e9, bandwidth=100e6, duration=1e-6),
        sarcl.Trajectory(time, tx, np.tile(velocity, (321, 1))),
    )
    grid = sarcl.ImageGrid.plane(shape=(200, 60), spacing=(0.6, 0.6))
    image = sarcl.backproject(raw, grid, beam=(0.02, (0.8, 0.0, -0.6)))
    assert image.aperture is not None
    case_like = {"collection": raw, "metadata": METADATA, "origin": (47.2, 8.5, 420.0)}
    image.save(tmp_path / "x.nitf", **case_like)
    assert errors(tmp_path / "x.nitf")[0] == set()
    tree, _ = contents(tmp_path / "x.nitf")
    known = projection.MetadataParams.from_xml(tree)
    for along in (-40.0, 0.0, 40.0):
        x = np.array([0.0, along])  # rows lead east, columns north
        assert projection.compute_coa_time(known.cT_COA, x) - known.t_SCP_COA == pytest.approx(along / 100, abs=0.03)
    assert number(tree, "Grid/Col/ImpRespBW") == pytest.approx(2 * 9.65e9 / C * 0.02, rel=0.06)


@pytest.mark.parametrize("window", [None, pytest.param("hamming", marks=pytest.mark.slow)])
def test_the_scale_factors_give_the_backscatter_of_clutter_and_the_cross_section_of_a_point(tmp_path, window):
    """Points of a known mean power per area, whose pixels sarkit reads."""
    rng, half, n = np.random.default_rng(11), 40.0, 3000
    places = np.pad(rng.uniform(-half, half, (n, 2)), ((0, 0), (0, 1)))
    amplitudes = (rng.normal(size=n) + 1j * rng.normal(size=n)) * np.sqrt(0.02 * (2 * half) ** 2 / n / 2)
    track = sarcl.Trajectory.line(start=(-8e3, -60, 6e3), velocity=(0, 100, 0), prf=100.0, n_pulses=121)
    chirp = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6)
    window_of_echoes = {"range_window": (-60, 60), "reference": (0, 0, 0)}
    plane = sarcl.ImageGrid.plane(shape=(100, 100), spacing=0.5)
    clutter, point = sarcl.Scene.points(places, amplitudes=amplitudes), sarcl.Scene.points([[3.0, -4.0, 0.0]])
    for scene, wanted in ((clutter, None), (point, 1)):
        raw = sarcl.echo(scene, chirp, track, **window_of_echoes)
        image = sarcl.backproject(raw, plane, window=window)
        image.save(tmp_path / "x.nitf", collection=raw, metadata=METADATA, origin=(47.2, 8.5, 420.0))
        assert errors(tmp_path / "x.nitf")[0] == set()
        tree, pixels = contents(tmp_path / "x.nitf")
        scale = {k: number(tree, f"Radiometric/{k}SFPoly/Coef") for k in ("RCS", "SigmaZero", "BetaZero", "GammaZero")}
        power = np.abs(pixels.astype(np.complex128)) ** 2
        if wanted is None:
            is_seen = (np.abs(places[:, :2]) < 25).all(axis=1)
            density = (np.abs(amplitudes[is_seen]) ** 2).sum() / 50**2
            assert power.mean() * scale["SigmaZero"] == pytest.approx(density, rel=0.1)  # of some 1000 cells
        else:
            assert power.max() * scale["RCS"] == pytest.approx(wanted, rel=1e-3)  # a pixel lies on it
        assert scale["SigmaZero"] / scale["BetaZero"] == pytest.approx(0.8)  # sine of the incidence
        assert scale["SigmaZero"] / scale["GammaZero"] == pytest.approx(0.6)  # and its cosine


def test_other_rows_than_those_of_the_image_are_refused(tmp_path):
    """Every second row has the same middle, band, first and last pulse."""
    case = aircraft(False)
    for window in (None, "hamming"):
        image = focused(case, window=window, shape=(40, 40))
        for rows in (slice(None, None, 2), slice(0, 80)):
            other = replace(case, raw=case.raw[rows])
            with pytest.raises(ValueError, match="give the phase history that the image was made of"):
                saved(other, image, tmp_path / "x.nitf")
    saved(case, replace(image, gain=1.0), tmp_path / "x.nitf")  # of an unknown gain
    assert contents(tmp_path / "x.nitf")[0].find("{*}Radiometric") is None


@pytest.mark.parametrize("key", METADATA)
def test_what_is_missing_is_refused_with_its_key(tmp_path, key):
    case = aircraft(False)
    words = {k: v for k, v in METADATA.items() if k != key}
    with pytest.raises(ValueError, match=f"metadata={{'{key}'"):
        saved(case, focused(case, shape=(20, 20)), tmp_path / "x.nitf", metadata=words)
    assert not list(tmp_path.iterdir())


def test_names_of_a_cphd_file_need_not_be_given_again(tmp_path):
    case = aircraft(False)
    case.raw.save(tmp_path / "x.cphd", origin=case.origin, metadata={**METADATA, "ReleaseInfo": "any"})
    raw = sarcl.read(tmp_path / "x.cphd")
    _, place = frame(case)
    grid = sarcl.ImageGrid.plane(center=case.targets[0], shape=60, spacing=0.25, normal=place[2], x_axis=place[0])
    sarcl.backproject(raw, grid).save(tmp_path / "x.nitf", collection=raw)
    tree, _ = contents(tmp_path / "x.nitf")
    assert tree.findtext("{*}CollectionInfo/{*}CoreName") == "targets"
    start = np.datetime64(tree.findtext("{*}Timeline/{*}CollectStart").rstrip("Z"))
    assert abs(start - np.datetime64("2026-01-02T03:04:04.250")) < np.timedelta64(1, "us")


def test_wrong_arguments_are_refused(tmp_path):
    case = aircraft(False)
    image, path = focused(case, shape=(40, 40)), tmp_path / "x.sicd"
    other = aircraft(True)
    resting = np.tile(case.raw.tx[:1], (161, 1))
    for options, words in (
        ({"collection": None}, "give collection="),
        ({"origin": None}, r"give origin=\(latitude"),
        ({"metadata": {**METADATA, "Colour": "red"}}, "metadata has 'Colour'"),
        ({"metadata": {**METADATA, "ModeType": "SPOT"}}, "ModeType"),
        ({"metadata": {**METADATA, "Classification": "blue"}}, "begins with TOP SECRET"),
        ({"version": "1.2.0"}, "version is '1.2.0'"),
        ({"collection": other.raw}, "image.rx is"),
        ({"collection": case.raw[:80]}, "image.tx is"),
    ):
        with pytest.raises(ValueError, match=words):
            saved(case, image, path, **options)
    still = replace(case.raw, tx=resting, rx=None)
    with pytest.raises(ValueError, match="the antenna rests"):
        saved(case, replace(image, tx=None, rx=None), path, collection=still)
    bent = case.raw.tx + 40 * np.sign(np.sin(np.arange(161)))[:, None]
    with pytest.raises(ValueError, match="from any polynomial of degree 8"):
        saved(case, replace(image, tx=None, rx=None), path, collection=replace(case.raw, tx=bent, rx=None))
    with pytest.raises(ValueError, match="'IlluminatorName'"):
        saved(other, focused(other, shape=(40, 40)), path, metadata=METADATA)
    with pytest.raises(ValueError, match=r"version is '1.3.0'; choose one of '1.4.0'"):
        saved(other, focused(other, shape=(40, 40)), path, version="1.3.0")
    for wrong, words in (
        (image[:1], "two rows and columns"),
        (image.multilook(2), "SICD holds complex images"),
        (sarcl.polar_format(case.raw, image.grid), "polar_format takes wavefronts for planes"),
        (sarcl.Image(np.zeros((3, 2), "c8"), sarcl.ImageGrid.points(np.ones((3, 2, 3)))), "lists its points"),
        (replace(image, data=np.where(np.eye(40), np.nan, image.data)), r"image data\[\d+, \d+\] is \(nan"),
    ):
        with pytest.raises(ValueError, match=words):
            saved(case, wrong, path)
    coarse = sarcl.Image(np.zeros((10, 10), "c8"), sarcl.ImageGrid.plane(shape=10, spacing=2.0))
    with pytest.raises(ValueError, match="focus on a finer grid"):
        saved(case, coarse, path)
    with pytest.raises(ValueError, match=r"for SICD \(.nitf, .ntf or .sicd\), and"):
        image.save(tmp_path / "x.h5", collection=case.raw)
    with pytest.raises(TypeError, match="colour"):
        image.save(path, colour=1)
    assert not list(tmp_path.iterdir())


def test_the_metadata_stay_in_other_files(tmp_path):
    case = aircraft(False)
    back = sarcl.read(saved(case, focused(case, shape=(40, 30)), tmp_path / "x.nitf"))
    back.save(tmp_path / "x.h5")
    assert sarcl.read(tmp_path / "x.h5").metadata == back.metadata
    assert back[5:20, ::2].grid.shape == (15, 20)


@pytest.mark.parametrize(
    "window, wider",
    quick_of(
        [("hamming", 1.47), (("taylor", 35, 5), 1.35)], [(None, 1.0), ("hamming", 1.47), (("taylor", 35, 5), 1.35)]
    ),
)
def test_windows_widen_the_response(tmp_path, window, wider):
    case = aircraft(False)
    widths = []
    for one in (None, window):
        tree, _ = contents(saved(case, focused(case, shape=(60, 60), window=one), tmp_path / "x.nitf"))
        widths.append(number(tree, "Grid/Row/ImpRespWid"))
    assert widths[1] / widths[0] == pytest.approx(wider, rel=0.04)
    assert sarcl.read(tmp_path / "x.nitf").window == focused(case, shape=(8, 8), window=window).window


def test_weights_without_a_name_need_a_width(tmp_path):
    case = aircraft(False)
    image = focused(case, shape=(60, 60), window=(np.ones(96), None))
    with pytest.raises(ValueError, match="'ImpRespWid'"):
        saved(case, image, tmp_path / "x.nitf")
    saved(case, image, tmp_path / "x.nitf", metadata={**METADATA, "ImpRespWid": (1.1, 0.7)})


def test_images_of_several_segments_are_written_and_read(tmp_path, monkeypatch):
    """NITF holds 10 GB in a segment: here 20 kB; rows lead east, away from the antenna."""
    monkeypatch.setattr(importlib.import_module("sarkit.sicd._constants"), "IS_SIZE_MAX", 20_000)
    monkeypatch.setattr(importlib.import_module("sarcl.io.sicd.writing"), "BLOCK_BYTES", 7_000)
    case, shape = aircraft(False), (30, 200)
    values = np.random.default_rng(5).normal(size=(2, *shape)).astype("f4")
    image = sarcl.Image(values[0] + 1j * values[1], sarcl.ImageGrid.plane(shape=shape, spacing=0.3))
    path = saved(case, image, tmp_path / "x.nitf")
    with open(path, "rb") as file, sicd.NitfReader(file) as reader:
        assert len(reader.jbp["ImageSegments"]) == 3
    back = sarcl.read(path)
    corner, axes = frame(case)
    i, j = np.rint(back.grid.index(corner + image.grid.positions @ axes)).astype(int).reshape(-1, 2).T
    assert np.asarray(back)[i, j].tobytes() == image.data.tobytes()
    np.testing.assert_array_equal(back.data[60:150], np.asarray(back)[60:150])
