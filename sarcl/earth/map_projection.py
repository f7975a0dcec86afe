"""MapProjection: coordinates of a map by longitude and latitude, through pyproj (pip install sarcl[maps])."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base import wgs84
from ..base.vectors import Floats

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

BEYOND = 6.0  # degrees outside a CRS's area of use that are still accepted: the width of a UTM zone
ROUND_TRIP = 1e-7  # degrees, 1 cm: a larger difference after the way there and back shows that a map ends before
STEP = {True: 1e-4, False: 10.0}  # degrees or metres, of the differences that give a map's scale


@dataclass(frozen=True, eq=False)
class MapProjection:
    """A horizontal coordinate reference system (CRS): x eastwards and y northwards, in metres, feet or degrees."""

    crs: CRS
    transformer: Transformer

    @classmethod
    def of(cls, crs: str | int) -> MapProjection:
        """The projection of what pyproj understands: "EPSG:32633", 32633, a text of PROJ or WKT.

        ImportError without pyproj. ValueError for an unknown CRS, one that is neither geographic nor projected, and
        one that no known transformation joins with WGS84.
        """
        try:
            import pyproj
        except ImportError as exc:
            raise ImportError("maps need the package pyproj: pip install sarcl[maps]") from exc
        try:
            system = pyproj.CRS.from_user_input(crs).to_2d()
        except (pyproj.exceptions.CRSError, TypeError, ValueError) as exc:
            raise ValueError(
                f"crs is {crs!r:.80}, which is no coordinate reference system that pyproj knows; give e.g. 'EPSG:4326' "
                "(longitude and latitude) or 'EPSG:32633' (UTM zone 33 north)"
            ) from exc
        if not (system.is_geographic or system.is_projected):
            raise ValueError(
                f"crs {crs!r:.80} is neither geographic nor projected; give e.g. 'EPSG:4326' or 'EPSG:32633'"
            )
        try:
            to_map = pyproj.Transformer.from_crs("EPSG:4326", system, always_xy=True, allow_ballpark=False)
            to_map.transform(*_somewhere(system), errcheck=True)
        except pyproj.exceptions.ProjError as exc:
            raise ValueError(
                f"crs {crs!r:.80}: pyproj knows no transformation between it and WGS84 ({exc}); choose another CRS, or "
                "install its grids (projsync)"
            ) from exc
        return cls(system, to_map)

    @classmethod
    def at(cls, longitude: float, latitude: float) -> MapProjection:
        """The UTM zone of a place, degrees; the polar stereographic projection (UPS) beyond 84 north and 80 south."""
        if latitude > 84 or latitude < -80:
            return cls.of("EPSG:5041" if latitude > 0 else "EPSG:5042")
        zone = int((longitude + 180) % 360 // 6) + 1
        return cls.of(f"EPSG:{32600 + zone if latitude >= 0 else 32700 + zone}")

    @property
    def text(self) -> str:
        """The CRS as text: its code, or WKT where it has none."""
        code = self.crs.to_authority()
        return ":".join(code) if code else self.crs.to_wkt()

    @property
    def is_degrees(self) -> bool:
        """Whether x and y are longitude and latitude."""
        return bool(self.crs.is_geographic)

    @property
    def names(self) -> tuple[str, str]:
        """Names of y and x."""
        return ("latitude", "longitude") if self.is_degrees else ("northing", "easting")

    @property
    def unit(self) -> str:
        """Unit of x and y: "m", "deg" or another."""
        unit = str(self.crs.axis_info[0].unit_name)
        return {"metre": "m", "degree": "deg"}.get(unit, unit)

    def coordinates(self, positions: Floats, near: float | None = None) -> Floats:
        """x and y, (..., 2), of Earth-fixed positions, m (..., 3); NaN where the map has no such place.

        near  longitude about which those of a geographic CRS are counted, degrees: grids may cross the antimeridian
        """
        full = np.isfinite(positions[..., 0])
        places = np.full((*full.shape, 2), np.nan)
        longitude, latitude, _ = wgs84.geodetic(positions[full])
        x, y = self.transformer.transform(longitude, latitude)
        places[full] = np.stack([x, y], axis=-1)
        places[~np.isfinite(places).all(axis=-1)] = np.nan
        if self.is_degrees and near is not None:
            places[..., 0] = near + (places[..., 0] - near + 180) % 360 - 180
        return places

    def places(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Longitude and latitude, degrees (...), of map coordinates (...); infinite where there is none."""
        longitude, latitude = self.transformer.transform(x, y, direction="INVERSE")
        return np.asarray(longitude, np.float64), np.asarray(latitude, np.float64)

    def scale(self, x: float, y: float) -> tuple[float, float]:
        """Metres on the ellipsoid per unit of y and of x, at a place of the map."""
        step = STEP[self.is_degrees]
        longitude, latitude = self.places(np.array([x, x + step, x]), np.array([y, y, y + step]))
        ends = wgs84.ecef(longitude, latitude, 0.0)
        across, up = (float(np.linalg.norm(ends[i] - ends[0])) / step for i in (1, 2))
        return up, across

    def check_reach(self, longitude: Floats, latitude: Floats) -> None:
        """ValueError where places, degrees (n,), lie outside the CRS's area, with one that reaches them."""
        x, y = self.transformer.transform(longitude, latitude)
        back = np.array(self.transformer.transform(x, y, direction="INVERSE"))
        with np.errstate(invalid="ignore"):  # infinite coordinates give NaN, which is refused
            off = np.abs((back - [longitude, latitude] + 180) % 360 - 180).max(axis=0)
        is_outside, area = ~(off < ROUND_TRIP), self.crs.area_of_use
        if area is not None:
            width = (area.east - area.west) % 360 or 360.0
            beyond = (longitude - area.west + BEYOND) % 360 > width + 2 * BEYOND
            is_outside |= (beyond & (width + 2 * BEYOND < 360)) | (latitude < area.south - BEYOND)
            is_outside |= latitude > area.north + BEYOND
        if is_outside.any():
            i = int(np.argmax(is_outside))
            reach = (
                ""
                if area is None
                else f", which is made for longitudes {area.west:g} to {area.east:g} and "
                f"latitudes {area.south:g} to {area.north:g}"
            )
            raise ValueError(
                f"crs {self.text:.80} does not reach longitude {longitude[i]:.4f}, latitude {latitude[i]:.4f}{reach}; "
                f"take crs={MapProjection.at(float(longitude[i]), float(latitude[i])).text!r}, or 'EPSG:4326'"
            )


def _somewhere(system: CRS) -> tuple[float, float]:
    """Longitude and latitude in the middle of a CRS's area of use, degrees."""
    area = system.area_of_use
    if area is None:
        return 0.0, 0.0
    return area.west + (area.east - area.west) % 360 / 2, (area.south + area.north) / 2
