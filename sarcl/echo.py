"""Echoes of points and facets, pulse by pulse, to a stated tolerance."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from . import cl, echo_rows, fineness, gains, geodesy, planning, scatterers, speckle
from .check import SarclWarning, array, choice, count, direction, instance, sealed
from .check import tolerance as allowed_error
from .echo_error import measure_error
from .facet_cut import cut
from .facet_plan import chebyshev, lagrange
from .facet_spread import FacetSpreader
from .facets import POLARIZATIONS
from .gains_error import beam_error
from .geometry import Antennas
from .phase_history import PhaseHistory
from .planning import Clock
from .report import Report
from .scene import Scene
from .spread import Spreader
from .trajectory import Trajectory
from .waveform import Waveform

SKIPS = ("zero reflectivity", "facing away", "range window", "out of beam")
LARGEST = 1e30  # amplitude whose sums and spectra still fit in complex64
UNSEEN = 1e-3  # of a tolerance: what the beam may leave out of it. So little, since what is left out may be specular
Progress = Callable[[str, int, int], None]


def echo(
    scene: Scene,
    waveform: Waveform,
    track: Trajectory,
    *,
    receiver: Trajectory | None = None,
    polarization: str | Sequence[str] = "HH",
    vertical: Any = None,
    range_window: Any = None,
    reference: Any = None,
    antenna: Any = None,
    radar: Any = None,
    shadows: bool = True,
    seed: int = 0,
    skip: Any = True,
    compressed: bool = True,
    max_edge: float | str | None = "auto",
    max_bytes: float | None = None,
    tolerance: float = 1e-3,
    check: bool | None = None,
    device: Any = None,
    progress: Progress | None = None,
) -> PhaseHistory:
    """Echoes s_p(f) = sum_k a_k(p) W(f) exp(-j 2 pi f (tau_k(p) - tau_ref(p))) of every pulse, compressed.

    scene         points (|amplitude|^2 = RCS, m^2) and facets: physical optics with the materials' Fresnel
                  coefficients, the exact phase of the wave over every facet, single scattering (docs/facets.md)
    track         transmitter; receiver  a track of as many pulses, default the transmitter's
    polarization  "HH", "HV", "VH" or "VV" (first received, then sent), a sequence of these, or "all": a row a pulse for
                  each, pulse by pulse. Points send back what they are sent: nothing in HV and VH
    vertical      (3,), which H lies across and V in a plane with; default z, or in Earth-centred coordinates the
                  ellipsoid's normal at the scene's centre
    range_window  (near, far) m about the reference, default the smallest that holds the scene plus 10 %;
                  scatterers outside it are gated out, row by row
    reference     point of zero phase, m (3,), default the centre of the scene's box
    antenna       sarcl.Antenna, or (transmitting, receiving), aimed by the tracks' attitude (sarcl.pointing); None: 1
    radar         sarcl.Radar: amplitudes fall with range, samples are in sqrt(W); None: |sample|^2 = RCS at any range
    shadows       True: of every facet only the share counts that both antennas see, along the track
                  (docs/shadows.md; points are always seen)
    seed          of the facets' random heights (scene.roughness); the same for any device and block size
    skip          True, False or a set of reasons: "zero reflectivity", "facing away", "range window",
                  "out of beam"
    compressed    False keeps the pulse's own spectrum (see `sarcl.compress`)
    max_edge      facets are cut until no edge is longer, m; "auto": as the tolerance needs, rough ones to half a
                  resolution cell too; None: left as they are
    max_bytes     memory for blocks on the device, default 1 GiB on CPUs, half the memory of a GPU
    tolerance     L2 error of the samples, relative to the larger of their norm and the norm they would have if
                  scatterers added with random phases
    check         recompute 256 random samples exactly; None: where that costs less than 2 %
    progress      called as progress(stage, done, total)

    Stop and go. Returns a PhaseHistory. ValueError, MemoryError, sarcl.NoDeviceError say what does not fit. Source:
    DESIGN.md, echo equation.
    """
    clock = Clock()
    for name, value, kind in (("scene", scene, Scene), ("waveform", waveform, Waveform), ("track", track, Trajectory)):
        instance(name, value, kind)
    seed = count("seed", seed, 0)
    opened = cl.open_device(device)
    polarizations = _polarizations(polarization)
    tolerance = allowed_error(tolerance)
    skips = planning.skips(skip, SKIPS)
    rx = echo_rows.receiver_positions(track, receiver)
    tx = track.positions
    point = scene.center if reference is None else array("reference", reference, np.float64, (3,))
    reference_range = echo_rows.half_path(tx, rx, point)
    upright = _vertical(vertical, scene.center)
    given, scene = scene, scene.realized(seed)  # before the window: it moves the corners of rough terrain
    near, far = echo_rows.window(scene, waveform, tx, rx, reference_range, range_window)
    frequency, step, n_samples = echo_rows.sampling(waveform, near, far, compressed)
    try:
        samples = np.zeros((len(tx), len(polarizations), n_samples), np.complex64)
    except (MemoryError, ValueError):
        raise MemoryError(
            f"echoes of {len(tx)} pulses x {len(polarizations)} polarisations x {n_samples} samples need "
            f"{cl.size_text(8.0 * n_samples * len(tx) * len(polarizations))}, more "
            f"than there is; narrow range_window (now {near:g} to {far:g} m) or split the track"
        ) from None
    antennas = Antennas(
        tx=tx,
        rx=None if receiver is None else rx,
        reference_range=reference_range,
        frequency=np.full(len(tx), frequency + n_samples // 2 * step),
        frequency_step=np.full(len(tx), step),
        near=np.full(len(tx), near),
        far=np.full(len(tx), far),
    )
    budget = planning.budget(opened, max_bytes)
    if progress:
        progress("scene", 0, 3)
    # points and facets err independently: each gets its share, so that the sum keeps the tolerance
    share = tolerance / np.sqrt(2 if len(scene.positions) and len(scene.triangles) else 1)
    weights = gains.beam_of(antenna, radar, track, receiver, waveform, scene.center)
    blur = beam_error(weights, scene, waveform, polarizations, upright, share)
    if "out of beam" in skips:
        weights = weights.within(UNSEEN * share / blur.dim, waveform)
    frequencies = frequency + step * np.arange(n_samples)
    points, skipped = scatterers.points_of(scene, skips, len(tx))
    facets, facet_plan, crowd, judged = None, None, 1.0, {}
    if len(scene.triangles):
        facet_plan, pieces, crowd = cut(scene, waveform, antennas, polarizations, upright, max_edge, share, blur)
        # curves are told from facets as they came, speckle from what is added up
        judged = _warned(fineness.judge(given, antennas, waveform), speckle.judge(pieces, antennas, waveform))
        if progress:
            progress("scene", 1, 3)
        facets, left_out = scatterers.facets_of(
            pieces, waveform, antennas, shadows=shadows, seed=seed, skips=skips, max_bytes=budget / 4, device=opened,
            tell=(lambda n: None) if progress is None else lambda n: progress("scene", n, 3),
        )  # fmt: skip
        skipped = {why: skipped.get(why, 0) + n for why, n in left_out.items()}
    same = [i for i, name in enumerate(polarizations) if name[0] == name[1]]
    if facets is None and points is not None and not same:
        raise ValueError(
            f"polarization is {polarization!r}, in which points send back nothing: ask for 'HH' or 'VV', or give facets"
        )
    if points is None and facets is None:
        raise ValueError(f"nothing is left to reflect: {_reasons(skipped)}; move the track or the scene")
    if points is not None:
        _bounded(points.largest() * weights.peak)
        weights.clear_of(points.positions)
    clock.lap("scene")

    total, done, gated, behind, unlit = sum(len(p) for p in (points, facets) if p is not None) * len(tx), 0, 0, 0, 0
    gate = "range window" in skips

    def tell(n: int) -> None:
        if progress:
            progress("echo", done + n, total)

    tell(0)
    plans: list[tuple[float, dict[str, Any]]] = []
    if points is not None:
        if same:
            nodes = chebyshev(waveform.center, waveform.bandwidth, blur.nodes(0.3 * share))
            error = blur.of(len(nodes), share)
            spreader = Spreader(
                opened, antennas, waveform.bandwidth, n_samples, share - error, budget, gate, weights,
                lagrange(nodes, frequencies), nodes,
            )  # fmt: skip
            plan, gated, unlit = spreader.add(points, samples[:, same[0]], clock, tell)
            samples[:, same[1:]] = samples[:, same[:1]]
            plans.append((plan.predicted_error + error, plan.describe("spread")))
        done += len(points) * len(tx)
    if facets is not None:
        assert facet_plan is not None
        facet_spreader = FacetSpreader(
            opened, antennas, waveform.bandwidth, frequencies, share / crowd, budget, gate, polarizations,
            facet_plan, upright, weights,
        )  # fmt: skip
        plan, knots, outside, behind, dark = facet_spreader.add(facets, samples, clock, tell)
        gated, unlit = gated + outside, unlit + dark
        how = plan.describe("spread") | facet_plan.describe() | {"pulses an amplitude": knots.spacing} | judged
        plans.append((crowd * (plan.predicted_error + facet_plan.predicted_error + knots.error), how))
    if gated == total:
        raise ValueError(
            f"every scatterer is outside the range window of {near:g} to {far:g} m about the reference; "
            "widen range_window or move reference"
        )
    if gated + unlit == total:
        raise ValueError("no scatterer in the range window is ever in the beam; aim the antenna with sarcl.pointing")
    if gated + unlit + behind == total:
        raise ValueError("every facet in the range window faces away from an antenna; move the track or turn the scene")
    pulse = waveform.pulse_spectrum(frequencies)
    spectrum = (np.abs(pulse) ** 2 if compressed else pulse) * weights.factor(frequencies)
    samples *= spectrum.astype(np.complex64)
    clock.lap("spectra")
    measured = None
    exact_seconds = 256 * (0 if points is None else len(points)) * 6e-8 + (0 if facets is None else len(facets)) * 1e-4
    if check or (check is None and exact_seconds < 0.02 * clock.seconds.get("echo", 0.0)):
        measured = measure_error(
            points, facets, antennas, frequencies, spectrum, samples, polarizations, upright, weights
        )
        clock.lap("check")
    n = len(polarizations)

    def every(values: Any) -> Any:
        return values if n == 1 or values is None else np.repeat(values, n, axis=0)

    velocities = [t.velocities for t in (track, track if receiver is None else receiver)]
    skipped["facing away"] = skipped.get("facing away", 0) + behind
    if weights.pair is not None:
        skipped["out of beam"] = unlit
    chosen = max(plans, key=lambda p: p[0])[1] if plans else {}
    return PhaseHistory(
        sealed(samples.reshape(-1, n_samples)),
        frequency=frequency,
        frequency_step=step,
        tx=every(tx),
        rx=None if receiver is None else every(rx),
        reference_range=every(reference_range),
        time=every(track.times),
        polarization=np.tile(polarizations, len(tx)),
        tx_velocity=every(velocities[0]),
        rx_velocity=every(velocities[1]),
        waveform=waveform,
        compressed=compressed,
        report=Report(
            plan={"model": "stop and go, single scattering", **chosen, **weights.describe(blur)} if plans else {},
            tolerance=tolerance,
            predicted_error=float(np.sqrt(sum(error**2 for error, _ in plans))),
            measured_error=measured,
            contributions_done=total - gated - behind - unlit,
            contributions_skipped={**skipped, "range window": gated},
            seconds=clock.seconds,
            device=opened.info.name,
            seed=seed,
        ),
    )


def _warned(*judgements: fineness.Fineness | speckle.Speckle) -> dict[str, Any]:
    """SarclWarnings of what was judged, and what it says in a report."""
    out: dict[str, Any] = {}
    for judgement in judgements:
        for text in judgement.warnings():
            warnings.warn(text, SarclWarning, stacklevel=3)
        out |= judgement.describe()
    return out


def _polarizations(asked: Any) -> tuple[str, ...]:
    """Names in the order of a pulse's rows; ValueError for unknown, repeated or none."""
    if isinstance(asked, str):
        asked = POLARIZATIONS if asked == "all" else (asked,)
    names = tuple(asked) if isinstance(asked, Sequence) else ()
    if not names or len(set(names)) < len(names):
        raise ValueError(f"polarization is {asked!r}; give at least one, and each once")
    for name in names:
        choice("polarization", name, POLARIZATIONS)
    return names


def _vertical(asked: Any, center: np.ndarray) -> np.ndarray:
    """Unit vector (3,): as asked, the ellipsoid's normal at an Earth-centred `center`, m (3,), or z."""
    if asked is not None:
        return direction("vertical", asked)
    normal = geodesy.vertical_at(center)
    return np.array([0.0, 0.0, 1.0]) if normal is None else normal


def _bounded(largest: float) -> None:
    if largest > LARGEST:
        text = f"amplitudes reach {largest:g}; echoes in complex64 hold up to {LARGEST:g}"
        raise ValueError(text + ": scale them down")


def _reasons(skipped: dict[str, int]) -> str:
    return ", ".join(why for why, n in skipped.items() if n) or "the scene is empty"
