"""AFRL Gotcha volumetric SAR data set, version 1.0: one MATLAB 5 file per degree of azimuth.

Struct `data`: fp complex (n_frequencies, n_pulses), freq Hz, x y z antenna m, r0 m, and optionally
af.r_correct m and af.ph_correct rad. A return is fp ~ exp(-j 4 pi f dR/c), dR = |p - antenna| - |antenna|,
the origin being the scene centre.

Which reference. Everything is float32, which at 10 km leaves two readings of |antenna|: the field r0,
rounded to 1 mm, and |x, y, z|, from components rounded to 0.5 mm. They differ by up to 0.74 mm, 0.3 rad.
Measured over pass 1, HH, azimuth 1 and 2 deg together (exact sums about the reflectors; entropy of a 96 m
scene at 0.2 m):

    reference   phase scatter, pulse to pulse   peak powers of three reflectors   scene entropy
    |x, y, z|   0.163 rad                       1178.7   336.8   95.5             9.170
    r0          0.215 rad                       1155.4   332.2   94.4             9.245

so the reference is |x, y, z|: the position's rounding then cancels in dR. r0 only serves as a check.

Autofocus multiplies fp by exp(j (s ph_correct + t 4 pi f r_correct/c)); signs by measurement, same data:

    s, t        peak powers of three reflectors
    +, -        1192.5   312.4   89.7      <- these
    -, +         986.4   304.7   84.8
    +, +           7.6     2.4    1.3
    -, -           3.9     2.1    0.7
    0, 0        1178.7   336.8   95.5

The brightest reflector's range, pulse by pulse, follows -r_correct with correlation 0.97, and the two terms
cancel best at 9.594 GHz, 0.05 % from the carrier. So the fields follow that one reflector, its noise
included: it gains 1 %, others lose 6 to 7 %, scene entropy rises to 9.358 and the picture moves by
(-0.4, -0.6) m. These two degrees focus better without them; over more than two nothing was measured.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import DTypeLike

from ..base import constants, validation
from ..base.types import PathLike
from . import _mat5_checks
from .formats import Make, T


def load(path: PathLike, make: Make[T], autofocus: bool = False) -> T:
    """make("phase history", fields) of one Gotcha file.

    samples          complex64 (n_pulses, n_frequencies)
    frequency        of sample 0, Hz, and
    frequency_step   Hz: the straight line through the file's float32 frequencies
    tx               m (n_pulses, 3), the file's float32 values
    reference_range  m (n_pulses,), |tx|
    polarization     "HH", ... from the file's name, or None

    autofocus applies the file's af.r_correct and af.ph_correct where it has them.
    ValueError names the file and the field that is missing, misshapen, not finite or not uniform.
    """
    path = Path(path)
    data = _struct(path)
    fp = _field(path, data, "fp", np.complex128, ("n_frequencies", "n_pulses"))
    n_frequencies, n_pulses = fp.shape
    freq = _vector(path, data, "freq", n_frequencies)
    x, y, z, r0 = (_vector(path, data, name, n_pulses) for name in ("x", "y", "z", "r0"))
    frequency, step = _line(path, freq)
    tx = np.stack([x, y, z], axis=1)
    reference = np.linalg.norm(tx, axis=1)
    worst = int(np.argmax(np.abs(reference - r0)))
    if abs(reference[worst] - r0[worst]) > 3e-7 * reference[worst]:  # a few roundings of float32
        raise ValueError(
            f"{path.name}: r0[{worst}] is {r0[worst]:.4f} m but |x, y, z| is {reference[worst]:.4f} m; they "
            "must agree to float32: Gotcha counts range from the origin of x, y, z"
        )
    samples = fp.T
    if autofocus:
        r, phase = _corrections(path, data, n_pulses)
        k = 4 * np.pi / constants.SPEED_OF_LIGHT * (frequency + step * np.arange(n_frequencies))
        samples = samples * np.exp(1j * (phase[:, None] - r[:, None] * k))
    name = re.search(r"_(HH|HV|VH|VV)(?![A-Za-z])", path.name)
    fields = {
        "samples": np.ascontiguousarray(samples, np.complex64),
        "frequency": frequency,
        "frequency_step": step,
        "tx": tx,
        "reference_range": reference,
        "polarization": name[1] if name else None,
        "compressed": True,
    }
    try:
        return make("phase history", fields)
    except ValueError as exc:
        raise ValueError(f"{path.name}: {exc}") from None


def _struct(path: Path) -> np.void:
    """The struct `data` of a MATLAB 5 file."""
    from scipy.io import loadmat

    with open(path, "rb") as file:
        try:
            _mat5_checks.check(file.read())
            file.seek(0)
            variables = loadmat(file, variable_names=["data"])
        except NotImplementedError:
            raise ValueError(f"{path.name} is a MATLAB 7.3 file, wanted MATLAB 5; save it again with -v7") from None
        except Exception as exc:  # scipy's parser fails in a dozen ways on a damaged file
            raise ValueError(
                f"{path.name} cannot be read as a MATLAB 5 file ({str(exc) or type(exc).__name__}); "
                "it is truncated, damaged or something else: copy it again"
            ) from None
    data = variables.get("data")
    if data is None:
        raise ValueError(f"{path.name} has no struct 'data', wanted a Gotcha file; it is truncated or another data set")
    if data.dtype.names is None or data.size != 1:
        kind = "a struct" if data.dtype.names else f"{data.dtype}"
        raise ValueError(
            f"{path.name}: 'data' is {kind} of shape {data.shape}, wanted one struct with fp, freq, x, y, z, r0"
        )
    return data.reshape(-1)[0]


def _field(path: Path, struct: np.void, name: str, dtype: DTypeLike, shape: tuple[int | str, ...]) -> np.ndarray:
    if name not in (struct.dtype.names or ()):
        have = ", ".join(struct.dtype.names or ()) or "nothing"
        raise ValueError(f"{path.name}: 'data' has no field {name!r}; it has {have}: is this a Gotcha file?")
    if np.iscomplexobj(struct[name]) and not np.issubdtype(dtype, np.complexfloating):
        raise ValueError(f"{path.name}: {name} is complex, wanted real values")
    return validation.array(f"{path.name}: {name}", struct[name], dtype, shape)


def _vector(path: Path, struct: np.void, name: str, length: int) -> np.ndarray:
    """A field of `length` real values, stored as a row or a column."""
    value = _field(path, struct, name, np.float64, ("rows", "columns"))
    if value.size != length or 1 not in value.shape:
        raise ValueError(
            f"{path.name}: {name} has shape {value.shape}, wanted {length} values to fit fp "
            "(n_frequencies, n_pulses): the file is damaged or of another data set"
        )
    return value.ravel()


def _line(path: Path, freq: np.ndarray) -> tuple[float, float]:
    """First frequency and step, Hz, of the least-squares line; the values must lie on it to float32."""
    if len(freq) < 2:
        raise ValueError(f"{path.name}: freq has {len(freq)} value; a frequency step needs at least two")
    n = np.arange(len(freq)) - (len(freq) - 1) / 2
    step = float(n @ freq / (n @ n))
    off = np.abs(freq - freq.mean() - step * n)
    allowed = float(np.spacing(np.float32(np.abs(freq).max())))
    if off.max() > allowed:
        raise ValueError(
            f"{path.name}: freq[{int(off.argmax())}] is {off.max():.3g} Hz off a uniform step, "
            f"float32 explains {allowed:.3g} Hz; resample the data to uniform frequencies"
        )
    return float(freq.mean() + step * n[0]), step


def _corrections(path: Path, data: np.void, n_pulses: int) -> tuple[np.ndarray, np.ndarray]:
    """af.r_correct, m, and af.ph_correct, rad, (n_pulses,) each; zero where the file has none."""
    zero = np.zeros(n_pulses)
    af = data["af"] if "af" in (data.dtype.names or ()) else None
    if af is None or af.size == 0 or af.dtype.names is None:
        return zero, zero
    af = af.reshape(-1)[0]
    r, phase = (
        _vector(path, af, name, n_pulses) if name in (af.dtype.names or ()) and af[name].size else zero
        for name in ("r_correct", "ph_correct")
    )
    return r, phase
