"""CRSD by its definition alone (docs/theory/cphd.md): a reader and a writer of records in NumPy and an XML parser.

A pulse is exp(j 2 pi (PhiX0 + FxFreq0 t + FxRate t^2/2)), t after TxTime, |t| < TXmt/2. A record is what arrives, times
exp(-j 2 pi (RefPhi0 + RefFreq t)), t after RcvStart. All phases are in cycles, and all numbers are big-endian.
"""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from earth_targets import AMPLITUDES, CASES, C, two_way

import sarcl

pytest.importorskip("sarkit", reason="no sarkit: pip install sarcl[formats]")
pytestmark = pytest.mark.filterwarnings("ignore:(read|open)_text is deprecated:DeprecationWarning")  # within sarkit
WORDS = {
    "CollectorName": "sarcl", "CoreName": "targets", "ModeType": "SPOTLIGHT", "Classification": "UNCLASSIFIED",
    "ReleaseInfo": "UNRESTRICTED", "CollectionStart": "2026-01-02T03:04:05.250000", "TxRefRadIntensity": 1e6,
    "TxRadIntErrorStdDev": 0.1, "TxRefLAtm": 0.2, "RcvRefIrradiance": 1e-9, "RcvIrradianceErrorStdDev": 0.1,
    "RcvRefLAtm": 0.2, "PNCRSD": 1e-3, "BNCRSD": 0.9,
}  # fmt: skip


class Pass:
    """The one channel of a file: `pulses` and `vectors` by parameter, `signal` (vectors, samples), `rate`, Hz.

    Arrays are views of `data`, the bytes of the file.
    """

    def __init__(self, path):
        self.data = bytearray(path.read_bytes())
        head = bytes(self.data).split(b"\f\n")[0].decode().splitlines()[1:]
        place = {key: int(value) for key, value in (line.split(" := ") for line in head) if value.isdigit()}
        first = place["XML_BLOCK_BYTE_OFFSET"]
        root = ElementTree.fromstring(self.data[first : first + place["XML_BLOCK_SIZE"]])
        receive, transmit = root.find("{*}Data/{*}Receive"), root.find("{*}Data/{*}Transmit")
        channel, sequence = receive.find("{*}Channel"), transmit.find("{*}TxSequence")
        n, width = (int(channel.findtext(f"{{*}}Num{of}")) for of in ("Vectors", "Samples"))
        n_pulses = int(sequence.findtext("{*}NumPulses"))
        self.vectors = self._table(root.find("{*}PVP"), receive, "PVP", n, place["PVP_BLOCK_BYTE_OFFSET"])
        self.pulses = self._table(root.find("{*}PPP"), transmit, "PPP", n_pulses, place["PPP_BLOCK_BYTE_OFFSET"])
        start = place["SIGNAL_BLOCK_BYTE_OFFSET"] + int(channel.findtext("{*}SignalArrayByteOffset"))
        self.signal = np.frombuffer(self.data, ">c8", n * width, start).reshape(n, width)
        self.rate = float(root.findtext("{*}Channel/{*}Parameters/{*}Fs"))

    def _table(self, names, sizes, kind, n, first):
        size = int(sizes.findtext(f"{{*}}NumBytes{kind}"))
        words = np.frombuffer(self.data, np.uint8, n * size, first).reshape(n, size)
        table = {}
        for each in names:
            at, width = (8 * int(each.findtext(f"{{*}}{of}")) for of in ("Offset", "Size"))
            values = words[:, at : at + width]
            form = each.findtext("{*}Format")
            pair = form.startswith("Int")  # a whole number and a fraction
            table[each.tag.split("}")[1]] = (
                (values[:, :8].view(">i8")[:, 0], values[:, 8:].view(">f8")[:, 0])
                if pair
                else values.view(">i8" if form == "I8" else ">f8")
            )
        return table

    def echoes(self, target):
        """Echoes of a point of amplitude 1 (vectors, samples), by the definition."""
        v, p = self.vectors, self.pulses
        index = v["TxPulseIndex"][:, 0]
        start = (v["RcvStart"][0] - p["TxTime"][0][index]) + (v["RcvStart"][1] - p["TxTime"][1][index])
        tx = p["TxPos"][index]
        delay = two_way(tx, v["RcvPos"], target) / C
        for _ in range(4):  # the receiver moves until the echo arrives
            delay = two_way(tx, v["RcvPos"] + v["RcvVel"] * (delay - start)[:, None], target) / C
        after = np.arange(self.signal.shape[1]) / self.rate
        late = start[:, None] + after - delay[:, None]
        sent = p["PhiX0"][1][index, None] + p["FxFreq0"][index] * late + p["FxRate"][index] * late**2 / 2
        mixed = v["RefPhi0"][1][:, None] + v["RefFreq"] * after
        return np.exp(2j * np.pi * (sent - mixed)) * (np.abs(late) < p["TXmt"][index] / 2)


def saved(folder, name, is_bistatic, down):
    case = CASES[name](is_bistatic)
    pulse = sarcl.Waveform.chirp(center=9.6e9, bandwidth=150e6, duration=2e-6, down=down)
    case = replace(case, raw=replace(case.raw, waveform=pulse))
    words = WORDS if case.origin else {**WORDS, "SRPPos": case.targets[0], "IlluminatorName": "first"}
    case.raw.save(folder / "x.crsd", origin=case.origin, metadata=words)
    return case, folder / "x.crsd"


SCENES = [("aircraft", False, True), pytest.param("orbit", True, False, marks=pytest.mark.slow)]


@pytest.mark.parametrize(("name", "is_bistatic", "down"), SCENES)
def test_a_target_of_a_written_file_is_focused_at_its_place_by_the_definition(tmp_path, name, is_bistatic, down):
    """The matched filter of every place, summed over pulses: the peak is within a tenth of the resolution."""
    case, path = saved(tmp_path, name, is_bistatic, down)
    file, target = Pass(path), case.targets[1]
    longitude, latitude, _ = (float(v) for v in sarcl.wgs84.geodetic(target))
    steps = 0.4 * case.resolution * np.arange(-2, 3)
    axes = sarcl.wgs84.local_axes(longitude, latitude)
    peak = []
    for axis in axes[:2]:  # east, north
        model = (file.echoes(target + step * axis) for step in steps)
        power = [abs(np.vdot(echo, file.signal)) / np.vdot(echo, echo).real for echo in model]
        assert np.argmax(power) == 2
        a, b, _ = np.polyfit(steps[1:4], power[1:4], 2)
        peak.append(-b / 2 / a)
    assert np.abs(peak).max() < 0.1 * case.resolution
    echo = file.echoes(target)
    assert abs(np.vdot(echo, file.signal) / np.vdot(echo, echo) - AMPLITUDES[1]) < 0.1


def test_records_of_the_definition_with_other_references_are_read_as_echoes(tmp_path):
    """Phases of pulses and of references that differ from vector to vector, and a mixer beside the carrier."""
    case, path = saved(tmp_path, "aircraft", False, False)
    file, random = Pass(path), np.random.default_rng(3)
    n = len(file.signal)
    file.pulses["PhiX0"][1][:], file.vectors["RefPhi0"][1][:] = random.uniform(0, 1, (2, n))
    file.pulses["PhiX0"][0][:], file.vectors["RefPhi0"][0][:] = random.integers(0, 9, (2, n))
    file.vectors["RefFreq"][:] += 7e6
    file.signal[:] = file.echoes(case.targets[1])
    (tmp_path / "y.crsd").write_bytes(file.data)
    back = sarcl.read(tmp_path / "y.crsd")
    f = back.frequency[:, None] + back.frequency_step[:, None] * np.arange(back.n_samples)
    delay = two_way(back.tx, back.tx, case.targets[1]) - 2 * back.reference_range
    ratio = (back.read(0, n) * np.exp(2j * np.pi * f / C * delay[:, None])).mean(axis=1)
    assert np.abs(ratio - 1).max() < 0.05  # a chirp of 300 cycles ends within a band: ripples of Fresnel


def test_a_chirp_whose_reference_is_not_its_middle_is_refused(tmp_path):
    """A producer is known that gives the first frequency."""
    _, path = saved(tmp_path, "aircraft", False, False)
    file = Pass(path)
    file.pulses["FxFreq0"][:] -= 75e6
    (tmp_path / "y.crsd").write_bytes(file.data)
    with pytest.raises(ValueError, match=r"has FxFreq0 = 9\.525e\+09 Hz .* wanted .* the middle"):
        sarcl.read(tmp_path / "y.crsd")
