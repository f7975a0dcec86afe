"""CPHD: files that sarcl writes, as sarkit's checker judges them, and focused by sarcl and by the standard alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from earth_targets import AMPLITUDES, CASES, OFFSETS, ORIGIN, C, aircraft, two_way
from helpers.cases import quick_of

import sarcl

cphd = pytest.importorskip("sarkit.cphd", reason="no sarkit: pip install sarcl[formats]")
pytestmark = pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning")  # within sarkit
verification = pytest.importorskip("sarkit.verification")

METADATA = {
    "CollectorName": "sarcl",
    "CoreName": "targets",
    "ModeType": "SPOTLIGHT",
    "Classification": "UNCLASSIFIED",
    "ReleaseInfo": "UNRESTRICTED",
    "CollectionStart": "2026-01-02T03:04:05.250000",
}
VARIANTS = [(domain, sgn) for domain in ("FX", "TOA") for sgn in (-1, 1)]


QUICK = ("aircraft", True), ("orbit", False)  # with SLOW, both platforms, mono- and bistatic
SLOW = ("aircraft", False), ("orbit", True)


@pytest.fixture(
    scope="module",
    params=[*QUICK, *(pytest.param(each, marks=pytest.mark.slow) for each in SLOW)],
    ids=lambda p: f"{p[0]}-{'bi' if p[1] else 'mono'}static",
)
def case(request):
    name, is_bistatic = request.param
    return CASES[name](is_bistatic)


def words_of(case):
    return METADATA if case.origin else {**METADATA, "SRPPos": case.targets[0]}


def saved(case, path, **options):
    case.raw.save(path, **{"metadata": words_of(case), "origin": case.origin, **options})
    return path


def channel_of(path):
    """The first channel as sarkit reads it: tree, signal, per-vector parameters."""
    with open(path, "rb") as file, cphd.Reader(file) as reader:
        tree = reader.metadata.xmltree
        name = tree.findtext("{*}Data/{*}Channel/{*}Identifier")
        return (tree, *reader.read_channel(name))


def errors(path):
    """Errors and warnings of sarkit's checker by name."""
    with open(path, "rb") as file:
        judge = verification.CphdConsistency.from_file(file, thorough=True)
        judge.check()
    kinds = {"Error": set(), "Warning": set()}
    for name, outcome in judge.failures().items():
        for detail in outcome["details"]:
            if not detail["passed"]:
                kinds[detail["severity"]].add(name)
    return kinds["Error"], kinds["Warning"]


@pytest.mark.parametrize("version", ["1.0.1", "1.1.0"])
@pytest.mark.parametrize(("domain", "sgn"), VARIANTS)
def test_the_checker_of_sarkit_finds_no_error(case, tmp_path, domain, sgn, version):
    path = saved(case, tmp_path / "x.cphd", domain=domain, sgn=sgn, version=version)
    wrong, advice = errors(path)
    assert wrong == set()
    assert advice <= {"check_image_grid_exists"}  # a grid of pixels is the reader's choice


def test_a_receiver_on_another_platform_is_bistatic(case, request, tmp_path):
    tree, *_ = channel_of(saved(case, tmp_path / "x.cphd"))
    kind = "BISTATIC" if request.node.callspec.params["case"][1] else "MONOSTATIC"
    assert tree.findtext("{*}CollectionID/{*}CollectType") == kind


def test_echoes_arrive_when_light_has_gone_to_the_reference_point_and_on(case, tmp_path):
    *_, pvp = channel_of(saved(case, tmp_path / "x.cphd"))
    path = two_way(pvp["TxPos"], pvp["RcvPos"], pvp["SRPPos"])
    np.testing.assert_allclose(pvp["RcvTime"] - pvp["TxTime"], path / C, rtol=0, atol=1e-12)
    assert not pvp["aFDOP"].any()  # not given: the simple phase model holds


@pytest.mark.parametrize(("domain", "sgn"), VARIANTS)
def test_samples_and_geometry_return(case, tmp_path, domain, sgn):
    back = sarcl.read(saved(case, tmp_path / "x.cphd", domain=domain, sgn=sgn))
    raw, samples = case.raw, back.read(0, back.n_rows)
    assert back.samples.shape == raw.samples.shape
    np.testing.assert_allclose(back.frequency, raw.frequency, rtol=1e-15)
    np.testing.assert_allclose(back.reference_range, raw.reference_range, rtol=0, atol=2e-8)
    assert np.linalg.norm(samples - raw.samples) <= 2e-6 * np.linalg.norm(raw.samples)
    assert set(back.polarization) == {"VH"}
    np.testing.assert_allclose(np.diff(back.time), np.diff(raw.time), atol=1e-9)
    assert back.is_monostatic == raw.is_monostatic


@pytest.mark.parametrize(("domain", "sgn"), VARIANTS)
def test_targets_are_where_they_were_by_the_equations_of_the_standard(case, tmp_path, domain, sgn):
    """Files as sarkit reads them, focused with Phase(fx) = SGN fx dTOA, Phase(peak) = SGN fxC dTOA, without sarcl."""
    _, signal, pvp = channel_of(saved(case, tmp_path / "x.cphd", domain=domain, sgn=sgn))
    reference = two_way(pvp["TxPos"], pvp["RcvPos"], pvp["SRPPos"])
    axis = pvp["SC0"][:, None] + np.arange(signal.shape[1]) * pvp["SCSS"][:, None]
    for target, amplitude in zip(case.targets, AMPLITUDES, strict=True):
        dtoa = (two_way(pvp["TxPos"], pvp["RcvPos"], target) - reference) / C
        assert (np.abs(dtoa) < np.minimum(-pvp["TOA1"], pvp["TOA2"])).all()
        if domain == "FX":
            terms = (signal * np.exp(-2j * np.pi * sgn * axis * dtoa[:, None])).mean(axis=1)
        else:
            center, band = (pvp["FX1"] + pvp["FX2"]) / 2, pvp["FX2"] - pvp["FX1"]
            kernel = np.sinc(band[:, None] * (axis - dtoa[:, None])) * (band * pvp["SCSS"])[:, None]
            terms = (signal * kernel).sum(axis=1) * np.exp(-2j * np.pi * sgn * center * dtoa)
        assert abs(terms.mean()) == pytest.approx(amplitude, abs=0.12)
        moved = target + np.array([2.0, 0, 0]) * case.resolution
        shifted = (two_way(pvp["TxPos"], pvp["RcvPos"], moved) - reference) / C
        if domain == "FX":
            assert abs((signal * np.exp(-2j * np.pi * sgn * axis * shifted[:, None])).mean()) < 0.5


@pytest.mark.parametrize("domain, sgn", quick_of([("FX", -1), ("TOA", 1)], VARIANTS))
def test_targets_are_focused_and_located(case, tmp_path, domain, sgn):
    path = saved(case, tmp_path / "x.cphd", domain=domain, sgn=sgn)
    raw = sarcl.read(path)
    tree, *_ = channel_of(path)
    longitude, latitude, _ = sarcl.wgs84.geodetic(raw.image_area[0])
    east, _, up = sarcl.wgs84.local_axes(float(longitude), float(latitude))
    for target in case.targets:
        grid = sarcl.ImageGrid.plane(center=target, shape=128, spacing=case.resolution / 4, normal=up, x_axis=east)
        response = sarcl.measure(sarcl.backproject(raw, grid), near=target)
        error = cphd.ecf_to_iac(tree, response.position) - cphd.ecf_to_iac(tree, target)
        assert np.linalg.norm(error[:2]) < min(case.resolution / 10, 0.03)


def test_the_default_grid_is_the_image_area(case, tmp_path):
    words = {**words_of(case), "ImageArea": ((-12, -9), (12, 9))}
    path = saved(case, tmp_path / "x.cphd", metadata=words)
    grid = sarcl.default_grid(sarcl.read(path))
    sides = np.array(grid.shape) * grid.spacing
    np.testing.assert_allclose(sides, (18, 24), atol=max(grid.spacing))
    tree, *_ = channel_of(path)
    corner = cphd.ecf_to_iac(tree, grid.at(0, 0))
    np.testing.assert_allclose(corner, (-12, -9, 0), atol=max(grid.spacing))


def test_references_apart_from_the_point_are_moved_to_it_exactly(tmp_path):
    """A reference point 40 m off: the same targets, in a swath that is not centred on it."""
    case = aircraft(False)
    far = {**METADATA, "SRPPos": (25.0, -30.0, 4.0)}
    for domain, sgn in VARIANTS:
        path = saved(case, tmp_path / "x.cphd", metadata=far, domain=domain, sgn=sgn)
        assert errors(path)[0] == set()
        raw = sarcl.read(path)
        grid = sarcl.ImageGrid.points(case.targets)
        values = sarcl.backproject(raw, grid, tolerance=1e-5).normalized()
        direct = sarcl.backproject(case.raw, sarcl.ImageGrid.points(np.pad(OFFSETS, ((0, 0), (0, 1)))), tolerance=1e-5)
        np.testing.assert_allclose(np.abs(values), np.abs(direct.normalized()), atol=2e-4)


def test_channels_are_polarisations_and_elements(tmp_path):
    case = aircraft(False)
    n = case.raw.n_rows
    parts = [
        replace(case.raw, polarization=np.full(n, p), rx_channel=np.full(n, k), tx_channel=np.zeros(n, int))
        for k, p in ((0, "HH"), (0, "HV"), (1, "RL"))
    ]
    raw = sarcl.concatenate(parts)
    order = np.arange(3 * n).reshape(3, n).T.ravel()  # rows by time, channels in turns
    path = tmp_path / "x.cphd"
    raw[order].save(path, origin=ORIGIN, metadata=METADATA)
    assert errors(path)[0] == set()
    back = sarcl.read(path)
    assert back.n_rows == 3 * n
    for part in parts:
        label, channel = str(part.polarization[0]), int(part.rx_channel[0])
        rows = back.select(polarization=label, channel=channel)
        assert np.linalg.norm(rows.read(0, n) - part.samples) < 1e-6 * np.linalg.norm(part.samples)
        assert sarcl.read(path, polarization=label).n_rows == n
    assert sarcl.read(path, channel="3").polarization[0] == "RL"
    assert sarcl.read(path, channel=0).n_rows == 2 * n
    with pytest.raises(ValueError, match=r"has no channel '7': it has channel '1' \(H:H\)"):
        sarcl.read(path, channel="7")


def diverse(receive="reference", channels="separated"):
    """9 pulses of an array of 4 carriers, whose order is reversed after 4 pulses; one sample per carrier."""
    array = sarcl.AntennaArray.linear(4, spacing=0.015, frequency_step=2e6, axis=(0, 1, 0)).mirrored(at=4, n_pulses=9)
    pulse = sarcl.Waveform.tone(center=10e9, duration=5e-7)
    track = sarcl.Trajectory.line(start=(-3e3, -20, 2e3), velocity=(0, 100, 0), prf=50.0, n_pulses=9)
    scene = sarcl.Scene.points([[3.0, 2.0, 0.0]])
    return sarcl.echo(scene, pulse, track, array=array, channels=channels, receive=receive, reference=(0, 0, 0))


@pytest.mark.parametrize(
    ("domain", "sgn", "receive"), [("TOA", -1, "own"), pytest.param("FX", 1, "all", marks=pytest.mark.slow)]
)
def test_elements_of_a_frequency_diverse_array_are_channels_with_their_carriers(tmp_path, domain, sgn, receive):
    raw, path = diverse(receive), tmp_path / "x.cphd"
    raw.save(path, origin=ORIGIN, metadata=METADATA, domain=domain, sgn=sgn)
    assert errors(path)[0] == set()
    with open(path, "rb") as file, cphd.Reader(file) as reader:
        names = [each.text for each in reader.metadata.xmltree.findall("{*}Data/{*}Channel/{*}Identifier")]
        starts = {name: np.unique(reader.read_pvps(name)["FX1"]) for name in names}
    n_receivers = 4 if receive == "all" else 1
    assert len(starts) == 2 * 4 * n_receivers  # each element sends two carriers
    assert all(len(start) == 1 for start in starts.values())
    assert len(np.unique(np.concatenate(list(starts.values())))) == 4
    back = sarcl.read(path)
    order, same = (np.lexsort((rows.rx_channel, rows.tx_channel, rows.time)) for rows in (back, raw))
    for name in ("frequency", "frequency_step", "reference_range", "tx_channel", "rx_channel", "time", "polarization"):
        ours, theirs = getattr(raw, name)[same], getattr(back, name)[order]
        if ours.dtype.kind == "f":
            np.testing.assert_allclose(theirs, ours, rtol=1e-15, atol=2e-8 if name == "reference_range" else 0)
        else:
            np.testing.assert_array_equal(theirs, ours)
    local, corner = sarcl.wgs84.local_axes(ORIGIN[1], ORIGIN[0]), sarcl.wgs84.ecef(ORIGIN[1], ORIGIN[0], ORIGIN[2])
    np.testing.assert_allclose((back.tx[order] - corner) @ local.T, raw.tx[same], atol=1e-8)
    np.testing.assert_allclose((back.rx[order] - corner) @ local.T, raw.rx[same], atol=1e-8)
    np.testing.assert_allclose(back[order].read(0, back.n_rows), raw[same].read(0, raw.n_rows), atol=2e-6)


def test_sums_over_the_elements_of_an_array_are_refused(tmp_path):
    raw = diverse(channels="simultaneous")
    with pytest.raises(ValueError, match=r"sums over the 4 elements.*channels='separated'"):
        raw.save(tmp_path / "x.cphd", origin=ORIGIN, metadata=METADATA)
    for mapping in ("channels", "corrected"):
        sarcl.map_aperture(raw, mapping).save(tmp_path / "x.cphd", origin=ORIGIN, metadata=METADATA)
        assert sarcl.read(tmp_path / "x.cphd").n_rows == (36 if mapping == "channels" else 9)


@pytest.mark.parametrize("key", METADATA)
def test_what_is_missing_is_refused_with_its_key(tmp_path, key):
    words = {k: v for k, v in METADATA.items() if k != key}
    with pytest.raises(ValueError, match=f"metadata={{'{key}'"):
        aircraft(False).raw.save(tmp_path / "x.cphd", origin=ORIGIN, metadata=words)
    assert not list(tmp_path.iterdir())


def test_all_that_is_missing_is_named_at_once(tmp_path):
    raw = replace(aircraft(False).raw, time=None, rx_velocity=None)
    words = {k: v for k, v in METADATA.items() if k not in ("ModeType", "CollectionStart")}
    wanted = r"give metadata=\{'TxTime': \.\.\.\}; it must have RcvVel, ModeType, CollectionStart too$"
    with pytest.raises(ValueError, match=wanted):
        raw.save(tmp_path / "x.cphd", origin=ORIGIN, metadata=words)


@pytest.mark.parametrize(
    ("field", "key"),
    [("time", "TxTime"), ("tx_velocity", "TxVel"), ("rx_velocity", "RcvVel"), ("polarization", "TxPol")],
)
def test_rows_that_are_missing_are_refused_with_their_key(tmp_path, field, key):
    case = aircraft(False)
    raw = replace(case.raw, **{field: None})
    with pytest.raises(ValueError, match=f"metadata={{'{key}'"):
        raw.save(tmp_path / "x.cphd", origin=ORIGIN, metadata=METADATA)
    values = {"TxPol": "V", "RcvPol": "H"} if field == "polarization" else {key: getattr(case.raw, field)}
    raw.save(tmp_path / "x.cphd", origin=ORIGIN, metadata={**METADATA, **values})
    assert errors(tmp_path / "x.cphd")[0] == set()


def test_wrong_arguments_are_refused(tmp_path):
    raw = aircraft(False).raw
    path = tmp_path / "x.cphd"
    for options, words in (
        ({"metadata": METADATA}, r"give origin=\(latitude"),
        ({"origin": ORIGIN, "metadata": {**METADATA, "Colour": "red"}}, "metadata has 'Colour'"),
        ({"origin": ORIGIN, "metadata": METADATA, "domain": "fx"}, "domain"),
        ({"origin": ORIGIN, "metadata": METADATA, "sgn": 0}, "sgn is 0"),
        ({"origin": ORIGIN, "metadata": METADATA, "version": "1.2.0"}, "version"),
        ({"origin": (91, 0, 0), "metadata": METADATA}, "origin is"),
        ({"origin": ORIGIN, "metadata": METADATA, "axes": -np.eye(3)}, "axes are not"),
    ):
        with pytest.raises(ValueError, match=words):
            raw.save(path, **options)
    with pytest.raises(ValueError, match="are for CPHD"):
        raw.save(tmp_path / "x.h5", origin=ORIGIN)
    with pytest.raises(ValueError, match="not compressed"):
        replace(raw, compressed=False).save(path, origin=ORIGIN, metadata=METADATA)
    with pytest.raises(ValueError, match="times of the rows"):
        raw[::-1].save(path, origin=ORIGIN, metadata=METADATA)
    assert not list(tmp_path.iterdir())


def test_the_file_keeps_its_xml_through_hdf5(tmp_path):
    case = aircraft(False)
    raw = sarcl.read(saved(case, tmp_path / "x.cphd"))
    assert "<CollectorName>sarcl</CollectorName>" in raw.metadata
    raw.save(tmp_path / "x.h5")
    back = sarcl.read(tmp_path / "x.h5")
    assert back.metadata == raw.metadata
    np.testing.assert_array_equal(back.image_area, raw.image_area)
