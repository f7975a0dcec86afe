"""The XML of a SICD file, of an image and its collection."""

from __future__ import annotations

from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial import polynomial

from ...base import wgs84
from ...base.version import __version__
from ..sarkit_library import Element

if TYPE_CHECKING:
    from .writing import Direction, Product

PARAMETERS = "sarcl"  # Type of the Processing element whose parameters are fields of an image
SIDES = ("Row", "Col")
GROUND = np.cos(np.radians(0.5))  # of the angle between the plane's normal and the vertical, of a ground plane


def tree_of(library: ModuleType, product: Product) -> Element:
    """The tree of elements."""
    from lxml import etree

    space = f"urn:SICD:{product.version}"
    root = library.ElementWrapper(etree.Element(f"{{{space}}}SICD", nsmap={None: space}))
    names, is_monostatic = product.names, product.tracks.is_monostatic
    mode = {"ModeType": names["ModeType"]} | ({"ModeID": names["ModeID"]} if "ModeID" in names else {})
    texts = {**names, "CollectType": "MONOSTATIC" if is_monostatic else "BISTATIC", "RadarMode": mode}
    order = ("CollectorName", "IlluminatorName", "CoreName", "CollectType", "RadarMode", "Classification")
    root["CollectionInfo"] = {name: texts[name] for name in order if name in texts}
    if "CountryCode" in names:
        root["CollectionInfo"]["CountryCode"] = [code.strip() for code in names["CountryCode"].split(",")]
    root["ImageCreation"] = {"Application": f"sarcl {__version__}"}
    rows, columns = product.order.shape
    root["ImageData"] = {
        "PixelType": "RE32F_IM32F",
        "NumRows": rows,
        "NumCols": columns,
        "FirstRow": 0,
        "FirstCol": 0,
        "FullImage": {"NumRows": rows, "NumCols": columns},
        "SCPPixel": product.order.scp_pixel,
    }
    longitude, latitude, height = (float(v) for v in wgs84.geodetic(product.scp))
    root["GeoData"] = {
        "EarthModel": "WGS_84",
        "SCP": {"ECF": product.scp, "LLH": [latitude, longitude, height]},
        "ImageCorners": _corners(product),
    }
    normal = np.cross(product.directions[0].axis, product.directions[1].axis)
    is_ground = abs(normal @ wgs84.up(longitude, latitude)) > GROUND
    root["Grid"] = {
        "ImagePlane": "GROUND" if is_ground else "OTHER",
        "Type": "PLANE",
        "TimeCOAPoly": product.time_coa,
        **{side: _direction(each, product) for side, each in zip(SIDES, product.directions, strict=True)},
    }
    start = product.start.astype("datetime64[us]").item()
    root["Timeline"] = {"CollectStart": start, "CollectDuration": product.duration}
    root["Position"] = {"ARPPoly": product.tracks.arp}
    if not is_monostatic:
        assert product.tracks.rx is not None
        root["Position"]["GRPPoly"] = product.scp[None]
        root["Position"]["TxAPCPoly"] = product.tracks.tx
        root["Position"]["RcvAPC"] = [product.tracks.rx]
    _put_collection(root, product)
    _put_formation(root, product)
    tree = root.elem.getroottree()
    root.elem.append(library.compute_scp_coa(tree))
    _check_order(root.elem)
    if product.backscatter is not None:
        assert product.gain is not None
        root["Radiometric"]["RCSSFPoly"] = np.array([[product.gain**-2.0]])  # |pixel/gain|^2 is a cross section, m^2
        if is_ground:  # cells of other planes are none of the ground
            sigma = product.backscatter
            slope, graze = (np.radians(root["SCPCOA"][f"{name}Ang"]) for name in ("Slope", "Graze"))
            root["Radiometric"]["SigmaZeroSFPoly"] = sigma
            root["Radiometric"]["BetaZeroSFPoly"] = sigma / np.cos(slope)
            root["Radiometric"]["GammaZeroSFPoly"] = sigma / np.sin(graze)
    return tree


def _check_order(root: Element) -> None:
    """The SCPCOA element, which follows from the others, stands last of them."""
    assert root[-1].tag.endswith("SCPCOA")


def _places(product: Product) -> np.ndarray:
    """Image coordinates, m (4, 2), of the corners: first row first column, first last, last last, last first."""
    rows, columns = product.order.shape
    corners = np.array([[0, 0], [0, columns - 1], [rows - 1, columns - 1], [rows - 1, 0]])
    return np.asarray((corners - product.order.scp_pixel) * [each.spacing for each in product.directions])


def _corners(product: Product) -> np.ndarray:
    """Latitude and longitude, degrees (4, 2), of the corners, led along the layover to the height of the centre."""
    time = float(product.time_coa[0, 0])
    antenna = polynomial.polyval(time, product.tracks.arp)
    velocity = polynomial.polyval(time, polynomial.polyder(product.tracks.arp))
    longitude, latitude, _ = (float(v) for v in wgs84.geodetic(product.scp))
    up = wgs84.up(longitude, latitude)
    slant = np.cross(velocity, product.scp - antenna)
    slant *= np.sign(slant @ up) / np.linalg.norm(slant)
    offsets = _places(product) @ np.stack([each.axis for each in product.directions])
    points = product.scp + offsets - np.outer(offsets @ up / (slant @ up), slant)
    longitudes, latitudes, _ = wgs84.geodetic(points)
    return np.stack([latitudes, longitudes], axis=1)


def _direction(direction: Direction, product: Product) -> dict[str, Any]:
    """What the file says of its rows or columns. DeltaK1, DeltaK2 as the standard computes them, from the corners."""
    places = _places(product)
    middle = polynomial.polyval2d(places[:, 0], places[:, 1], direction.offset)
    low, high = middle.min() - direction.bandwidth / 2, middle.max() + direction.bandwidth / 2
    limit = 0.5 / direction.spacing
    if low < -limit or high > limit:  # the spectrum goes around the band of the samples
        low, high = -limit, limit
    return {
        "UVectECF": direction.axis,
        "SS": direction.spacing,
        "ImpRespWid": direction.width,
        "Sgn": -1,
        "ImpRespBW": direction.bandwidth,
        "KCtr": direction.center,
        "DeltaK1": float(low),
        "DeltaK2": float(high),
        "DeltaKCOAPoly": direction.offset,
    }


def _put_collection(root: Element, product: Product) -> None:
    sender, receiver = product.polarization
    channel: dict[str, Any] = {"@index": 1, "TxRcvPolarization": f"{sender}:{receiver}"}
    if not product.tracks.is_monostatic:
        channel["RcvAPCIndex"] = 1
    root["RadarCollection"] = {
        "TxFrequency": dict(zip(("Min", "Max"), product.band, strict=True)),
        "TxPolarization": sender,
        "RcvChannels": {"@size": 1, "ChanParameters": [channel]},
    }


def _put_formation(root: Element, product: Product) -> None:
    """How the image was formed: by sums over pulses, which the standard has no name for."""
    parameters = {"gain": None if product.gain is None else repr(float(product.gain)), "window": product.window}
    pairs = [(name, text) for name, text in parameters.items() if text is not None]
    root["ImageFormation"] = {
        "RcvChanProc": {"NumChanProc": 1, "ChanIndex": [1]},
        "TxRcvPolarizationProc": ":".join(product.polarization),
        "TStartProc": product.processed[0],
        "TEndProc": product.processed[1],
        "TxFrequencyProc": dict(zip(("MinProc", "MaxProc"), product.band, strict=True)),
        "ImageFormAlgo": "OTHER",
        "STBeamComp": "NO",
        "ImageBeamComp": "NO",
        **{name: product.names.get(name, "NO") for name in ("AzAutofocus", "RgAutofocus")},
        "Processing": [{"Type": PARAMETERS, "Applied": True, **({"Parameter": pairs} if pairs else {})}],
    }
