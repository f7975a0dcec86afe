"""A CPHD file as the fields of a phase history. Equations: docs/theory/cphd.md."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import warn
from ..formats import Make, T
from ..sarkit_library import Element, FileRows, Reader, Refused, made_of, opened, parsing, text_of
from ..sarkit_library import library as sarkit_module
from ._channels import Channel, channels_of, chosen
from ._domains import baseband, n_frequencies
from ._signal_rows import Conversion, SignalRows

HEADER_BYTES = 2**16  # of the header: ten lines of text
SPACE = "http://api.nsgreg.nga.mil/schema/cphd/"
# Per-vector parameters that must be finite; positive where True
NEEDED = {"TxTime": False, "TxPos": False, "RcvPos": False, "SRPPos": False, "TxVel": False, "RcvVel": False}
NEEDED |= {"FX1": True, "FX2": True, "TOA1": False, "TOA2": False, "SC0": False, "SCSS": True, "aFDOP": False}
NEEDED |= {"aFRR1": False, "aFRR2": False}
COUPLING = 0.1, 1.0  # cycles over the band, range resolutions: coupling of range and Doppler that is told, and refused
NEGLIGIBLE = 0.01  # cycles of phase: 0.16 mm of range at 10 GHz
ALL_ZERO = ("TxPos", "RcvPos", "SRPPos")  # positions at the centre of the Earth: a file that was not filled in


def load(
    source: Path | IO[bytes], make: Make[T], channel: str | int | None = None, polarization: str | None = None
) -> T:
    """make("phase history", fields) of a CPHD file; samples stay in it, fields["samples"] has their rows by channel.

    source        a path, or an open binary file that can be read at any place, and stays open
    channel       an Identifier, or the number of a receiver's phase centre;  polarization  such as "HV", "RL"
    ValueError, which names the file: truncated, damaged, another version, a compressed signal, a SGN that is neither
    +1 nor -1, per-vector parameters that are not finite or zero, channels that do not fit. ImportError without sarkit.
    """
    library = sarkit_module("cphd")
    with opened(source) as (file, name):
        with parsing(name):
            reader = _reader(library, file)
            root = reader.metadata.xmltree.getroot()
            _check_kind(root)
            selection = chosen(channels_of(root), channel, polarization)
            area = image_area(library, reader.metadata.xmltree)
            parts = [_rows(reader, file, root, each, area) for each in selection]
            coupling = max(part.pop("coupling") for part in parts)
            if coupling > COUPLING[1]:
                raise Refused(
                    "has coupled range and Doppler (aFRR1, aFRR2), which sarcl does not correct: targets in corners "
                    f"of its image area would be moved or blurred by {coupling:.2g} range resolutions; have it written "
                    "without the coupling, or for a smaller area"
                )
            fields = {field: joined([part[field] for part in parts]) for field in parts[0]}
            if np.array_equal(fields["rx"], fields["tx"]):
                fields["rx"] = None
            fields |= {"image_area": area, "metadata": text(reader)}
        if coupling > COUPLING[0]:
            warn(
                f"{name}: range and Doppler are coupled (aFRR1, aFRR2), which is not corrected: targets in the corners "
                f"of the image area are moved or blurred by {coupling:.1%} of the range resolution"
            )
        return made_of(make, "phase history", fields, name)


def _reader(library: ModuleType, file: IO[bytes]) -> Reader:
    """sarkit's reader of an open file, after a check that the file has its blocks."""
    keys = header(library, file, ("CPHD/1.0.1", "CPHD/1.1.0"), ("XML", "PVP", "SIGNAL"))
    reader = library.Reader(file)
    root = reader.metadata.xmltree.getroot()
    if any(
        root.find(f"{{*}}Data/{{*}}{e}") is not None for e in ("SignalCompressionID", "Channel/{*}CompressedSignalSize")
    ):
        raise Refused("has a compressed signal, which CPHD leaves to each producer; have it written uncompressed")
    row = library.binary_format_string_to_dtype(text_of(root, "Data/SignalArrayFormat")).itemsize
    for each in root.findall("{*}Data/{*}Channel"):
        count = int(text_of(each, "NumVectors"))
        sizes = {"Signal": row * int(text_of(each, "NumSamples")), "PVP": int(text_of(root, "Data/NumBytesPVP"))}
        for array, size in sizes.items():
            first = int(text_of(each, f"{array}ArrayByteOffset"))
            if first < 0 or first + count * size > int(keys[f"{array.upper()}_BLOCK_SIZE"]):
                raise Refused(
                    f"is damaged: its {array} array of channel {text_of(each, 'Identifier')!r} leaves its block"
                )
    return reader


def header(library: ModuleType, file: IO[bytes], kinds: Sequence[str], blocks: Sequence[str]) -> dict[str, str]:
    """The header of an open file, which is then at its begin. Refused where it is of none of the kinds, and names a
    block that is not all there."""
    end = file.seek(0, io.SEEK_END)
    file.seek(0)
    kind, keys = library.read_file_header(io.BytesIO(file.read(HEADER_BYTES)))
    if kind.strip() not in kinds:
        raise Refused(f"is {kind.strip()!r:.40}; sarcl reads {' and '.join(kinds)}")
    for block in blocks:
        first, size = int(keys[f"{block}_BLOCK_BYTE_OFFSET"]), int(keys[f"{block}_BLOCK_SIZE"])
        if first < 0 or size < 0 or first + size > end:
            raise Refused(
                f"is truncated: its {block} block ends at byte {first + size}, the file at {end}; copy it again"
            )
    file.seek(0)
    return keys


def _check_kind(root: Element) -> None:
    space = str(root.tag).partition("}")[0].lstrip("{")
    if space not in (f"{SPACE}1.0.1", f"{SPACE}1.1.0"):
        raise Refused(f"has XML of {space!r:.80}; sarcl reads CPHD 1.0.1 and 1.1.0")
    domain, sign = text_of(root, "Global/DomainType"), text_of(root, "Global/SGN")
    if domain not in ("FX", "TOA"):
        raise Refused(f"has DomainType {domain!r:.20}, wanted FX or TOA")
    if sign not in ("1", "+1", "-1"):
        raise Refused(f"has SGN {sign!r:.20}, wanted +1 or -1: the sign of the phase of a return is not known")


def _rows(reader: Reader, file: IO[bytes], root: Element, channel: Channel, area: np.ndarray) -> dict[str, Any]:
    """Fields of the rows of a channel, but those whose SIGNAL is 0: vectors without a signal; and their `_coupling`."""
    pvp = reader.read_pvps(channel.name)
    pvp = pvp.astype(pvp.dtype.newbyteorder("="))
    vectors = np.arange(channel.n_vectors)
    if "SIGNAL" in (pvp.dtype.names or ()):
        vectors = vectors[pvp["SIGNAL"] != 0]
    if not len(vectors):
        raise Refused(f"has no vector with a signal in channel {channel.name!r}; give another channel=")
    pvp = pvp[vectors]
    _check_parameters(pvp, vectors, channel, root)
    n_rows = len(pvp)
    is_toa = text_of(root, "Global/DomainType") == "TOA"
    low, high = pvp["FX1"], pvp["FX2"]
    if is_toa:
        duration = channel.n_samples * pvp["SCSS"]  # s
        n, step = n_frequencies(high - low, duration), 1 / duration
        if n > channel.n_samples:
            raise Refused(
                f"has SCSS = {pvp['SCSS'].max():g} s in channel {channel.name!r}, wanted at most 1/(FX2 - FX1), "
                f"{1 / (high - low).max():g} s: samples by time of arrival are too few for their band"
            )
        frequency = (low + high) / 2 + baseband(n, step)[:, 0]
        # of sample N//2, which the range window is centred on
        advance = pvp["SC0"] + channel.n_samples // 2 * pvp["SCSS"]
        advance[np.abs(advance) <= pvp["SCSS"]] = 0.0
    else:
        n, frequency, step = channel.n_samples, pvp["SC0"], pvp["SCSS"]
        is_outside = np.maximum(np.abs(pvp["TOA1"]), np.abs(pvp["TOA2"])) * step > 0.5
        advance = np.where(is_outside.any(), (pvp["TOA1"] + pvp["TOA2"]) / 2, 0.0)
    scale = _scale(pvp)
    frequency, step = frequency * scale, step * scale
    tx, rx, srp = (np.array(pvp[name]) for name in ("TxPos", "RcvPos", "SRPPos"))
    path = np.linalg.norm(tx - srp, axis=1) + np.linalg.norm(srp - rx, axis=1)
    conversion = Conversion(
        is_conjugate=text_of(root, "Global/SGN") != "-1",
        amplitude=np.array(pvp["AmpSF"]) if "AmpSF" in (pvp.dtype.names or ()) else np.ones(n_rows),
        frequency=np.array(frequency),
        frequency_step=np.array(step),
        advance=advance,
        toa=(np.array(pvp["SC0"]), np.array(pvp["SCSS"]), high - low) if is_toa else None,
    )
    return {
        "samples": SignalRows(reader, file, channel.name, vectors, conversion, n),
        "frequency": conversion.frequency,
        "frequency_step": conversion.frequency_step,
        "tx": tx,
        "rx": rx,
        "reference_range": (path + SPEED_OF_LIGHT * advance) / 2,
        "time": np.array(pvp["TxTime"]),
        "tx_velocity": np.array(pvp["TxVel"]),
        "rx_velocity": np.array(pvp["RcvVel"]),
        **channel.fields(n_rows),
        "coupling": _coupling(pvp, area),
    }


def _coupling(pvp: np.ndarray, area: np.ndarray) -> float:
    """Largest shift and blur in the corners of the image area, in c/(2 B): aFRR1 dv B and aFRR2 dv B^2/4 added up."""
    if not (pvp["aFRR1"].any() or pvp["aFRR2"].any()):
        return 0.0
    corners = [area[0] + i * area[1] + j * area[2] for i in (-1, 1) for j in (-1, 1)]

    def rate(points: np.ndarray) -> np.ndarray:
        """Mean range rate of sender and receiver to points, m/s."""
        lines = [(pvp[f"{end}Pos"] - points, pvp[f"{end}Vel"]) for end in ("Tx", "Rcv")]
        return np.mean([np.einsum("ij,ij->i", v, r) / np.linalg.norm(r, axis=1) for r, v in lines], axis=0)

    band = pvp["FX2"] - pvp["FX1"]
    cycles = np.abs(pvp["aFRR1"] * band) + np.abs(pvp["aFRR2"] * band**2 / 4)
    return float(max((cycles * np.abs(rate(x) - rate(pvp["SRPPos"]))).max() for x in corners))


def _scale(pvp: np.ndarray) -> np.ndarray:
    """Factor of the phase of a row (n_rows,), (1 + aFDOP)(1 + rate of the receiver's range / c).

    1 for all rows where aFDOP is 0 in all, which the standard allows for files that do not give it, and where it moves
    the phase at the ends of the swath by less than NEGLIGIBLE: rows then have one band.
    """
    if not pvp["aFDOP"].any():
        return np.ones(len(pvp))
    line = pvp["RcvPos"] - pvp["SRPPos"]
    rate = np.einsum("ij,ij->i", pvp["RcvVel"], line) / np.linalg.norm(line, axis=1)
    scale = (1 + pvp["aFDOP"]) * (1 + rate / SPEED_OF_LIGHT)
    phase = pvp["FX2"] * np.maximum(np.abs(pvp["TOA1"]), np.abs(pvp["TOA2"])) * (scale - 1)
    return np.asarray(scale if np.abs(phase).max() > NEGLIGIBLE else np.ones(len(pvp)))


def _check_parameters(pvp: np.ndarray, vectors: np.ndarray, channel: Channel, root: Element) -> None:
    """Refused names a per-vector parameter, and the first vector, that is not finite or cannot be zero."""
    positive = {name for name, is_positive in NEEDED.items() if is_positive}
    if text_of(root, "Global/DomainType") == "FX":
        positive.add("SC0")
    optional = [name for name in ("AmpSF",) if name in (pvp.dtype.names or ())]
    for name in (*NEEDED, *optional):
        values = pvp[name].reshape(len(pvp), -1)
        is_bad = ~np.isfinite(values).all(axis=1)
        wanted = "finite"
        if name in positive or name in optional:
            is_bad, wanted = is_bad | (values <= 0).any(axis=1), "positive"
        elif name in ALL_ZERO:
            is_bad, wanted = is_bad | (values == 0).all(axis=1), "a position on the Earth or above it"
        elif name == "TOA2":
            is_bad, wanted = is_bad | (pvp["TOA2"] < pvp["TOA1"]), "at least TOA1"
        if name == "FX2":
            is_bad, wanted = is_bad | (pvp["FX2"] <= pvp["FX1"]), "more than FX1"
        refuse_any(is_bad, name, values, vectors, channel, wanted)


def refuse_any(
    is_bad: np.ndarray, name: str, values: np.ndarray, vectors: np.ndarray, channel: Channel, wanted: str
) -> None:
    """Refused names the first of vectors (n,) whose values (n, k) of a parameter are bad, and what was wanted."""
    if is_bad.any():
        i = int(np.argmax(is_bad))
        value = values[i].tolist() if values.shape[1] > 1 else values[i, 0].item()
        raise Refused(
            f"has {name} = {value} in vector {int(vectors[i])} of channel {channel.name!r}, wanted {wanted}: it is "
            "damaged, or was not filled in by the program that wrote it"
        )


def joined(values: list[Any]) -> Any:
    """Rows of all channels; samples as a list of their sources."""
    if isinstance(values[0], FileRows):
        if len({rows.shape[1] for rows in values}) > 1:
            raise Refused("has channels of different bands; give channel= or polarization=")
        return values
    return np.concatenate(values) if isinstance(values[0], np.ndarray) else values[0]


def image_area(library: ModuleType, tree: Element) -> np.ndarray:
    """Centre of the image area, and from there to the middles of its sides along IAX and IAY, m (3, 3)."""
    root = tree.getroot()
    names = [[f"SceneCoordinates/ImageArea/{corner}/{axis}" for axis in "XY"] for corner in ("X1Y1", "X2Y2")]
    corners = np.array([[float(text_of(root, name)) for name in pair] for pair in names])
    if not (np.isfinite(corners).all() and (corners[0] < corners[1]).all()):
        raise Refused(f"has an ImageArea from {corners[0]} to {corners[1]}, wanted X1 < X2 and Y1 < Y2, m")
    (x1, y1), (x2, y2) = _in_metres(root, corners)
    x, y = (x1 + x2) / 2, (y1 + y2) / 2
    points = library.iac_to_ecf(tree, [[x, y, 0], [x1, y, 0], [x2, y, 0], [x, y1, 0], [x, y2, 0]])
    area = np.stack([points[0], (points[2] - points[1]) / 2, (points[4] - points[3]) / 2])
    if not np.isfinite(area).all() or np.linalg.norm(np.cross(area[1], area[2])) == 0:
        raise Refused("has SceneCoordinates of which no plane follows: it is damaged")
    return np.asarray(area, np.float64)


def _in_metres(root: Element, corners: np.ndarray) -> np.ndarray:
    """Corners of the image area (2, 2), m: products exist that have the numbers of their lines and samples there."""
    grid = root.find("{*}SceneCoordinates/{*}ImageGrid")
    if grid is None:
        return corners
    sides = ("IAXExtent", "Line"), ("IAYExtent", "Sample")
    first, count = (
        np.array([float(text_of(grid, f"{side}/{word}{name}{end}")) for side, name in sides])
        for word, end in (("First", ""), ("Num", "s"))
    )
    if np.abs(corners - np.stack([first, first + count - 1])).max() > 1:
        return corners
    place = np.array([float(text_of(grid, f"IARPLocation/{name}")) for _, name in sides])
    return np.asarray((corners - place) * [float(text_of(grid, f"{side}/{name}Spacing")) for side, name in sides])


def text(reader: Reader) -> str:
    """The XML of the file."""
    from lxml import etree

    return str(etree.tostring(reader.metadata.xmltree, encoding="unicode"))
