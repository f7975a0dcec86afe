"""Errors of cut facets: how their echoes cancel, and what linear phases over each piece leave of the exact integral.

Errors of pieces add up as their echoes do. What all pieces of a facet have in common, such as the mean phase of the
wave's curvature over a piece, multiplies the echo of the whole facet: it cancels between pieces just as their echoes
cancel. What differs from piece to piece does not cancel: it adds up at random phases. Errors that repeat with a period
L would add up anew in a direction in which q L is a whole number of cycles, as those of a grating do. The period is
2^(1/2) times the longest edge of right-angled pieces: no such direction exists where q edge is below 2^(1/2) pi.

docs/theory/facets.md derives it; tests/scattering/test_cutting_error.py measures it against the exact integral.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base.constants import SPEED_OF_LIGHT
from ..base.rows import spread_over
from ..base.vectors import unit
from ..numerics.pulse_geometry import PulseGeometry
from ..scene.scene import Scene
from ..scene.triangles import areas, bisect, centroids, cut, edges
from ._facet_sampling import drawn
from .physical_optics import lit_share, normals_and_areas, scattering_matrix, triangle_integral, turned

Ends = tuple[np.ndarray, np.ndarray]  # positions of transmitter and receiver, m (3,) each
FACETS = 200  # sampled facets
PIECES = 2048  # sampled pieces of all these facets
GAIN_PULSES, GAIN_FREQUENCIES = 3, 16  # the frequencies are random: a pattern may have evenly spaced nulls
MARGIN = 1.1  # the gain is estimated from samples
WHOLE_PIECES, FINEST_WHOLE = 50_000, 64  # pieces from which whole facets are added up: of all, and along an edge
WHOLE_PHASE = 0.5  # rad, of the wave's curvature over these pieces
ERROR_PULSES = FEW_PULSES = 5
# pieces, pulses and frequencies at most at which the error of few looks at a small body is measured; fewest frequencies
MEASURED, FEWEST_FREQUENCIES = 12_000, 2
MEASURED_SAFETY = 1.5  # of pieces much longer than half a wavelength, parts may have more than a 16th of the error
SAFETY = 3.0  # the errors are estimated from samples, and may differ by regions of a facet rather than piece by piece
MOST_PHASE = np.pi  # rad along an edge: below, no direction exists in which the errors of pieces add up as in a grating


def longest_piece(max_edge: float) -> float:
    """Edge, m, down to which facets are cut for a plan with `max_edge`: slightly longer.

    Plans halve the longest edge of a facet, and so does cutting: rounding alone would decide which pieces are cut once
    more, and different pieces side by side have errors that do not cancel.
    """
    return max_edge * (1 + 1e-6)


class CuttingError:
    """Errors of the coherent facets of a scene, cut to any edge; estimated from up to 200 of them."""

    def __init__(
        self, scene: Scene, mirror: np.ndarray, antennas: PulseGeometry, center: float, bandwidth: float,
        polarizations: Sequence[str], vertical: np.ndarray, steep: Sequence[Ends] = (),
    ) -> None:  # fmt: skip
        """mirror  True for coherent facets (k,);  center, bandwidth  Hz;  vertical  (3,), of the polarisations

        steep  antennas at other pulses at which errors are estimated too
        """
        some = np.flatnonzero(mirror)
        if len(some):
            length = np.maximum.reduce(edges(scene.triangles[some]))
            chosen = drawn(areas(scene.triangles[some]), FACETS, np.random.default_rng(0))[0]
            chosen[0] = np.argmax(length) if len(some) > FACETS else chosen[0]
            some = some[chosen]
        self._triangles, self._two_sided = scene.triangles[some], scene.two_sided[some]
        self._length = np.maximum.reduce(edges(self._triangles)) if len(some) else np.zeros(0)
        self._every = len(some) == int(mirror.sum()) and len(antennas.tx) <= FEW_PULSES
        self._columns = [2 * "HV".index(name[0]) + "HV".index(name[1]) for name in polarizations]
        self._vertical = vertical[0], vertical[1], vertical[2]
        highest = center + bandwidth / 2
        eps = np.array([m.permittivity(highest) for m in scene.materials], np.complex128)
        self._permittivity, self._reflectivity = eps[scene.material[some]], scene.reflectivity[some]
        self._wavenumber = 2 * np.pi * highest / SPEED_OF_LIGHT
        offset = (np.arange(GAIN_FREQUENCIES) + np.random.default_rng(2).random(GAIN_FREQUENCIES)) / GAIN_FREQUENCIES
        self._wavenumbers = 2 * np.pi * (center + bandwidth * (offset - 0.5)) / SPEED_OF_LIGHT
        ends = antennas.tx, antennas.rx
        self._gain_ends = [(ends[0][row], ends[1][row]) for row in spread_over(len(ends[0]), GAIN_PULSES)]
        self._ends = [(ends[0][row], ends[1][row]) for row in spread_over(len(ends[0]), ERROR_PULSES)]
        self._error_ends = [*self._ends, *steep]
        self._whole: np.ndarray | None = None
        self._phase: float | None = None
        self._gains: dict[float, float] = {}
        self._measured: dict[float, float | None] = {}
        self._errors: dict[float, float] = {}

    def gain(self, edge: float) -> float:
        """Norm of facets cut to `edge`, m, over that of uncut ones, both added with random phases; at least 1.

        Cutting a smooth facet makes edges whose echoes cancel again; their errors do not. Facets are taken as perfect
        conductors, at three pulses and 16 frequencies; of edges below a 64th of the longest the gain is that of a 64th.
        """
        edge = max(edge, float(self._length.max()) / FINEST_WHOLE)
        if edge not in self._gains:
            long = self._length > longest_piece(edge)
            self._gains[edge] = max(1.0, MARGIN * self._gain(edge, long)) if long.any() else 1.0
        return self._gains[edge]

    def relative(self, edge: float) -> float:
        """Error of linear phases over pieces, relative to these at random phases; inf where pieces are too long.

        It is estimated from pieces drawn from those that cutting makes, at the highest frequency and five pulses.
        """
        if self._phase is None:
            self._phase = self._largest_phase()
        if not self._phase or self._phase * edge > MOST_PHASE:
            return float("inf")
        if edge not in self._errors:
            self._errors[edge] = self._error(edge, self.gain(edge))
        return self._errors[edge]

    def measured(self, edge: float) -> float | None:
        """Error of all facets and pulses, relative to the facets as they are; None where that would take too long.

        Of few looks at a small body the errors of pieces are added up, each with its own phase: averages over pulses
        and frequencies say nothing of one look, in which the errors of pieces may all be in phase.
        """
        if not self._every:
            return None
        if edge not in self._measured:
            n = float(np.maximum(1.0, 1.5 * (self._length / edge) ** 2).sum()) * len(self._ends)
            frequencies = min(GAIN_FREQUENCIES, int(MEASURED / n))
            self._measured[edge] = self._measure(edge, frequencies) if frequencies >= FEWEST_FREQUENCIES else None
        return self._measured[edge]

    def _measure(self, edge: float, frequencies: int) -> float | None:
        parts, of = cut(self._triangles, longest_piece(edge), MEASURED)
        middle, places = centroids(self._triangles)[of], centroids(parts)
        wrong, right = np.zeros(()), np.zeros(())
        for ends in self._ends:
            seen, path = self._seen(parts, of, ends, 4), _path(ends, middle, places - middle)
            between = _path(ends, middle[:1], centroids(self._triangles) - middle[:1])
            for k in self._wavenumbers[:: -(-GAIN_FREQUENCIES // frequencies)].tolist():
                echo, finer = seen.echoes(k)
                phase, phases = np.exp(-1j * k * path), np.exp(-1j * k * between)
                for values, total in ((16 / 15 * (finer - echo), wrong), (finer, right)):
                    sums = np.stack([_sums(of, phase * column) for column in values.T])
                    total += max(float((np.abs(sums) ** 2).sum()), float((np.abs(sums @ phases) ** 2).sum()))
        return MEASURED_SAFETY * float(np.sqrt(wrong / right)) if right else None

    def _gain(self, edge: float, long: np.ndarray) -> float:
        if self._whole is None:
            self._whole = self._whole_powers()
        n, each = len(self._triangles), self._each
        pieces = _random_pieces(np.repeat(self._triangles, each, axis=0), edge)
        share = np.repeat(areas(self._triangles), each) / (each * areas(pieces))  # pieces that each represents
        powers, places = np.zeros(n), centroids(pieces)
        waves = self._wavenumbers[np.random.default_rng(3).integers(0, GAIN_FREQUENCIES, len(pieces))]
        for ends in self._gain_ends:
            q = unit(ends[0] - places) + unit(ends[1] - places)
            power = GAIN_FREQUENCIES * np.abs(triangle_integral(pieces, waves[:, None] * q)) ** 2
            powers += (share * power).reshape(n, each).sum(axis=1)
        whole = float(self._whole[long].sum())
        return float(np.sqrt(powers[long].sum() / whole)) if whole else 1.0

    def _whole_powers(self) -> np.ndarray:
        """Squares of the integrals of the facets as they are, m^4 (n,), summed over pulses and frequencies.

        Pieces that are small beside the curvature of the wave are added up, each with its own distance: where a facet
        lies in the near field, its linear phase alone would give another echo. Of a facet too large for that a part
        of the same shape represents the whole facet; its echo falls with its size no slower than that of the pieces.
        """
        triangles = self._triangles
        away = min(float(np.linalg.norm(end - triangles, axis=-1).min()) for ends in self._gain_ends for end in ends)
        finest = self._length.max() / np.clip(np.sqrt(WHOLE_PIECES / (2 * len(triangles))), 8, FINEST_WHOLE)
        flat = 1.5 * np.sqrt(WHOLE_PHASE * away / self._wavenumber)
        shrink = max(1.0, finest / flat) if flat else 1.0
        middle = centroids(triangles)[:, None]
        parts, of = cut(middle + (triangles - middle) / shrink, max(flat, finest / shrink), 100 * WHOLE_PIECES)
        out, places = np.zeros(len(triangles)), centroids(parts)
        for ends in self._gain_ends:
            q = unit(ends[0] - places) + unit(ends[1] - places)
            path = _path(ends, middle[of, 0], places - middle[of, 0])
            for k in self._wavenumbers.tolist():
                made = triangle_integral(parts, k * q) * np.exp(-1j * k * path)
                out += np.abs(_sums(of, made)) ** 2
        return out

    def _largest_phase(self) -> float:
        """Largest component of q in the plane of a facet that both antennas see, rad/m; 0 where none is seen."""
        corners, most = self._triangles.reshape(-1, 3), 0.0
        n, two_sided = (np.repeat(a, 3, axis=0) for a in (normals_and_areas(self._triangles)[0], self._two_sided))
        for ends in self._ends:
            looks = [unit(end - corners) for end in ends]
            seen = lit_share(np.where((two_sided & turned(n, *looks))[:, None], -n, n), *looks) > 0
            q = looks[0] + looks[1]
            across = np.linalg.norm(q - n * (n * q).sum(axis=1)[:, None], axis=1)
            most = max(most, float(across[seen].max(initial=0.0)))
        return most * self._wavenumber

    def _error(self, edge: float, gain: float) -> float:
        n, each = len(self._triangles), self._each
        pieces = _random_pieces(np.repeat(self._triangles, each, axis=0), edge)
        of, weight = np.repeat(np.arange(n), each), np.repeat(areas(self._triangles), each) / areas(pieces)

        def summed(values: np.ndarray) -> np.ndarray:
            return np.asarray((weight * values.sum(axis=1)).reshape(n, each).sum(axis=1))

        common = rest = power = 0.0
        for ends in self._error_ends:
            echo, finer = self._seen(pieces, of, ends, 2).echoes(self._wavenumber)
            error = 4 / 3 * (finer - echo)  # pieces of half the size have a quarter of it
            powers = summed(np.abs(echo) ** 2)
            shared = summed(error * echo.conj()) / np.where(powers > 0, powers, 1)
            common += float((np.abs(shared) ** 2 * powers).sum())
            rest += float(summed(np.abs(error - np.repeat(shared, each)[:, None] * echo) ** 2).sum())
            power += float(powers.sum())
        return SAFETY * float(np.sqrt((common / gain**2 + rest) / power)) if power else float("inf")

    def _seen(self, pieces: np.ndarray, of: np.ndarray, ends: Ends, bisections: int) -> _Seen:
        """What antennas at `ends` see of pieces (n, 3, 3), and of the 2^bisections parts of each; of  facets (n,)."""
        places, finer = centroids(pieces), [pieces]
        for _ in range(bisections):
            finer = [half for one in finer for half in _halves(one)]
        parts = [(pieces, np.zeros(len(pieces)))]
        parts += [(one, _path(ends, places, centroids(one) - places)) for one in finer]
        return _Seen([(one, *self._scattering(one, of, ends), path) for one, path in parts])

    def _scattering(self, triangles: np.ndarray, of: np.ndarray, ends: Ends) -> tuple[np.ndarray, np.ndarray]:
        """S times the reflectivity, complex128 (n, n polarisations), and u_t + u_r (n, 3)."""
        places = centroids(triangles)
        to_tx, to_rx = (unit(end - places) for end in ends)
        normals = normals_and_areas(triangles)[0]
        behind = self._two_sided[of] & turned(normals, to_tx, to_rx)
        normals = np.where(behind[:, None], -normals, normals)
        matrix = scattering_matrix(normals, to_tx, to_rx, self._permittivity[of], self._vertical)
        return matrix.reshape(-1, 4)[:, self._columns] * self._reflectivity[of, None], to_tx + to_rx

    @property
    def _each(self) -> int:
        """Sampled pieces per facet."""
        return -(-PIECES // len(self._triangles))


@dataclass(frozen=True, eq=False)
class _Seen:
    """Pieces, then the parts of each: triangles (n, 3, 3), S (n, n polarisations), u_t + u_r (n, 3), and the two-way
    path beyond that of the piece's centroid, m (n,)."""

    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]

    def echoes(self, k: float) -> tuple[np.ndarray, np.ndarray]:
        """S I of the pieces with linear phase, about their centroids, complex128 (n, n polarisations), and the same as
        sums over their parts; k  rad/m."""
        made = [
            matrix * (triangle_integral(triangles, k * q) * np.exp(-1j * k * path))[:, None]
            for triangles, matrix, q, path in self.parts
        ]
        return made[0], np.asarray(sum(made[1:]))


def _path(ends: Ends, places: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Two-way path to places + step less that to places, m (n,), as a quotient: it does not cancel at any distance."""
    out = np.zeros(len(step))
    for end in ends:
        look = end - places
        lengths = np.linalg.norm(look, axis=-1) + np.linalg.norm(look - step, axis=-1)
        out += ((step - 2 * look) * step).sum(axis=-1) / lengths
    return out


def _sums(of: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sums of complex values (n,) by the facets that they belong to."""
    return np.asarray(np.bincount(of, values.real) + 1j * np.bincount(of, values.imag))


def _halves(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return bisect(triangles, np.asarray(edges(triangles)))


def _random_pieces(triangles: np.ndarray, edge: float) -> np.ndarray:
    """One of the pieces of each triangle (n, 3, 3), as `Scene.split` makes them, with a chance that is its area."""
    out, random = triangles.copy(), np.random.default_rng(1)
    while True:
        long = np.flatnonzero(np.maximum.reduce(edges(out)) > longest_piece(edge))
        if len(long) == 0:
            return out
        first, second = _halves(out[long])  # of the same area
        out[long] = np.where(random.random(len(long))[:, None, None] < 0.5, first, second)
