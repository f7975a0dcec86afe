"""Place: a local frame on the Earth, x east, y north, z up."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..base import validation, wgs84
from ..base.vectors import Floats
from ..io import elevation
from ..io.elevation import Geoid


@dataclass(frozen=True)
class Place:
    """A local frame, x east, y north, z up, at a longitude and latitude, degrees, and a height above the ellipsoid, m.

    Raises ValueError for numbers that are not finite, and a latitude or longitude beyond 90 or 360 degrees.
    """

    longitude: float
    latitude: float
    height: float = 0.0

    def __post_init__(self) -> None:
        for name, most in (("longitude", 360.0), ("latitude", 90.0), ("height", np.inf)):
            value = validation.number(name, getattr(self, name))
            if abs(value) > most:
                raise ValueError(f"{name} is {value:g}; give degrees from {-most:g} to {most:g}")
            object.__setattr__(self, name, value)

    @classmethod
    def above(
        cls, longitude: float, latitude: float, height: float = 0.0, *, heights: str = "ellipsoid", geoid: Geoid = None
    ) -> Place:
        """A place whose height is above what `heights` names, as in `Scene.from_dem`.

        heights  "ellipsoid", or the name of a geoid ("EGM96"), which needs
        geoid    its height above the ellipsoid there, m: a number, a function of longitude and latitude in degrees, or
                 a raster file of it
        """
        place = cls(longitude, latitude, height)
        if not isinstance(heights, str) or not heights:
            raise ValueError(f"heights is {heights!r}; give 'ellipsoid' or the name of a geoid, such as 'EGM96'")
        if re.search("ellipsoid", heights, re.IGNORECASE):
            if geoid is not None:
                raise ValueError(
                    "the height is above the ellipsoid; geoid would count the undulation twice: leave it out"
                )
            return place
        if geoid is None:
            raise ValueError(
                f"the height is above {heights!r}, not above the ellipsoid; give the undulation as geoid: a number "
                "(m), or a raster file of it"
            )
        degrees = np.array([[place.longitude]]), np.array([[place.latitude]])
        rise = elevation.undulation(geoid, *degrees, "the place", heights)
        return cls(place.longitude, place.latitude, place.height + float(rise[0, 0]))

    @cached_property
    def origin(self) -> Floats:
        """Earth-fixed position, m (3,)."""
        return wgs84.ecef(self.longitude, self.latitude, self.height)

    @cached_property
    def axes(self) -> Floats:
        """Rows east, north, up (3, 3), Earth-fixed: a local vector v is v @ axes."""
        return wgs84.local_axes(self.longitude, self.latitude)

    def positions(self, local: Floats) -> Floats:
        """Earth-fixed positions, m (..., 3), of local ones: east, north, up, m (..., 3)."""
        return np.asarray(np.asarray(local, np.float64) @ self.axes + self.origin)
