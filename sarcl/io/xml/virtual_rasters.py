"""Virtual rasters (VRT): read where all they hold is known to be harmless, and their sources lie in their folder.

Their XML may name files and addresses in many places, of which each version of GDAL has more (VRTProcessedDataset,
DEMPath of RPC transformers). So what is not listed here is refused. GDAL takes an attribute for an element of that name
and the reverse, and does not tell small letters from capitals; what it parses otherwise than XML is refused too.
Source: GDAL 3.10, "VRT -- GDAL Virtual Format", and data/gdalvrt.xsd.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from . import parser

SOURCE_NAMES = {"sourcefilename", "sourcedataset"}  # elements whose text is the name of a file
# coordinate reference systems by a code, in WKT, as JSON or for PROJ; by other texts GDAL finds files and addresses
SYSTEM = re.compile(
    r"|(EPSG|ESRI|OGC|IGNF):[\w:+.]+|urn:ogc:def:crs:[\w:.,]+|WGS84|[A-Z0-9_]+\[.*|\{.*|\+proj=[\w\s+=.,-]*", re.DOTALL
)
# options of warping whose values name no file
OPTIONS = set(
    """
    UNIFIED_SRC_NODATA INIT_DEST ERROR_OUT_IF_EMPTY_SOURCE_WINDOW NUM_THREADS SOURCE_EXTRA SAMPLE_GRID SAMPLE_STEPS
    SKIP_NOSOURCE STREAMABLE_OUTPUT OPTIMIZE_SIZE XSCALE YSCALE CENTER_LONG AREA_OF_INTEREST
    """.split()
)
KINDS = ("", "VRTSourcedRasterBand", "VRTRawRasterBand", "VRTWarpedDataset", "VRTWarpedRasterBand")
# names of elements and attributes, and which texts of theirs pass
CHECKED: dict[str, Callable[[str], bool]] = {
    **dict.fromkeys(
        ("srs", "sourcesrs", "targetsrs"), lambda text: bool(SYSTEM.fullmatch(text)) and "grids" not in text.lower()
    ),
    "subclass": KINDS.__contains__,
    "relativetovrt": ("0", "1").__contains__,
    "domain": ("", "IMAGE_STRUCTURE").__contains__,  # GDAL opens files that metadata of other domains name
}
# names of elements and attributes whose text is a number, one of a few words, or only handed on
HARMLESS = set(
    """
    rasterxsize rasterysize geotransform dataaxistosrsaxismapping coordinateepoch blockxsize blockysize overviewlist
    metadata mdi key vrtrasterband datatype band description nodatavalue hidenodatavalue colorinterp unittype offset
    scale maskband overview
    categorynames category colortable entry c1 c2 c3 c4
    histograms histitem histmin histmax bucketcount includeoutofrange approximate histcounts
    simplesource complexsource averagedsource kernelfilteredsource shared sourceband sourceproperties srcrect dstrect
    xoff yoff xsize ysize resampling nodata usemaskband scaleoffset scaleratio lut exponent clamp srcmin srcmax dstmin
    dstmax kernel normalized size coefs
    imageoffset pixeloffset lineoffset byteorder
    gdalwarpoptions warpmemorylimit resamplealg workingdatatype option name transformer approxtransformer maxerror
    basetransformer genimgprojtransformer srcgeotransform srcinvgeotransform dstgeotransform dstinvgeotransform
    reprojecttransformer reprojectiontransformer options bandlist bandmapping src dst srcnodatareal srcnodataimag
    dstnodatareal dstnodataimag srcalphaband dstalphaband
    """.split()
)
REMEDY = "which may lead to other files; give its sources or a copy as GeoTIFF, or external=True if you trust it"


class Refused(Exception):
    """The message says what the virtual raster holds, after its name."""


def sources(path: Path) -> list[Path]:
    """Files that a virtual raster is made of, wherever they lie.

    Refused for what is no virtual raster, or holds what is not known to be harmless.
    """
    try:
        root = parser.parsed(path, "DEM file", instructions=False)
    except parser.Refused as exc:
        raise Refused(f"{exc}; export it again, or give its sources") from None
    if root.tag != "VRTDataset":
        raise Refused(f"is XML of the kind {root.tag!r:.60}, which names a raster elsewhere; give that raster")
    files = []
    for element in root.iter():
        name = element.tag.lower()
        if name in SOURCE_NAMES:
            files.append(_source(path, element))
        elif element is not root:
            _check(name, f"<{element.tag}>", element.text)
        for key, text in element.attrib.items():
            _check(key.lower(), f"<{element.tag} {key}>", text)
            if name == "option" and text not in OPTIONS:
                raise Refused(f"has the option {text!r:.60}, {REMEDY}")
    return files


def _check(name: str, shown: str, text: str | None) -> None:
    if name not in HARMLESS and name not in CHECKED:
        raise Refused(f"has {shown:.80}, {REMEDY}")
    if name in CHECKED and not CHECKED[name]((text or "").strip()):
        raise Refused(f"has {shown:.80} {text!r:.60}, {REMEDY}")


def _source(path: Path, element: ElementTree.Element) -> Path:
    """The file that an element names, from the folder of the virtual raster or, where that is said, the current one."""
    text = element.text or ""
    # GDAL takes names with a colon, or that begin so, for what a driver reads, and for addresses
    if len(element) or text != text.strip() or text.startswith(("<", "{")) or ":" in text:
        raise Refused(f"leads to another file: {text!r:.100}, no name in its folder; put a copy there, and name that")
    attributes = {key.lower(): value.strip() for key, value in element.attrib.items()}
    folder = path.parent if attributes.get("relativetovrt") == "1" else Path()
    return (folder / text).absolute()
