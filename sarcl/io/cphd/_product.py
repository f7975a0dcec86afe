"""The XML of a CPHD file, of a collection and its per-vector parameters."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base import wgs84
from ..sarkit_library import Element
from ._channels import ENDS

if TYPE_CHECKING:
    from .writing import Collection

# Per-vector parameters in the order of the file: number of words of 8 bytes
SIZES = {"TxTime": 1, "TxPos": 3, "TxVel": 3, "RcvTime": 1, "RcvPos": 3, "RcvVel": 3, "SRPPos": 3, "aFDOP": 1}
SIZES |= dict.fromkeys(("aFRR1", "aFRR2", "FX1", "FX2", "TOA1", "TOA2", "TDTropoSRP", "SC0", "SCSS", "SIGNAL"), 1)


@dataclass(frozen=True, eq=False)
class ChannelRows:
    """A channel: its Identifier, names of the polarisations sent and received, numbers of its antennas, its rows."""

    name: str
    polarizations: tuple[str, str]
    antennas: tuple[int, int]
    rows: np.ndarray


def kind_of(name: str) -> np.dtype[Any]:
    """Type of a per-vector parameter."""
    kind = np.dtype(np.int64 if name == "SIGNAL" else np.float64)
    return kind if SIZES[name] == 1 else np.dtype((kind, (SIZES[name],)))


def product(library: ModuleType, collection: Collection, pvps: list[np.ndarray]) -> Element:
    """The tree of elements."""
    from lxml import etree

    space = f"http://api.nsgreg.nga.mil/schema/cphd/{collection.version}"
    root = library.ElementWrapper(etree.Element(f"{{{space}}}CPHD", nsmap={None: space}))
    names = dict(collection.names)
    mode = {key: names.pop(key) for key in ("ModeType", "ModeID") if key in names}
    order = (
        "CollectorName",
        "IlluminatorName",
        "CoreName",
        "CollectType",
        "RadarMode",
        "Classification",
        "ReleaseInfo",
    )
    values = {**names, "RadarMode": mode}
    root["CollectionID"] = {n: values[n] for n in (*order, "CountryCode") if n in values}
    root["Global"] = _global(collection, pvps)
    put_scene(root["SceneCoordinates"], collection)
    root["Data"] = _data(collection)
    _put_channels(root, collection, pvps)
    offset = 0
    for name, size in SIZES.items():
        root["PVP"][name] = {"Offset": offset, "Size": size, "dtype": kind_of(name)}
        offset += size
    _put_dwell(root, collection, library, pvps)
    tree = root.elem.getroottree()
    root["ReferenceGeometry"] = library.compute_reference_geometry(tree, pvps[0])
    return tree


def _global(collection: Collection, pvps: list[np.ndarray]) -> dict[str, Any]:
    def limits(low: str, high: str) -> tuple[float, float]:
        return float(min(p[low].min() for p in pvps)), float(max(p[high].max() for p in pvps))

    start = collection.start.astype("datetime64[us]").item()
    times, band, swath = limits("TxTime", "TxTime"), limits("FX1", "FX2"), limits("TOA1", "TOA2")
    return {
        "DomainType": collection.domain,
        "SGN": collection.sgn,
        "Timeline": {"CollectionStart": start, "TxTime1": times[0], "TxTime2": times[1]},
        "FxBand": {"FxMin": band[0], "FxMax": band[1]},
        "TOASwath": {"TOAMin": swath[0], "TOAMax": swath[1]},
    }


def put_scene(scene: Element, collection: Collection) -> None:
    point, (x_axis, y_axis), ((x1, y1), (x2, y2)) = collection.reference_point, collection.surface, collection.area
    longitude, latitude, height = (float(v) for v in wgs84.geodetic(point))
    scene["EarthModel"] = "WGS_84"
    scene["IARP"] = {"ECF": point, "LLH": [latitude, longitude, height]}
    scene["ReferenceSurface"] = {"Planar": {"uIAX": x_axis, "uIAY": y_axis}}
    scene["ImageArea"] = {"X1Y1": collection.area[0], "X2Y2": collection.area[1]}
    corners = np.array([[x1, y1], [x1, y2], [x2, y2], [x2, y1]])
    longitudes, latitudes, _ = wgs84.geodetic(point + corners @ collection.surface)
    scene["ImageAreaCornerPoints"] = np.stack([latitudes, longitudes], axis=1)


def _data(collection: Collection) -> dict[str, Any]:
    sizes, n_bytes = [], 8 * sum(SIZES.values())
    first = 0
    for channel in collection.channels:
        n = len(channel.rows)
        sizes.append(
            {
                "Identifier": channel.name,
                "NumVectors": n,
                "NumSamples": collection.n_stored,
                "SignalArrayByteOffset": 8 * first * collection.n_stored,
                "PVPArrayByteOffset": n_bytes * first,
            }
        )
        first += n
    return {
        "SignalArrayFormat": "CF8",
        "NumBytesPVP": n_bytes,
        "NumCPHDChannels": len(sizes),
        "Channel": sizes,
        "NumSupportArrays": 0,
    }


def _put_channels(root: Element, collection: Collection, pvps: list[np.ndarray]) -> None:
    bands = [(float(p["FX1"].min()), float(p["FX2"].max())) for p in pvps]
    parameters = []
    for channel, pvp, (low, high) in zip(collection.channels, pvps, bands, strict=True):
        sender, receiver = channel.polarizations
        parameters.append(
            {
                "Identifier": channel.name,
                "RefVectorIndex": len(pvp) // 2,
                "FXFixed": _is_fixed(pvp, "FX1", "FX2"),
                "TOAFixed": _is_fixed(pvp, "TOA1", "TOA2"),
                "SRPFixed": True,
                "SignalNormal": True,
                "Polarization": {"TxPol": sender, "RcvPol": receiver},
                "FxC": (low + high) / 2,
                "FxBW": high - low,
                "TOASaved": float(pvp["TOA2"].max() - pvp["TOA1"].min()),
                "DwellTimes": {"CODId": channel.name, "DwellId": channel.name},
            }
        )
    together = np.concatenate(pvps)
    root["Channel"] = {
        "RefChId": collection.channels[0].name,
        "FXFixedCPHD": _is_fixed(together, "FX1", "FX2"),
        "TOAFixedCPHD": _is_fixed(together, "TOA1", "TOA2"),
        "SRPFixedCPHD": True,
        "Parameters": parameters,
    }
    if len(collection.channels) > 1:
        numbers = [
            (f"{end} of {c.name}", str(n)) for c in collection.channels for end, n in zip(ENDS, c.antennas, strict=True)
        ]
        root["Channel"]["AddedParameters"] = {"Parameter": numbers}


def _put_dwell(root: Element, collection: Collection, library: ModuleType, pvps: list[np.ndarray]) -> None:
    """The same dwell for all points of the scene: from the first vector to the last."""
    ends = [library.compute_t_ref_from_pvps(pvp[[0, -1]]).tolist() for pvp in pvps]
    root["Dwell"] = dwell([channel.name for channel in collection.channels], ends)


def dwell(names: Sequence[str], ends: Iterable[tuple[float, float]]) -> dict[str, Any]:
    """Elements of the dwell of each channel, which is the same for all points;  ends  first and last time, s"""
    centres, lengths = [], []
    for name, (first, last) in zip(names, ends, strict=True):
        centres.append({"Identifier": name, "CODTimePoly": np.array([[(first + last) / 2]])})
        lengths.append({"Identifier": name, "DwellTimePoly": np.array([[last - first]])})
    n = len(names)
    return {"NumCODTimes": n, "CODTime": centres, "NumDwellTimes": n, "DwellTime": lengths}


def _is_fixed(pvp: np.ndarray, *names: str) -> bool:
    return all(bool((pvp[name] == pvp[name][0]).all()) for name in names)
