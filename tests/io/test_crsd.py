"""CRSD: files that sarcl writes, as sarkit's checker judges them, and by the equations of the standard alone."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from earth_targets import AMPLITUDES, CASES, ORIGIN, C, aircraft, two_way

import sarcl

crsd = pytest.importorskip("sarkit.crsd", reason="no sarkit: pip install sarcl[formats]")
verification = pytest.importorskip("sarkit.verification")
pytestmark = [
    pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning"),  # within sarkit
    pytest.mark.filterwarnings("ignore:divide by zero:RuntimeWarning"),  # of its checker, of a bistatic angle of 0
]
METADATA = {
    "CollectorName": "sarcl",
    "CoreName": "targets",
    "ModeType": "SPOTLIGHT",
    "Classification": "UNCLASSIFIED",
    "ReleaseInfo": "UNRESTRICTED",
    "CollectionStart": "2026-01-02T03:04:05.250000",
}
NUMBERS = {"TxRefRadIntensity": 1e6, "TxRadIntErrorStdDev": 0.1, "TxRefLAtm": 0.2, "RcvRefIrradiance": 1e-9}
NUMBERS |= {"RcvIrradianceErrorStdDev": 0.1, "RcvRefLAtm": 0.2, "PNCRSD": 1e-3, "BNCRSD": 0.9}
WORDS = METADATA | NUMBERS


def chirped(name="aircraft", is_bistatic=False, down=False):
    """A case of known targets whose echoes are those of a chirp."""
    case = CASES[name](is_bistatic)
    pulse = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6, down=down)
    return replace(case, raw=replace(case.raw, waveform=pulse))


def saved(case, path):
    words = WORDS if case.origin else {**WORDS, "SRPPos": case.targets[0], "IlluminatorName": "first"}
    case.raw.save(path, origin=case.origin, metadata=words)
    return path


def failures(path):
    """Names of errors and warnings of sarkit's checker."""
    with open(path, "rb") as file:
        judge = verification.CrsdConsistency.from_file(file, thorough=True)
        judge.check()
    return set(judge.failures())


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    case = chirped()
    return case, saved(case, tmp_path_factory.mktemp("crsd") / "x.crsd")


CASE_NAMES = [("aircraft", False, True), pytest.param("orbit", True, False, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("name", "is_bistatic", "down"), CASE_NAMES)
def test_the_checker_finds_nothing_and_the_rows_return(tmp_path, name, is_bistatic, down):
    case = chirped(name, is_bistatic, down)
    path = saved(case, tmp_path / "x.crsd")
    assert failures(path) == set()
    back, raw = sarcl.read(path), case.raw
    assert back.is_monostatic == raw.is_monostatic and back.waveform.kind == raw.waveform.kind
    for field in ("frequency", "frequency_step", "reference_range"):
        np.testing.assert_allclose(getattr(back, field), getattr(raw, field), rtol=1e-15, atol=2e-8)
    samples = back.read(0, back.n_rows)
    assert np.linalg.norm(samples - raw.samples) < 1e-6 * np.linalg.norm(raw.samples)
    if case.origin is None:
        np.testing.assert_allclose(back.rx, raw.rx, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(back[40:43].samples, samples[40:43])


@pytest.mark.parametrize("down", [False, True])
def test_records_are_echoes_of_the_chirp_by_the_equations_of_the_standard(tmp_path, down):
    """Each record against the chirp that the file describes, at the delay of a target, without sarcl."""
    case = chirped(down=down)
    path = saved(case, tmp_path / "x.crsd")
    with open(path, "rb") as file, crsd.Reader(file) as reader:
        signal, pvp = reader.read_channel("1")
        pulses = reader.read_ppps("1")[pvp["TxPulseIndex"]]
        rate = float(reader.metadata.xmltree.findtext("{*}Channel/{*}Parameters/{*}Fs"))
    start = (pvp["RcvStart"]["Int"] - pulses["TxTime"]["Int"]) + (pvp["RcvStart"]["Frac"] - pulses["TxTime"]["Frac"])
    t = start[:, None] + np.arange(signal.shape[1]) / rate
    reference = pvp["RefPhi0"]["Frac"][:, None] + pvp["RefFreq"][:, None] * (t - start[:, None])
    assert (np.sign(pulses["FxRate"]) == (-1 if down else 1)).all()
    # the receiver at the time at which the echo arrives
    middle = two_way(pulses["TxPos"], pvp["RcvPos"], case.targets[0]) / C
    rx = pvp["RcvPos"] + pvp["RcvVel"] * (middle - start)[:, None]
    sums = {}
    for shift in (0.0, 2 * case.resolution):
        for i, target in enumerate(case.targets):
            delay = (two_way(pulses["TxPos"], rx, target) + 2 * shift)[:, None] / C
            late = t - delay
            echo = np.exp(2j * np.pi * (pulses["FxFreq0"][:, None] * late + pulses["FxRate"][:, None] * late**2 / 2))
            echo *= np.abs(late) < pulses["TXmt"][:, None] / 2
            echo *= np.exp(-2j * np.pi * reference)
            sums[shift, i] = ((signal * echo.conj()).sum(axis=1) / (np.abs(echo) ** 2).sum(axis=1)).mean()
    for i, amplitude in enumerate(AMPLITUDES):
        assert abs(sums[0.0, i] - amplitude) < 0.12
    assert abs(sums[2 * case.resolution, 0]) < 0.5


def test_carriers_and_elements_of_an_array_are_channels_and_sequences(tmp_path):
    array = sarcl.AntennaArray.linear(2, spacing=0.5, frequency_step=20e6, axis=(0, 1, 0)).mirrored(at=4, n_pulses=9)
    pulse = sarcl.Waveform.chirp(center=10e9, bandwidth=15e6, duration=1e-6)
    track = sarcl.Trajectory.line(start=(-3e3, -20, 2e3), velocity=(0, 100, 0), prf=50.0, n_pulses=9)
    with pytest.warns(sarcl.SarclWarning, match="ranges 7"):  # of a sum of the channels
        options = {"array": array, "channels": "separated", "receive": "all", "reference": (0, 0, 0)}
        raw = sarcl.echo(sarcl.Scene.points([[3.0, 2.0, 0.0]]), pulse, track, **options)
    raw.save(tmp_path / "x.crsd", origin=ORIGIN, metadata=WORDS)
    assert failures(tmp_path / "x.crsd") == set()
    with open(tmp_path / "x.crsd", "rb") as file, crsd.Reader(file) as reader:
        tree = reader.metadata.xmltree
        assert len(tree.findall("{*}TxSequence/{*}Parameters")) == 4  # each element sends two carriers
        assert len(tree.findall("{*}Channel/{*}Parameters")) == 8  # two elements receive each
    back = sarcl.read(tmp_path / "x.crsd")
    order, same = (np.lexsort((rows.rx_channel, rows.tx_channel, rows.time)) for rows in (back, raw))
    np.testing.assert_allclose(back.frequency[order], raw.frequency[same], rtol=1e-15)
    np.testing.assert_allclose(back.reference_range[order], raw.reference_range[same], atol=2e-8)
    np.testing.assert_allclose(back[order].read(0, 36), raw[same].read(0, 36), atol=2e-6)
    assert sarcl.read(tmp_path / "x.crsd", channel="3").n_rows in (4, 5)


@pytest.mark.parametrize("key", ["TxRefRadIntensity", "BNCRSD", "CollectorName"])
def test_what_is_missing_is_refused_with_its_key(tmp_path, key):
    words = {name: value for name, value in WORDS.items() if name != key}
    with pytest.raises(ValueError, match=f"CRSD file must have; give metadata={{'{key}'"):
        chirped().raw.save(tmp_path / "x.crsd", origin=ORIGIN, metadata=words)
    assert not list(tmp_path.iterdir())


def test_echoes_that_do_not_know_their_pulse_take_its_length_and_rate(tmp_path):
    raw, path = aircraft(False).raw, tmp_path / "x.crsd"
    with pytest.raises(ValueError, match=r"metadata={'TXmt'"):
        raw.save(path, origin=ORIGIN, metadata=WORDS)
    raw.save(path, origin=ORIGIN, metadata={**WORDS, "TXmt": 1e-6, "FxRate": -1.5e14})
    back = sarcl.read(path)
    assert back.waveform.kind == "down-chirp" and back.waveform.bandwidth == pytest.approx(150e6)
    assert np.linalg.norm(back.read(0, 161) - raw.samples) < 1e-6 * np.linalg.norm(raw.samples)


def test_what_crsd_cannot_hold_is_refused(tmp_path):
    raw, path = chirped().raw, tmp_path / "x.crsd"
    long = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=0.02)
    for changes, more, words in (
        ({"waveform": sarcl.Waveform.tone(center=9.6e9, duration=1e-6)}, {}, "is a tone"),
        ({"waveform": long}, {}, r"records of the swath and the pulse last 0\.02"),
        ({"polarization": np.full(161, "RL")}, {}, "polarization '(RHC|LHC)' is not written to CRSD"),
        ({"compressed": False}, {}, "not compressed"),
        ({}, {"BNCRSD": 1.5}, "wanted above 0, at most 1"),
        ({}, {"TXmt": 1e-6}, "have a waveform"),
    ):
        with pytest.raises(ValueError, match=words):
            replace(raw, **changes).save(path, origin=ORIGIN, metadata={**WORDS, **more})
    with pytest.raises(ValueError, match="domain"):
        raw.save(path, origin=ORIGIN, metadata=WORDS, domain="TOA")
    assert not list(tmp_path.iterdir())


def edited(path, target, change):
    """A copy of a file whose bytes `change` has edited."""
    data = bytearray(path.read_bytes())
    change(data)
    target.write_bytes(data)
    return target


def test_damaged_files_are_refused_by_name(example, tmp_path):
    _, path = example
    with open(path, "rb") as file:
        _, keys = crsd.read_file_header(file)
    vectors = int(keys["PVP_BLOCK_BYTE_OFFSET"])

    def nan(data):
        data[vectors + 16 : vectors + 24] = np.array(np.nan, ">f8").tobytes()  # RcvPos of the first vector

    def dechirped(data):
        rate = vectors + 8 * (2 + 3 + 3 + 1 + 1 + 2 + 1 + 1)
        data[rate : rate + 8] = np.array(1e12, ">f8").tobytes()

    def kind(data):
        at = data.index(b"<TxWFType>LFM")
        data[at : at + 14] = b"<TxWFType>XM <"

    for change, words in (
        (lambda data: data.__delitem__(slice(-1000, None)), "is truncated: its SIGNAL block"),
        (nan, r"RcvPos = .* in vector 0 of channel '1', wanted finite"),
        (dechirped, "dechirped records"),
        (lambda data: data.__setitem__(slice(8, 11), b"9.9"), "sarcl reads CRSDsar/1.0"),
        (kind, "damaged|chirps, LFM"),
    ):
        target = edited(path, tmp_path / "y.crsd", change)
        with pytest.raises(ValueError, match=f"y.crsd' .*({words})"):
            sarcl.read(target)


def test_a_file_that_changes_while_it_is_read_is_an_error(example, tmp_path):
    _, path = example
    target = edited(path, tmp_path / "y.crsd", lambda data: None)
    raw = sarcl.read(target)
    raw.read(0, 2)
    os.utime(target, ns=(1, 1))
    with pytest.raises(OSError, match="has changed since it was opened"):
        raw.read(0, 2)
