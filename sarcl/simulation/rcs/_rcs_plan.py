"""Plan of radar cross sections: facets and points summed in float64 on the host, direction by direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...base.constants import EDGE_ON, SPEED_OF_LIGHT
from ...base.errors import NotApplicable, ToleranceMissed, ToleranceUnreachable, warn
from ...base.forecast import Forecast
from ...base.report import ErrorTerm, root_sum_square
from ...base.tolerances import rounded_up
from ...model.waveform import Waveform
from ...numerics.error_bounds import FLOAT32
from ...numerics.pulse_geometry import PulseGeometry
from ...opencl.memory_budget import budget
from ...scattering.facets import POLARIZATIONS, FacetSet, Light
from ...scattering.mesh_quality import facet_error
from ...scattering.thin_sheets import SeenThrough, ThinSheets, may_hide
from ...scene.triangles import centroids, normals
from ...visibility.lit_parts import FacetPieces, LitParts
from ..echo_check import exact_light
from ..echo_sampling import warn_of_wide_angles
from ..scene_defects import warn_of_coincident
from ._beyond_single import add_beyond_single_reflections, seconds_beyond, terms_beyond
from ._rcs_task import UP, RcsTask

# Distance of the antennas from the scene, over its size: directions differ over the scene by the inverse, and float64
# resolves them to 1e-16 at any distance
FAR = 1e12
AT_ONCE = 2**26  # bytes of amplitudes, and of what directions see of partly lit facets, that are held at once
CHECKED = 16  # values that are recomputed
LEAST_SIZE = 1e-3  # m, of a scene, in that distance
JUDGED_FROM = 1e4  # distance from which flat facets are judged, over the scene's size
JUDGED_BAND = 1e-6  # smallest relative bandwidth at which flat facets are judged: that of one frequency
# s on one core, per facet and direction, per frequency of these, per point and frequency, per direction (2026-11-27)
PER_LOOK, PER_FACET, PER_POINT, PER_DIRECTION = 7e-7, 3e-7, 5e-8, 7e-4
# bytes of a call, per facet (what directions see of it, and how well flat facets stand for a curved surface), per point
# and frequency: peaks of allocations, 2026-11-28
PER_CALL, FACET_BYTES, POINT_BYTES = 16e3, 6000.0, 28.0
SHADOWS = 7.0  # per facet and direction, over that: lit parts of a car of 792 facets (2026-11-27)


@dataclass(frozen=True, eq=False)
class RcsPlan:
    """The plan of a task."""

    task: RcsTask

    def __post_init__(self) -> None:
        error, tolerance = root_sum_square(self.error_terms), self.task.options.tolerance
        if error > tolerance:
            raise ToleranceUnreachable(tolerance, rounded_up(error), "rounding of phases and of lit parts")

    @cached_property
    def error_terms(self) -> tuple[ErrorTerm, ...]:
        """Parts of the predicted error, relative to every single contribution."""
        task = self.task
        k = 2 * np.pi * float(task.frequencies.max()) / SPEED_OF_LIGHT
        reach = float(np.abs(task.scene.bounds).max())
        size = float(np.linalg.norm(np.diff(task.scene.bounds, axis=0)))
        terms = [ErrorTerm("phases in float64", 8 * np.finfo(float).eps * (1 + k * reach), "a scene near the origin")]
        if len(task.scene.triangles):
            terms.append(ErrorTerm("plane waves", (1 + 2 * k * size) / FAR, "a smaller scene"))
        if self._may_shade:
            terms.append(ErrorTerm("lit parts in complex64", FLOAT32.unit, "shadows=False"))
        return (*terms, *terms_beyond(task))

    @property
    def _may_shade(self) -> bool:
        return self.task.options.shadows and len(self.task.scene.triangles) > 1

    def forecast(self) -> Forecast[np.ndarray]:
        """Its Forecast."""
        task, n = self.task, len(self.task.to_tx)
        facets, points, m = len(task.scene.triangles), len(task.scene.positions), len(task.frequencies)
        looks = PER_LOOK * (1 + SHADOWS * self._may_shade)
        return Forecast(
            "direct",
            {"directions": n, "frequencies": m, "facets": facets, "points": points},
            n * (PER_DIRECTION + facets * (looks + PER_FACET * m) + PER_POINT * points * m) + seconds_beyond(task),
            self._bytes(),
            root_sum_square(self.error_terms),
            self.run,
            self.error_terms,
        )

    def _bytes(self) -> float:
        """Memory of the result, and of what is held at once beside it."""
        task, scene, n = self.task, self.task.scene, len(self.task.to_tx)
        amplitudes = 16.0 * len(task.frequencies) * len(task.polarizations)
        held = min(AT_ONCE, amplitudes * len(scene.triangles)) + (2 * AT_ONCE if task.options.edges else 0)
        points = POINT_BYTES * len(scene.positions) * len(task.frequencies)
        return n * amplitudes + PER_CALL + FACET_BYTES * len(scene.triangles) + points + held

    def run(self) -> np.ndarray:
        """Amplitudes, m, of the task's shape."""
        task = self.task
        out = np.zeros((len(task.to_tx), len(task.frequencies), len(task.polarizations)), np.complex128)
        self._add_points(out)
        if task.options.check and self._sheets is not None:
            raise NotApplicable("check=True has no second way to compute what thin sheets let through; leave it out")
        part = self._facets()
        if part is not None:
            warn_of_curves(task)
            warn_of_coincident(task.scene)
            warn_of_wide_angles(task.to_tx, task.to_rx, task.options.forward)
            self._add_facets(part, out)
            if task.options.check:
                self._confirm(part, out)
        add_beyond_single_reflections(task, out)
        return out.reshape(task.shape)

    def _add_points(self, out: np.ndarray) -> None:
        scene, task = self.task.scene, self.task
        same = [i for i, name in enumerate(task.polarizations) if name[0] == name[1]]
        if not len(scene.positions) or not same:
            return
        path = (task.to_tx + task.to_rx) @ scene.positions.T
        for j, f in enumerate(task.frequencies.tolist()):
            wave = np.exp(2j * np.pi * f / SPEED_OF_LIGHT * path)
            out[:, j, same] += (wave @ scene.at_frequency(f).amplitudes)[:, None]

    @cached_property
    def _distance(self) -> float:
        """Distance of the antennas, m."""
        return FAR * max(float(np.linalg.norm(np.diff(self.task.scene.bounds, axis=0))), LEAST_SIZE)

    def _place(self, directions: np.ndarray) -> np.ndarray:
        """Places of antennas in these directions (..., 3), m, so far away that their waves are plane."""
        return np.asarray(self.task.scene.center + self._distance * directions)

    @property
    def _antennas(self) -> list[np.ndarray]:
        """Places of the antennas, m (n, 3), one or two for each direction."""
        return [self._place(u) for u in self.task.ends]

    @cached_property
    def _sheets(self) -> tuple[ThinSheets, SeenThrough] | None:
        """Thin sheets, and what is seen through them; None: there are none, or nothing else."""
        task, scene = self.task, self.task.scene
        if not self._may_shade or not may_hide(scene):
            return None
        keep, device = np.flatnonzero(scene.reflectivity > 0), task.device
        sheets = ThinSheets.of(scene, self._antennas, forward=task.is_forward)
        pieces = scene.triangles[keep]
        facets, max_bytes = FacetPieces.uncut(pieces, scene.two_sided[keep]), budget(device, task.options.max_bytes)
        parts = sheets.lit_parts(facets, self._antennas, device, max_bytes, self._progress("shadows"))
        return sheets, SeenThrough(pieces, parts)

    def _facets(self) -> FacetSet | None:
        """The facets that reflect, with what the directions see of them."""
        task, scene = self.task, self.task.scene
        keep = np.flatnonzero(scene.reflectivity > 0)
        if not len(keep):
            return None
        lit_parts, rows = None, None
        if self._may_shade and self._sheets is None:
            forward = task.options.forward
            pieces = FacetPieces.uncut(scene.triangles[keep], scene.two_sided[keep], forward=forward)
            lit_parts = LitParts(
                task.device,
                pieces,
                scene.triangles,
                self._antennas,
                max_bytes=budget(task.device, task.options.max_bytes),
                progress=self._progress("shadows"),
            )
            rows = np.where(lit_parts.partly, np.cumsum(lit_parts.partly) - 1, -1)
            seen = ~lit_parts.dark
            keep, rows = keep[seen], rows[seen]
        if not len(keep):
            return None
        return FacetSet(
            scene.triangles[keep],
            scene.reflectivity[keep],
            scene.two_sided[keep],
            scene.material[keep],
            scene.materials,
            None,
            np.arange(len(keep)),
            np.zeros(len(keep), np.complex128),
            lit_parts,
            rows,
            forward=task.is_forward,
        )

    def _progress(self, stage: str) -> Callable[[int, int], None]:
        report = self.task.options.progress
        return lambda done, total: report(stage, done, total) if report else None

    def _add_facets(self, part: FacetSet, out: np.ndarray) -> None:
        task, ends, n = self.task, self._antennas, len(out)
        report = self._progress("facets")
        most = AT_ONCE // 16 // (len(part) * len(task.polarizations) + part.n_partly_lit)
        bands = np.array_split(np.arange(len(task.frequencies)), -(-len(task.frequencies) // max(1, most)))
        for number, band in enumerate(bands):
            frequencies = task.frequencies[band]
            waves = 2 * np.pi * frequencies / SPEED_OF_LIGHT
            step = max(1, AT_ONCE // 8 // max(1, part.n_partly_lit * len(band)))
            for first in range(0, n, step):
                rows = range(first, min(first + step, n))
                light = part.light(first, [end[first : rows.stop] for end in ends], waves)
                for p in rows:
                    seen = Light(light.index, light.share[p - first :][:1], light.mean[p - first :][:1])
                    if self._sheets is None:
                        out[p, band] += self._sum(part, p, frequencies, seen)[0]
                    else:
                        out[p, band] += self._through(*self._sheets, part, p, frequencies)
                report(number * n + rows.stop, len(bands) * n)

    def _through(
        self, sheets: ThinSheets, seen: SeenThrough, part: FacetSet, p: int, frequencies: np.ndarray
    ) -> np.ndarray:
        """As `_sum`, of facets that are seen past thin sheets, or through them: (n frequencies, n_polarizations)."""
        task, waves = self.task, 2 * np.pi * frequencies / SPEED_OF_LIGHT
        every, columns = np.arange(len(part)), [POLARIZATIONS.index(name) for name in task.polarizations]
        asked = replace(self, task=replace(task, polarizations=POLARIZATIONS))
        total = np.zeros((len(frequencies), 4), np.complex128)
        looks = task.to_tx[p], task.to_rx[p]
        for ways, mean in seen.means(p, self._place(looks[0]), self._place(looks[1]), waves):
            light = Light(every, np.ones((1, len(part))), mean)
            matrix = asked._sum(part, p, frequencies, light)[0].reshape(-1, 2, 2)
            passed = [
                sheets.transmission(through, task.scene.center[None], -look[None], frequencies)[0]
                for through, look in zip(ways, looks, strict=False)
            ]
            total += (np.swapaxes(passed[-1], 1, 2) @ matrix @ passed[0]).reshape(-1, 4)
        return total[:, columns]

    def _sum(self, part: FacetSet, p: int, frequencies: np.ndarray, light: Light) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes of facets in direction p (n frequencies, n_polarizations), and their power at random phases.

        light  what the direction sees of partly lit facets
        """
        to_tx, to_rx = self.task.to_tx[p], self.task.to_rx[p]
        part, light = _facing(part, light, to_tx, to_rx)
        ends = self._place(to_tx), self._place(to_rx)
        sent = part.amplitudes(*ends, frequencies, self.task.polarizations, UP, light)
        path = centroids(part.triangles) @ (to_tx + to_rx)
        wave = np.exp(2j * np.pi / SPEED_OF_LIGHT * frequencies[:, None] * path)
        return (wave[:, None] @ sent)[:, 0], (np.abs(sent) ** 2).sum(axis=1)

    def _confirm(self, part: FacetSet, out: np.ndarray) -> None:
        """ToleranceMissed where random values differ by more than the tolerance from the exact sum, shadows by the
        reference."""
        task, random = self.task, np.random.default_rng(0)
        antennas = PulseGeometry(self._antennas[0], self._antennas[-1])
        wrong = right = power = 0.0
        for p in random.integers(0, len(out), CHECKED).tolist():
            j = random.integers(0, len(task.frequencies), 1)
            f = task.frequencies[j]
            exact = np.zeros((1, 1, len(task.polarizations)), np.complex128)
            RcsPlan(replace(task, to_tx=task.to_tx[[p]], to_rx=task.to_rx[[p]], frequencies=f))._add_points(exact)
            value, at_random = self._sum(part, p, f, exact_light(part, antennas, p, f))
            wrong += float((np.abs(out[p, j] - exact[0] - value) ** 2).sum())
            right += float((np.abs(exact[0] + value) ** 2).sum())
            power += float(at_random.sum())
        measured = float(np.sqrt(wrong / max(right, power))) if wrong else 0.0
        if not (measured <= task.options.tolerance and np.isfinite(out).all()):
            predicted = root_sum_square(self.error_terms)
            raise ToleranceMissed(task.options.tolerance, measured, values=out.reshape(task.shape), predicted=predicted)


def _facing(part: FacetSet, light: Light, to_tx: np.ndarray, to_rx: np.ndarray) -> tuple[FacetSet, Light]:
    """Those facets that both directions look at from a side that reflects, and what they see of these."""
    normal = normals(part.triangles)
    cosines = np.stack([normal @ to_tx] if part.forward else [normal @ to_tx, normal @ to_rx])
    side = np.where(part.two_sided & (cosines.sum(axis=0) < 0), -1.0, 1.0)
    rows = np.flatnonzero((side * cosines > -2 * EDGE_ON).all(axis=0))
    number = np.full(len(part), -1)
    number[rows] = np.arange(len(rows))
    number = number[light.index]
    seen = number >= 0
    return part.picked(rows), Light(number[seen], light.share[:, seen], light.mean[:, seen])


def warn_of_curves(task: RcsTask) -> None:
    """Warn of facets that are too large for the curves that they approximate."""
    low, high = float(task.frequencies.min()), float(task.frequencies.max())
    center = (low + high) / 2
    band = Waveform.chirp(center=center, bandwidth=max(high - low, JUDGED_BAND * center), duration=1.0)
    size = float(np.linalg.norm(np.diff(task.scene.bounds, axis=0)))
    tx, rx = (task.scene.center + JUDGED_FROM * size * u for u in (task.to_tx, task.to_rx))
    for number, text in enumerate(facet_error.judge(task.scene, PulseGeometry(tx, rx), band).warnings()):
        warn(text, f"FacetError {number}")
