"""Wrong arguments of every kind: refused in sarcl's own words, which name the argument; never in another library's."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest
from helpers.cases import noise_on, straight

import sarcl

NAN, INF = float("nan"), float("inf")
WRONG = {
    "nan": NAN, "inf": INF, "float32 nan": np.float32("nan"), "text": "x", "bytes": b"x", "list": [1, 2],
    "ragged": [[1, 2], [3]], "empty": [], "negative": -1, "huge": 1e300, "many": 10**11, "complex": 1j,
    "complex inf": complex(1, INF), "object": object(), "matrix": np.eye(2), "matrix of 4": np.eye(4),
    "vector": np.array([1, 2, 3.0]), "dict": {},
}  # fmt: skip
# words of numpy, Python and scipy that a message must not have
FOREIGN = (
    "Unable to allocate", "inhomogeneous", "setting an array element", "matmul", "__init__", "truth value",
    "could not convert", "broadcast", "unsupported operand", "not iterable", "not subscriptable", "unhashable",
    "has no attribute", "missing 1", "float()", "Maximum allowed", "too large to convert", "out of range", "nan cannot",
    "must be real", "only length-1", "object is not callable",
)  # fmt: skip

RAW = noise_on(straight(16), n_samples=32)
GRID = sarcl.ImageGrid.plane(shape=(8, 8), spacing=0.1)
CHIRP = sarcl.Waveform.chirp(center=9e9, bandwidth=1e8, duration=1e-6)
TRACK = sarcl.Trajectory.line(start=(0, -5, 1e3), velocity=(0, 10, 0), prf=16.0, n_pulses=16)
POINT, BOX = sarcl.Scene.points([[0, 0, 0]]), sarcl.shapes.box((1, 1, 1))
ARRAY = sarcl.AntennaArray.linear(3, spacing=0.015, frequency_step=1e6)
IMAGE = sarcl.Image(np.ones((8, 8), np.complex64), GRID)
LINE = {"start": (0, 0, 0), "velocity": (1, 0, 0), "prf": 1.0, "n_pulses": 3}
ALL = {name: getattr(RAW, name) for name in ("samples", "frequency", "frequency_step", "tx", "reference_range")}
VERBS = {
    "backproject": (
        lambda **k: sarcl.backproject(RAW, GRID, **k),
        "tolerance window weights beam wrap skip max_bytes mapping method tile check",
    ),
    "echo": (
        lambda **k: sarcl.echo(POINT, CHIRP, TRACK, **k),
        "tolerance polarization vertical range_window reference seed skip max_bytes antenna radar array receiver "
        "shadows check",
    ),
    "polar_format": (lambda **k: sarcl.polar_format(RAW, GRID, **k), "tolerance window weights"),
    "beam": (
        lambda **k: sarcl.beam(ARRAY, 1e10, **{"times": [0.0], "positions": [[1e3, 0, 0]], **k}),
        "times positions tolerance",
    ),
    "ImageGrid.plane": (
        lambda **k: sarcl.ImageGrid.plane(**{"shape": 4, "spacing": 1.0, **k}), "shape spacing center normal x_axis",
    ),
    "ImageGrid.points": (lambda **k: sarcl.ImageGrid.points(**k), "positions"),
    "Trajectory.line": (
        lambda **k: sarcl.Trajectory.line(**{**LINE, **k}),
        "start velocity prf n_pulses",
    ),
    "Trajectory.circle": (
        lambda **k: sarcl.Trajectory.circle(**{"radius": 1, "height": 1, "start": 0, "arc": 1, "n_pulses": 3, **k}),
        "radius height start arc n_pulses",
    ),
    "Trajectory": (
        lambda **k: sarcl.Trajectory(**{"times": [0, 1.0], "positions": [[0, 0, 0], [1, 1, 1.0]], **k}),
        "times positions velocities attitude",
    ),
    "Scene.points": (lambda **k: sarcl.Scene.points(**{"positions": [[0, 0, 0]], **k}), "positions amplitudes"),
    "Scene.facets": (
        lambda **k: sarcl.Scene.facets(**{"triangles": BOX.triangles, **k}), "triangles two_sided material roughness",
    ),
    "Scene.from_heights": (
        lambda **k: sarcl.Scene.from_heights(**{"x": [0, 1.0], "y": [0, 1.0], "z": np.zeros((2, 2)), **k}),
        "z material roughness",
    ),
    "PhaseHistory": (
        lambda **k: sarcl.PhaseHistory(**{**ALL, **k}),
        "samples frequency frequency_step tx rx reference_range time polarization weight waveform array",
    ),
    "AntennaArray.linear": (
        lambda **k: sarcl.AntennaArray.linear(**{"n": 3, "spacing": 1.0, **k}), "n spacing frequency_step axis weights",
    ),
    "AntennaArray.planar": (
        lambda **k: sarcl.AntennaArray.planar(**{"shape": (3, 3), "spacing": 1.0, **k}), "shape spacing",
    ),
    "Waveform.chirp": (
        lambda **k: sarcl.Waveform.chirp(**{"center": 1e9, "bandwidth": 1e8, "duration": 1e-6, **k}),
        "center bandwidth duration",
    ),
    "Image": (lambda **k: sarcl.Image(**{"data": IMAGE.data, "grid": GRID, **k}), "data gain frequency tx"),
    "multilook": (lambda **k: IMAGE.multilook(**k), "looks"),
    "split": (lambda **k: BOX.split(**k), "max_edge"),
    "read": (lambda **k: sarcl.read(**k), "path"),
}  # fmt: skip


@pytest.mark.parametrize("verb", VERBS)
def test_wrong_arguments_are_refused_in_words_of_sarcl_that_name_them(verb):
    call, names = VERBS[verb]
    said = []
    for name, (kind, value) in itertools.product(names.split(), WRONG.items()):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                call(**{name: value})
        except (ValueError, TypeError, OSError, MemoryError) as exc:
            wrong = [words for words in FOREIGN if words in str(exc)]
            # a refusal of float64's limits names the limit; of a track above the grid, the track
            named = (
                name.rstrip("s") in str(exc)
                or kind in ("huge", "many", "text")
                or "array" in str(exc)
                or "list of files" in str(exc)
            )
            if wrong or not named:
                said.append(f"{verb}({name}={kind}): {type(exc).__name__}: {exc}")
        except Exception as exc:
            said.append(f"{verb}({name}={kind}): bare {type(exc).__name__}: {exc}")
    assert not said, "\n".join(said)


def test_what_does_not_fit_into_memory_is_said_with_its_size_and_a_remedy():
    grid = sarcl.ImageGrid.plane(shape=(3_000_000, 1_000_000), spacing=0.1)
    for make, words in (
        (lambda: grid.positions, r"positions of 3000000 x 1000000 pixels needs 72 TB, this machine has .*take rows"),
        (lambda: sarcl.Trajectory.line(**{**LINE, "n_pulses": 10**12}), "give fewer pulses"),
        (
            lambda: sarcl.beam(ARRAY, 1e10, times=np.zeros(10**6), positions=np.ones((10**7, 3))),
            "1,000,000 times at 10,000,000 points needs 80 TB",
        ),
    ):  # fmt: skip
        with pytest.raises(MemoryError, match=words):
            make()
