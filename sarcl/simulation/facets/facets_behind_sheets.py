"""Echoes of facets that are seen through thin sheets, summed in float64 on the host."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...base.boxes import box
from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.rows import spread_over
from ...base.stage_timer import Clock
from ...scattering.facet_kinds import random
from ...scattering.facet_plan import MOST_FACETS, TO_CORNER, FacetPlan, nearest
from ...scattering.facets import FacetSet, Light
from ...scattering.random_surface import Pieces
from ...scattering.thin_sheets import FacetsThrough, SeenThrough, ThinSheets, may_hide
from ...scene.triangles import centroids, cut, edges
from ...visibility.lit_parts import FacetPieces, LitParts
from ..echo_request import EchoRequest
from ..scene_plan import SeenScene
from ..spreading import ChannelView, Counts
from .exact_facets import AT_ONCE, facet_samples, inside_window

TRANSMISSION = 0.3  # share of a tolerance for what sheets let through, which is that along the line to each centroid
LOOKS, FREQUENCIES = 16, 9  # pulses and frequencies of the band at which the change of transmission is looked at


@dataclass(frozen=True, eq=False)
class FacetsBehindSheets:
    """Pieces of facets of which some pulse sees a part through thin sheets.

    seen    what the antennas see of them through which sheets
    n_dark  pieces of the plan, which may be cut further, that are seen through sheets alone
    error   relative to the echoes of these pieces, at random phases
    """

    part: FacetSet
    sheets: ThinSheets
    seen: SeenThrough
    n_dark: int
    error: float

    def __len__(self) -> int:
        return len(self.part)

    @classmethod
    def of(
        cls, request: EchoRequest, seen: SeenScene, pieces: Pieces | None, plan: FacetPlan, error_budget: float
    ) -> FacetsBehindSheets | None:
        """Those of a scene that is cut by a plan; None where nothing lies behind sheets, or nothing shades.

        NotApplicable for facets with a random echo, and as `ThinSheets.of`.
        """
        scene, ends = seen.scene, seen.antennas.ends
        if pieces is None or not request.shadows or not may_hide(scene):
            return None
        sheets = ThinSheets.of(scene, ends)
        room: dict[str, Any] = {"max_bytes": request.budget / 4, "progress": partial(request.report, "shadows")}
        wanted = pieces.scene.reflectivity > 0
        each = FacetPieces(pieces.scene.triangles, pieces.scene.two_sided, wanted, scene.triangles, pieces.of)
        shaded = LitParts(request.device, each, scene.triangles[scene.sheets], ends, **room)
        rows = np.flatnonzero(shaded.dark | shaded.partly)
        is_random = random(scene)[pieces.of[rows]]
        if is_random.any():
            raise NotApplicable(
                f"facet {int(pieces.of[rows[np.argmax(is_random)]])} lies behind a thin sheet and has a random echo "
                "(roughness, or a diagram of its material), which is not computed through sheets: give it roughness=0 "
                "and a smooth material, or leave the sheet out"
            )
        if not len(rows):
            return None
        looks = spread_over(len(seen.antennas), LOOKS)
        band = seen.waveform.center + seen.waveform.bandwidth * np.linspace(-0.5, 0.5, FREQUENCIES)
        # an error of T by its steepness times the angle by which a line of sight to a corner differs, on each way
        places = centroids(pieces.scene.triangles[rows])
        steep = sum(sheets.steepness(places, end[looks], band) for end in (seen.antennas.tx, seen.antennas.rx))
        distance = nearest(scene, seen.antennas, box(scene.triangles.reshape(-1, 3)))
        edge = TRANSMISSION * error_budget / plan.gain * distance / max(steep * TO_CORNER, 1e-9)
        triangles, of = cut(pieces.scene.triangles[rows], edge, MOST_FACETS)
        rows = rows[of]
        longest = float(np.maximum.reduce(edges(triangles)).max())
        error = plan.gain * (plan.predicted_error + steep * TO_CORNER * longest / distance)
        wanted = np.ones(len(rows), bool)
        cut_up = FacetPieces(triangles, scene.two_sided[pieces.of[rows]], wanted, scene.triangles, pieces.of[rows])
        parts = sheets.lit_parts(cut_up, ends, request.device, **room)
        seen_rows = np.unique(rows[~np.all([one.dark for one in parts.values()], axis=0)])
        if not len(seen_rows):
            return None
        n_dark = len(np.setdiff1d(seen_rows, rows[~parts[(frozenset(),) * len(ends)].dark]))
        part = FacetSet(
            triangles, pieces.scene.reflectivity[rows], pieces.scene.two_sided[rows], pieces.scene.material[rows],
            pieces.scene.materials, None, np.arange(len(rows)), np.zeros(len(rows), np.complex128),
        )  # fmt: skip
        return cls(part, sheets, SeenThrough(triangles, parts), n_dark, error)


class SheetEchoes:
    """Facets of one channel as they are seen through thin sheets, added up frequency by frequency."""

    def __init__(self, behind: FacetsBehindSheets, view: ChannelView, first: int) -> None:
        """first  number of the channel's first pulse in the track"""
        self.behind, self.view, self.seen = behind, view, behind.seen.between(first)

    def __len__(self) -> int:
        return len(self.behind)

    def describe(self) -> dict[str, Any]:
        """Words and numbers for a report."""
        return {"facets behind sheets": len(self)}

    def add(
        self, samples: np.ndarray, pulses: Sequence[int], clock: Clock, on_progress: Callable[[int], object]
    ) -> Counts:
        """Add to samples (n_pulses, n_polarizations, n_samples) of consecutive `pulses` of the antennas.

        on_progress is called with the number of pairs of facet and pulse that are done.
        """
        counts = Counts()
        for row, p in enumerate(pulses):
            values, _, outside = self.exactly(p)
            samples[row] += values.astype(np.complex64)
            counts += Counts(len(self), outside)
            on_progress(counts.pairs)
        clock.lap("echo")
        return counts

    def exactly(self, pulse: int) -> tuple[np.ndarray, np.ndarray, int]:
        """Samples (n_polarizations, n) of a pulse at the frequencies of the view, their power at random phases, and
        the number of facets outside the range window."""
        behind, view = self.behind, self.view
        n, antennas = len(self), view.antennas
        inside = inside_window(behind.part, antennas, pulse)
        values = np.zeros((len(view.polarizations), len(view.frequencies)), np.complex128)
        powers, step = np.zeros(values.shape), max(1, AT_ONCE // n)
        for first in range(0, len(view.frequencies), step):
            here = slice(first, first + step)
            block = replace(view, frequencies=view.frequencies[here])
            waves = 2 * np.pi * block.frequencies / SPEED_OF_LIGHT
            for ways, mean in self.seen.means(pulse, antennas.tx[pulse], antennas.rx[pulse], waves):
                rows = np.flatnonzero(mean[0].any(axis=1) & inside)
                if any(ways) and len(rows):
                    through = FacetsThrough(behind.part.picked(rows), behind.sheets, ways)
                    light = Light(np.arange(len(rows)), np.ones((1, len(rows))), mean[:, rows])
                    value, power = facet_samples(through, block, pulse, np.ones(len(rows), bool), light)
                    values[:, here] += value
                    powers[:, here] += power
        return values, powers, int((~inside).sum())
