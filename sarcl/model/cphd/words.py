"""What metadata= gives for files of standards, by their own names, and the place of local coordinates on the Earth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...base import validation, wgs84
from ...earth.dates import date

if TYPE_CHECKING:
    from ..phase_history import PhaseHistory

# polarisations by their letters, as CPHD and SICD name them; and those of their later versions
POLARIZATIONS = {letter: letter for letter in "HVXY"} | {"R": "RHC", "L": "LHC"}
LATER = {letter: letter for letter in "SE"}


class Words:
    """What metadata= gives for a file of `kind`. ValueError for a name that is not known, or that is missing.

    defaults  values of names that metadata= does not give, as another file of the same echoes has them
    must      names that the file must have: a refusal lists all of them that are missing
    """

    def __init__(
        self,
        kind: str,
        metadata: Mapping[str, ArrayLike | np.datetime64] | None,
        known: Sequence[str],
        defaults: Mapping[str, Any] | None = None,
        must: Sequence[str] = (),
    ) -> None:
        self.kind, self.must = kind, must
        unknown = [key for key in metadata or {} if key not in known]
        if unknown:
            raise ValueError(
                f"metadata has {unknown[0]!r}, which is no name that {kind} lacks here; it takes {', '.join(known)}"
            )
        self.values: dict[str, Any] = {**(defaults or {}), **(metadata or {})}

    def need(self, key: str, why: str) -> Any:
        """The value of a key; ValueError where there is none."""
        if self.values.get(key) is None:
            others = [other for other in self.must if other != key and self.values.get(other) is None]
            too = f"; it must have {', '.join(others)} too" if others else ""
            raise ValueError(f"{why}, which a {self.kind} file must have; give metadata={{{key!r}: ...}}{too}")
        return self.values[key]

    def text(self, key: str) -> str:
        """The text of a key, not empty."""
        value = self.need(key, f"the echoes have no {key}")
        if not isinstance(value, str) or not value.strip() or not value.isprintable():
            raise ValueError(f"metadata[{key!r}] is {value!r:.80}; give a text of one line")
        return value

    def start(self) -> np.datetime64:
        """CollectionStart: UTC of time 0."""
        return date(self.need("CollectionStart", "the echoes have no date (UTC of time 0)"))


def frame(
    antenna: np.ndarray, kind: str, origin: ArrayLike | None, axes: ArrayLike | None
) -> tuple[np.ndarray, np.ndarray]:
    """Origin, m (3,), and axes (3, 3) of the frame of the echoes, Earth-fixed: position = origin + local @ axes.

    antenna  m (3,), by which Earth-fixed echoes are told from local ones;  kind  of the file
    """
    is_earth_fixed = wgs84.is_earth_fixed(antenna)
    if origin is None:
        if axes is not None or not is_earth_fixed:
            raise ValueError(
                f"the echoes are in local coordinates, and {kind} is Earth-fixed; give origin=(latitude, longitude, "
                "height) of their origin, degrees and m on WGS84 (axes=: east, north and up unless given)"
            )
        return np.zeros(3), np.eye(3)
    if is_earth_fixed:
        raise ValueError("origin places local coordinates, and the echoes are Earth-fixed already; leave it out")
    latitude, longitude, height = validation.array("origin", origin, np.float64, (3,)).tolist()
    if not -90 <= latitude <= 90 or not -180 <= longitude <= 360:
        raise ValueError(
            f"origin is ({latitude:g}, {longitude:g}, {height:g}); give latitude, longitude, deg, height, m"
        )
    if axes is None:
        rows = wgs84.local_axes(longitude, latitude)
    else:
        rows = validation.array("axes", axes, np.float64, (3, 3))
        if not np.allclose(rows @ rows.T, np.eye(3), atol=1e-9) or np.linalg.det(rows) < 0:
            raise ValueError(
                "axes are not three orthogonal unit vectors of a right-handed frame, Earth-fixed, x, y, z by row"
            )
    return wgs84.ecef(longitude, latitude, height), rows


def per_row(raw: PhaseHistory, words: Words, name: str, key: str, tail: tuple[int, ...]) -> np.ndarray:
    """A field of the rows, of the echoes or of metadata; ValueError where neither has it, or both."""
    value = getattr(raw, name)
    if value is not None and key in words.values:
        raise ValueError(f"metadata has {key!r}, and the echoes have {name}; leave it out")
    if value is None:
        value = words.need(key, f"the echoes have no {name} (per row)")
    return validation.array(f"metadata[{key!r}]", value, np.float64, (raw.n_rows, *tail))
