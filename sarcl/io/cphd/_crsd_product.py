"""The XML of a CRSD file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ..sarkit_library import Element
from ._channels import ENDS
from ._product import dwell, put_scene

if TYPE_CHECKING:
    from .crsd_writing import Crsd, ReceivedChannel, SentPulses

SPACE = "http://api.nsgreg.nga.mil/schema/crsd/1.0"
FLAT, LEVEL = "gain", "response"  # support arrays: antenna patterns, and spectra of sequences, without structure


AXES = {(3,): ("X", "Y", "Z"), (2,): ("DCX", "DCY")}  # of positions, and of the direction of a beam


def product(crsd: Crsd) -> Element:
    """The tree of elements."""
    from lxml import etree

    c = crsd.collection
    root = crsd.library.ElementWrapper(etree.Element(f"{{{SPACE}}}CRSDsar", nsmap={None: SPACE}))
    names = c.names
    info = {"ProductName": names["CoreName"], "Classification": names["Classification"]}
    info |= {"ReleaseInfo": names["ReleaseInfo"]}
    root["ProductInfo"] = info | ({"CountryCode": names["CountryCode"]} if "CountryCode" in names else {})
    mode = {key: names[key] for key in ("ModeType", "ModeID") if key in names}
    root["SARInfo"] = {"CollectType": names["CollectType"], "RadarMode": mode}
    for side, key in (("Transmit", "IlluminatorName"), ("Receive", "CollectorName")):
        root[f"{side}Info"] = {"SensorName": names.get(key, names["CollectorName"]), "EventName": names["CoreName"]}
    ppps = [crsd.pulses_of(each) for each in crsd.sequences]
    pvps = [crsd.vectors_of(each) for each in crsd.channels]
    sent = [_sequence(crsd, each, ppp) for each, ppp in zip(crsd.sequences, ppps, strict=True)]
    received = [_channel(crsd, each, pvp) for each, pvp in zip(crsd.channels, pvps, strict=True)]
    root["Global"] = {
        "CollectionRefTime": c.start.astype("datetime64[us]").item(),
        "Transmit": {
            "TxTime1": min(each["TxTime1"] for each in sent),
            "TxTime2": max(each["TxTime2"] for each in sent),
            "FxMin": min(each["FxC"] - each["FxBW"] / 2 for each in sent),
            "FxMax": max(each["FxC"] + each["FxBW"] / 2 for each in sent),
        },
        "Receive": {
            "RcvStartTime1": min(each["RcvStartTime1"] for each in received),
            "RcvStartTime2": max(each["RcvStartTime2"] for each in received),
            "FrcvMin": min(each["FrcvMin"] for each in received),
            "FrcvMax": max(each["FrcvMax"] for each in received),
        },
    }
    put_scene(root["SceneCoordinates"], c)
    root["SceneCoordinates"]["ImageArea"] = _area(crsd)
    root["Data"] = _data(crsd, ppps[0].itemsize, pvps[0].itemsize)
    first = crsd.channels[0]
    root["TxSequence"] = {"RefTxId": first.sequence.name, "TxWFType": "LFM", "Parameters": sent}
    root["Channel"] = {"RefChId": first.rows.name, "Parameters": received}
    root["ReferenceGeometry"] = {}
    _put_dwell(root, crsd)
    _put_arrays(root, sent)
    for name, values in (("PPP", ppps[0]), ("PVP", pvps[0])):
        for key in values.dtype.names or ():
            kind, offset = values.dtype.fields[key][:2]  # type: ignore[index]
            root[name][key] = {"Offset": offset // 8, "Size": kind.itemsize // 8, "dtype": _packed(kind)}
    _put_antenna(root, crsd)
    tree = root.elem.getroottree()
    ppp = ppps[crsd.sequences.index(first.sequence)]
    with np.errstate(divide="ignore"):  # of the rate of a bistatic angle that is 0
        root["ReferenceGeometry"] = crsd.library.compute_reference_geometry(tree, pvps=pvps[0], ppps=ppp)
    return tree


def _area(crsd: Crsd) -> dict[str, Any]:
    """The image area, with its corners in clockwise order."""
    (x1, y1), (x2, y2) = crsd.collection.area
    corners = np.array([[x1, y1], [x1, y2], [x2, y2], [x2, y1]])
    return {"X1Y1": crsd.collection.area[0], "X2Y2": crsd.collection.area[1], "Polygon": corners}


def _packed(kind: np.dtype[Any]) -> np.dtype[Any]:
    """Type of a parameter as the format has it: vectors are numbers by name."""
    return np.dtype([(name, np.float64) for name in AXES[kind.shape]]) if kind.shape else kind


def _data(crsd: Crsd, n_ppp: int, n_pvp: int) -> dict[str, Any]:
    sequences, channels, signal, vector, pulse = [], [], 0, 0, 0
    for sequence in crsd.sequences:
        n = len(sequence.rows)
        sequences.append({"TxId": sequence.name, "NumPulses": n, "PPPArrayByteOffset": n_ppp * pulse})
        pulse += n
    for channel in crsd.channels:
        n, n_samples = len(channel.rows.rows), channel.records.n
        sizes = {"ChId": channel.rows.name, "NumVectors": n, "NumSamples": n_samples}
        channels.append(sizes | {"SignalArrayByteOffset": signal, "PVPArrayByteOffset": n_pvp * vector})
        signal, vector = signal + 8 * n * n_samples, vector + n
    arrays = [(FLAT, 3, 3), *((f"{LEVEL}{each.name}", 1, 3) for each in crsd.sequences)]
    first = np.cumsum([0, *(8 * rows * columns for _, rows, columns in arrays)])
    return {
        "Support": {
            "NumSupportArrays": len(arrays),
            "SupportArray": [
                {"SAId": name, "NumRows": r, "NumCols": k, "BytesPerElement": 8, "ArrayByteOffset": int(at)}
                for (name, r, k), at in zip(arrays, first, strict=False)
            ],
        },
        "Transmit": {"NumBytesPPP": n_ppp, "NumTxSequences": len(sequences), "TxSequence": sequences},
        "Receive": {
            "SignalArrayFormat": "CF8",
            "NumBytesPVP": n_pvp,
            "NumCRSDChannels": len(channels),
            "Channel": channels,
        },
    }


def _polarization(name: str) -> dict[str, Any]:
    return {
        "PolarizationID": name,
        "AmpH": float(name == "H"),
        "AmpV": float(name == "V"),
        "PhaseH": 0.0,
        "PhaseV": 0.0,
    }


def _seconds(pair: np.void) -> float:
    return float(pair["Int"] + pair["Frac"])


def _sequence(crsd: Crsd, sequence: SentPulses, ppp: np.ndarray) -> dict[str, Any]:
    low, high = float(ppp["FX1"].min()), float(ppp["FX2"].max())
    numbers = crsd.signals.numbers
    return {
        "Identifier": sequence.name,
        "RefPulseIndex": len(ppp) // 2,
        "FxResponseId": f"{LEVEL}{sequence.name}",
        "FxBWFixed": not np.ptp(ppp["FX1"]) and not np.ptp(ppp["FX2"]),
        "FxC": (low + high) / 2,
        "FxBW": high - low,
        "TXmtMin": crsd.signals.duration,
        "TXmtMax": crsd.signals.duration,
        "TxTime1": _seconds(ppp["TxTime"][0]),
        "TxTime2": _seconds(ppp["TxTime"][-1]),
        "TxAPCId": "antenna",
        "TxAPATId": sequence.polarization,
        "TxRefPoint": {"ECF": crsd.collection.reference_point, "IAC": [0.0, 0.0]},
        "TxPolarization": _polarization(sequence.polarization),
        **{name: numbers[name] for name in ("TxRefRadIntensity", "TxRadIntErrorStdDev", "TxRefLAtm")},
    }


def _channel(crsd: Crsd, channel: ReceivedChannel, pvp: np.ndarray) -> dict[str, Any]:
    c, numbers, middle = crsd.collection, crsd.signals.numbers, len(pvp) // 2
    low, high = float(pvp["FRCV1"].min()), float(pvp["FRCV2"].max())
    sender, receiver = channel.rows.polarizations
    return {
        "Identifier": channel.rows.name,
        "RefVectorIndex": middle,
        "RefFreqFixed": not np.ptp(pvp["RefFreq"]),
        "FrcvFixed": not np.ptp(pvp["FRCV1"]) and not np.ptp(pvp["FRCV2"]),
        "SignalNormal": True,
        "F0Ref": float(pvp["RefFreq"][middle]),
        "Fs": channel.records.rate,
        "BWInst": float((pvp["FRCV2"] - pvp["FRCV1"]).max()),
        "RcvStartTime1": _seconds(pvp["RcvStart"][0]),
        "RcvStartTime2": _seconds(pvp["RcvStart"][-1]),
        "FrcvMin": low,
        "FrcvMax": high,
        "RcvAPCId": "antenna",
        "RcvAPATId": receiver,
        "RcvRefPoint": {"ECF": c.reference_point, "IAC": [0.0, 0.0]},
        "RcvPolarization": _polarization(receiver),
        **{name: numbers[name] for name in ("RcvRefIrradiance", "RcvIrradianceErrorStdDev", "RcvRefLAtm")},
        **{name: numbers[name] for name in ("PNCRSD", "BNCRSD")},
        "Parameter": [(end, str(n)) for end, n in zip(ENDS, channel.rows.antennas, strict=True)],
        "SARImage": {
            "TxId": channel.sequence.name,
            "RefVectorPulseIndex": int(channel.pulses[middle]),
            "TxPolarization": _polarization(sender),
            "DwellTimes": {"Polynomials": {"CODId": channel.rows.name, "DwellId": channel.rows.name}},
            "ImageArea": _area(crsd),
        },
    }


def _put_dwell(root: Element, crsd: Crsd) -> None:
    """The same dwell for all points of the scene: from the first pulse to the last, when they meet the scene."""
    c, ends = crsd.collection, [channel.rows.rows[[0, -1]] for channel in crsd.channels]
    times = [c.time[i] + np.linalg.norm(c.tx[i] - c.reference_point, axis=1) / SPEED_OF_LIGHT for i in ends]
    root["DwellPolynomials"] = dwell([channel.rows.name for channel in crsd.channels], times)


def _put_arrays(root: Element, sequences: list[dict[str, Any]]) -> None:
    grid = {"X0": -1.0, "Y0": -1.0, "XSS": 1.0, "YSS": 1.0}
    root["SupportArray"] = {
        "GainPhaseArray": [{"Identifier": FLAT, "ElementFormat": "Gain=F4;Phase=F4;", **grid}],
        "FxResponseArray": [
            {
                "Identifier": each["FxResponseId"],
                "ElementFormat": "Amp=F4;Phase=F4;",
                "Fx0FXR": each["FxC"] - each["FxBW"] / 2,
                "FxSSFXR": each["FxBW"] / 2,
            }
            for each in sequences
        ],
    }


def _put_antenna(root: Element, crsd: Crsd) -> None:
    """Antennas without a pattern, whose axes are those of the polarisations H and V at the reference point."""
    kinds = sorted({name for each in crsd.collection.channels for name in each.polarizations})
    none = {"DCXSF": 0.0, "DCYSF": 0.0}
    root["Antenna"] = {
        "NumACFs": 1,
        "NumAPCs": 1,
        "NumAPATs": len(kinds),
        "AntCoordFrame": [{"Identifier": "H, V"}],
        "AntPhaseCenter": [{"Identifier": "antenna", "ACFId": "H, V", "APCXYZ": np.zeros(3)}],
        "AntPattern": [
            {
                "Identifier": name,
                "FreqZero": float(crsd.signals.carrier[0]),
                "ArrayGPId": FLAT,
                "ElemGPId": FLAT,
                "EBFreqShift": none,
                "MLFreqDilation": none,
                "GainBSPoly": np.zeros(1),
                "AntPolRef": {"AmpX": float(name == "H"), "AmpY": float(name == "V"), "PhaseX": 0.0, "PhaseY": 0.0},
            }
            for name in kinds
        ],
    }
