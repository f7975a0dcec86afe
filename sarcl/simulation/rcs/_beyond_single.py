"""What edges diffract and facets reflect to one another, in directions: as antennas at a large distance see it.

Their engines take places of antennas. From the distance R = size/sqrt(eps), eps of float64, waves are plane to
k size^2/R, and paths are rounded to eps k R: both are k size sqrt(eps).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.constants import SPEED_OF_LIGHT
from ...base.errors import NotApplicable
from ...base.report import SMALLER_TOLERANCE, ErrorTerm
from ...base.stage_timer import Clock
from ...numerics.pulse_geometry import PulseGeometry
from ...scattering import added_models
from ...scattering.antenna_weights import AntennaWeights
from ..bounces.bounce_spreader import BounceScene, BounceSpreader
from ..edges.edge_echoes import EdgeEchoes, PreparedEdges
from ..reflection_options import refuse_forward_with
from ..spreading import ChannelView
from ._rcs_task import UP, RcsTask

ROUNDING = float(np.sqrt(np.finfo(float).eps))
SHARE = 0.5  # of the tolerance, for edges, and for several reflections


def terms_beyond(task: RcsTask) -> tuple[ErrorTerm, ...]:
    """Errors of edges and of several reflections, each relative to its own norm."""
    options, terms = task.options, []
    if options.edges:
        terms.append(ErrorTerm("edges", SHARE * options.tolerance, SMALLER_TOLERANCE))
    if options.bounces > 1:
        terms.append(ErrorTerm("bounces", SHARE * options.tolerance, SMALLER_TOLERANCE))
    if terms:
        k = 2 * np.pi * float(task.frequencies.max()) / SPEED_OF_LIGHT
        terms.append(ErrorTerm("waves from a distance", 4 * k * _size(task) * ROUNDING, "a smaller scene"))
    return tuple(terms)


def refuse_together(task: RcsTask) -> None:
    """NotApplicable or ValueError for options that do not go with edges or several reflections."""
    options = task.options
    both = (("edges=True", options.edges), (f"bounces={options.bounces}", options.bounces > 1))
    asked = [name for name, value in both if value]
    if not asked:
        return
    if task.is_forward:
        refuse_forward_with(options.bounces, options.edges)
    if options.bounces > 1 and not options.shadows:
        raise ValueError(
            f"bounces is {options.bounces} with shadows=False; what reflects to another facet also shades it: give "
            "shadows=True"
        )
    if options.check:
        raise NotApplicable(f"check=True recomputes single reflections alone, not those of {asked[0]}; leave one out")
    added_models.refuse(task.scene, asked[0], "leave it out")
    if task.scene.sheets.any():
        raise NotApplicable(
            f"the scene has thin sheets (a material with a thickness), not computed with {asked[0]}: leave it out, or "
            "give materials without thickness"
        )


def add_beyond_single_reflections(task: RcsTask, out: np.ndarray) -> None:
    """Add to amplitudes (n directions, n frequencies, n_polarizations) what the options ask for."""
    options, scene = task.options, task.scene
    refuse_together(task)
    if not len(scene.triangles) or not (options.edges or options.bounces > 1):
        return
    distance, center = _size(task) / ROUNDING, scene.center
    tx = center + distance * task.to_tx
    rx = tx if task.to_rx is task.to_tx else center + distance * task.to_rx
    # zero phase at the origin: a point at x has the phase k (u_t + u_r).x
    reference = distance + (task.to_tx + task.to_rx) @ center / 2
    antennas = PulseGeometry(tx, rx, reference)
    frequencies = np.sort(task.frequencies)
    weights = AntennaWeights(antennas, float(frequencies[-1]))
    view = ChannelView(antennas, weights, frequencies, 0.0, task.polarizations, UP, gated=False)
    share = SHARE * options.tolerance
    diffracting = None
    if options.edges:
        prepared = PreparedEdges.pieces_of(scene, options.crease, np.inf, task.shading_device, share)
        edges, diffracting = EdgeEchoes(prepared, view), prepared.pieces.wedges
        for rows, values, _ in edges.exactly(np.arange(len(tx)), task.frequencies):
            out[rows] += values.transpose(0, 2, 1)
    bounced = BounceScene.of(scene, options.bounces, share, float(frequencies[-1]))
    if bounced is not None:
        bounced.refuse_many(tx, rx)
        for rows, values in BounceSpreader(bounced, view, diffracting).exactly(np.arange(len(tx)), task.frequencies):
            out[rows] += values.transpose(0, 2, 1)


def seconds_beyond(task: RcsTask) -> float:
    """Seconds of what the options ask for in all directions, from those of the middle one."""
    if not (task.options.edges or task.options.bounces > 1):
        return 0.0
    n, clock = len(task.to_tx), Clock()
    tx = task.to_tx[[n // 2]]
    one = replace(task, to_tx=tx, to_rx=tx if task.to_rx is task.to_tx else task.to_rx[[n // 2]])
    add_beyond_single_reflections(one, np.zeros((1, len(task.frequencies), len(task.polarizations)), np.complex128))
    clock.lap("one")
    return n * clock.seconds["one"]


def _size(task: RcsTask) -> float:
    return max(float(np.linalg.norm(np.diff(task.scene.bounds, axis=0))), 1e-3)
