"""A SICD file as the fields of an image. Equations: docs/theory/sicd.md."""

from __future__ import annotations

import io
from pathlib import Path
from types import ModuleType
from typing import IO, Any

import numpy as np

from ...base.errors import warn
from ..formats import Make, T
from ..sarkit_library import Element, Reader, Refused, made_of, opened, parsing, text_of
from ..sarkit_library import library as sarkit_module
from ._pixel_rows import Phase, PixelRows
from ._product import PARAMETERS, SIDES

PLANES = ("PLANE", "RGAZIM", "XRGYCR", "XCTYAT")  # types of grids whose pixels lie on a plane, evenly spaced
LETTERS = {name: name for name in "HVXYSE"} | {"RHC": "R", "LHC": "L"}
OBLIQUE = 1e-6  # cosine between rows and columns: more, and they are no right angle
FAR = 1.0  # pixels: more, and a warning says how far from the plane's positions the image shows the scene


def load(source: Path | IO[bytes], make: Make[T]) -> T:
    """make("image", fields) of a SICD file; pixels stay in it, fields["data"] reads their rows.

    source  a path, or an open binary file that can be read at any place, and stays open
    ValueError, which names the file: truncated, damaged, NITF of another kind, a grid that is not a plane, pixels of
    another type. ImportError without sarkit.
    """
    library = sarkit_module("sicd")
    with opened(source) as (file, name):
        with parsing(name):
            reader = _reader(library, file)
            fields = _fields(library, reader, file)
        distance = _distance(library, reader, fields["grid"])
        if not distance <= FAR * max(fields["grid"]["spacing"]):
            how_far = f"up to {distance:.2g} m" if distance == distance else "it does not say how far"
            warn(
                f"{name}: this grid ({text_of(reader.metadata.xmltree.getroot(), 'Grid/Type')}) shows points of the "
                f"scene {how_far} from where its plane has their pixels; sarkit.sicd.projection has exact places"
            )
        return made_of(make, "image", fields, name)


def _reader(library: ModuleType, file: IO[bytes]) -> Reader:
    """sarkit's reader of an open file, after a check that the file has its segments and that they are SICD's."""
    end = file.seek(0, io.SEEK_END)
    file.seek(0)
    try:
        reader = library.NitfReader(file)
    except Exception as exc:
        if "Unable to find SICD" in str(exc) or isinstance(exc, (IndexError, KeyError)):
            raise Refused("is a NITF file without SICD metadata, which sarcl does not read") from None
        raise
    n_pixels = 0
    for segment in reader.jbp["ImageSegments"]:
        if not segment["subheader"]["IID1"].value.startswith("SICD"):
            continue
        first, size = int(segment["Data"].get_offset()), int(segment["Data"].size)
        if first + size > end:
            raise Refused(f"is truncated: its pixels end at byte {first + size}, the file at {end}; copy it again")
        if segment["subheader"]["IC"].value != "NC":
            raise Refused("has compressed pixels, which SICD does not allow; have it written without")
        n_pixels += int(segment["subheader"]["NROWS"].value) * int(segment["subheader"]["NCOLS"].value)
    root = reader.metadata.xmltree.getroot()
    rows, columns = (int(text_of(root, f"ImageData/Num{side}s")) for side in SIDES)
    if min(rows, columns) < 1 or n_pixels != rows * columns:
        raise Refused(
            f"is damaged: its XML has {rows} x {columns} pixels, its image segments {n_pixels}; copy it again"
        )
    return reader


def _fields(library: ModuleType, reader: Reader, file: IO[bytes]) -> dict[str, Any]:
    """Fields of an Image, by name."""
    from lxml import etree

    root = reader.metadata.xmltree.getroot()
    grid, phase = _grid(root), _phase(library, root)
    pair = (root.findtext("{*}ImageFormation/{*}TxRcvPolarizationProc") or "").split(":")
    letters = [LETTERS.get(name) for name in pair]
    band = [float(text_of(root, f"ImageFormation/TxFrequencyProc/{end}Proc")) for end in ("Min", "Max")]
    places = {name: f"SCPCOA/Bistatic/{name}Platform" for name in ("Tx", "Rcv")}
    if root.find("{*}SCPCOA/{*}Bistatic") is None:
        ends = [(_vector(root, "SCPCOA/ARPPos"), _vector(root, "SCPCOA/ARPVel"))] * 2
    else:
        ends = [(_vector(root, f"{place}/Pos"), _vector(root, f"{place}/Vel")) for place in places.values()]
    parameters = {
        each.get("name"): each.text
        for process in root.findall("{*}ImageFormation/{*}Processing")
        if process.findtext("{*}Type") == PARAMETERS
        for each in process.findall("{*}Parameter")
    }
    return {
        "data": PixelRows(reader, file, grid["shape"], phase),
        "grid": grid,
        "gain": float(parameters.get("gain") or 1.0),
        "window": parameters.get("window"),
        "frequency": sum(band) / 2,
        "band": band,
        "tx": ends[0][0],
        "rx": ends[1][0],
        "tx_velocity": ends[0][1],
        "rx_velocity": ends[1][1],
        "time": [float(text_of(root, f"ImageFormation/T{end}Proc")) for end in ("Start", "End")],
        "polarization": None if len(letters) != 2 or None in letters else "".join(map(str, letters)),
        "frame": "earth-fixed",
        "metadata": str(etree.tostring(reader.metadata.xmltree, encoding="unicode")),
    }


def _vector(root: Element, path: str) -> np.ndarray:
    """A vector of the XML, (3,). KeyError, ValueError where it is missing or no number."""
    return np.array([float(text_of(root, f"{path}/{axis}")) for axis in "XYZ"])


def _grid(root: Element) -> dict[str, Any]:
    """Fields of an ImageGrid; row 0 is the last of the file, so that a picture shows the file's first row on top."""
    kind = text_of(root, "Grid/Type")
    algorithm = root.findtext("{*}ImageFormation/{*}ImageFormAlgo")
    if kind not in PLANES or (kind == "RGAZIM" and algorithm == "RGAZCOMP"):
        raise Refused(
            f"has a grid of type {kind!r:.20} ({algorithm}), whose pixels do not lie on a plane; sarcl reads "
            f"{', '.join(PLANES)}: have it resampled to one of these"
        )
    shape = tuple(int(text_of(root, f"ImageData/Num{side}s")) for side in SIDES)
    first = np.array([int(text_of(root, f"ImageData/First{side}")) for side in SIDES])
    scp = np.array([int(text_of(root, f"ImageData/SCPPixel/{side}")) for side in SIDES])
    rows, columns = (_vector(root, f"Grid/{side}/UVectECF") for side in SIDES)
    spacing = tuple(float(text_of(root, f"Grid/{side}/SS")) for side in SIDES)
    center = _vector(root, "GeoData/SCP/ECF")
    lengths = np.linalg.norm([rows, columns], axis=1)
    if not (
        np.isfinite(center).all()
        and np.isfinite(spacing).all()
        and min(spacing) > 0
        and (abs(lengths - 1) < 1e-3).all()
    ):
        raise Refused(
            f"has a grid of steps {spacing} along vectors of length {lengths}, wanted steps in m, unit vectors"
        )
    if abs(rows @ columns) > OBLIQUE:
        raise Refused(
            f"has rows and columns at {np.degrees(np.arccos(rows @ columns)):.3f} deg, wanted a right angle: sarcl's "
            "planes have no others; have it resampled"
        )
    # the pixel at shape // 2 of the image, whose rows run backwards in the file
    middle = np.array([shape[0] - 1 - shape[0] // 2, shape[1] // 2])
    steps = (middle - (scp - first)) * spacing
    return {
        "shape": shape,
        "center": center + steps @ np.stack([rows, columns]),
        "spacing": spacing,
        "x_axis": columns,
        "y_axis": -rows,
    }


def _phase(library: ModuleType, root: Element) -> Phase:
    """What turns pixels of the file into those of an image."""
    kind = text_of(root, "ImageData/PixelType")
    if kind not in library.PIXEL_TYPES:
        raise Refused(f"has pixels of type {kind!r:.20}; sarcl reads {', '.join(library.PIXEL_TYPES)}")
    signs = {text_of(root, f"Grid/{side}/Sgn").lstrip("+") for side in SIDES}
    if signs not in ({"1"}, {"-1"}):
        raise Refused(f"has the signs {', '.join(sorted(signs))} of rows and columns, wanted -1 or +1 for both")
    table = root.find("{*}ImageData/{*}AmpTable")
    amplitudes = None
    if table is not None and kind == "AMP8I_PHS8I":
        amplitudes = np.full(256, np.nan)
        for each in table:
            amplitudes[int(each.get("index"))] = float(each.text)
        if not np.isfinite(amplitudes).all():
            raise Refused("has an AmpTable without a number for each of 256 amplitudes")
    places = (f"Grid/{side}/KCtr" for side in SIDES)
    steps = (float(text_of(root, f"Grid/{side}/SS")) for side in SIDES)
    cycles = [float(text_of(root, place)) * step for place, step in zip(places, steps, strict=True)]
    if not np.isfinite(cycles).all():
        raise Refused(f"has a KCtr that is not finite ({cycles} cycles per pixel)")
    origin = [
        float(text_of(root, f"ImageData/SCPPixel/{side}")) - float(text_of(root, f"ImageData/First{side}"))
        for side in SIDES
    ]
    return Phase(amplitudes, signs == {"1"}, (cycles[0], cycles[1]), (origin[0], origin[1]))


def _distance(library: ModuleType, reader: Reader, grid: dict[str, Any]) -> float:
    """Distance, m, from where the corners of the plane lie to what the file shows there, by the standard's projection.

    Where the file lacks what the projection needs nan, and 0 of a PLANE grid, whose pixels lie there by definition.
    """
    from dataclasses import replace

    import sarkit.sicd.projection as projection

    tree = reader.metadata.xmltree
    try:
        known = projection.MetadataParams.from_xml(tree)
        rows, columns = grid["shape"]
        corners = library.rowcol_to_xrowycol(
            tree,
            np.array([known.FirstRow, known.FirstCol])
            + np.array([[0, 0], [0, columns - 1], [rows - 1, 0], [rows - 1, columns - 1]]),
        )
        distances = []
        for corner in corners:
            time = projection.compute_coa_time(known.cT_COA, corner)
            ends = projection.compute_coa_pos_vel(known, time)
            of_file, of_plane = (
                np.array(projection.compute_coa_r_rdot(each, corner, time, ends))
                for each in (known, replace(known, Grid_Type="PLANE"))
            )
            speed, reach = np.linalg.norm(known.VARP_SCP_COA), np.linalg.norm(known.ARP_SCP_COA - known.SCP)
            distances.append(float(np.hypot(*((of_file - of_plane) * [1, reach / speed]))))
        return max(distances)
    except Exception:  # of the library: what a file of an image may lack
        return 0.0 if text_of(tree.getroot(), "Grid/Type") == "PLANE" else float("nan")
