"""`sarcl bench backproject`: run time against achieved error, sarcl and peers on the same data in one run."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..base.validation import choice, count
from ..imaging.choose_method import METHODS
from . import _cases, _peers, _run_sarcl, baseline, tables
from ._competitor import Absent, Competitor
from ._measure import Paces, alternate, measure
from .documents import Document, Measuring, header, load

TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6)


@dataclass(frozen=True, kw_only=True)
class Setting(Measuring):
    """What is measured, and how.

    scenes, data   see `_cases.make`;  sizes  pulses = samples = pixels a side, of "spaceborne" samples and pixels
    methods        "direct", "factorized", "auto"
    peer_python    an interpreter that has fastsar, default this one;  peer_backend  which of its backends
    with_peers     NumPy and fastsar are measured too
    pixels         number of pixels checked against the exact sum, at least 256
    """

    scenes: Sequence[str] = _cases.DEFAULT_SCENES
    sizes: Sequence[int] = (1024,)
    tolerances: Sequence[float] = TOLERANCES
    methods: Sequence[str] = ("direct", "factorized")
    data: str | None = None
    peer_python: str | None = None
    peer_backend: str = "cpu"
    with_peers: bool = True
    repeats: int = 5
    pixels: int = 1024

    def __post_init__(self) -> None:
        super().__post_init__()
        for scene in self.scenes:
            choice("scene", scene, _cases.SCENES)
        if "spaceborne" in self.scenes:
            choice("data of spaceborne", self.data or "noise", ("noise",))
        for method in self.methods:
            choice("method", method, METHODS)
        count("pixels", self.pixels, least=256)
        object.__setattr__(self, "peer_python", _peers.check_python(self.peer_python))


def run(
    *,
    say: Callable[[str], None] = lambda text: None,
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None,
    keep: Callable[[Document], None] = lambda document: None,
    **options: Any,
) -> Document:
    """Measure; returns a document ready for JSON.

    say, progress  lines of text; progress(stage, done, total);  keep(document) is called after every case
    options        those of a Setting. ValueError for what does not fit, before the work; NoDeviceError.
    """
    setting = Setting(**options)
    opened = setting.opened_devices()
    document: Document = {**header(opened), "cases": []}
    with ExitStack() as stack:
        peer = None
        if setting.with_peers:
            peer, description = _opened_peer(stack, str(setting.peer_python), setting.peer_backend)
            document["peers"].append(description)
        for line in tables.machine_text(document):
            say(line)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="sarcl-bench-")))
        for scene in setting.scenes:
            paces: Paces = {}
            for n in sorted(set(setting.sizes)):
                progress("data", 0, 1)
                case = _cases.make(scene, n, setting.data, setting.pixels)
                _cases.save(case, folder)
                progress("data", 1, 1)
                lines = _run_sarcl.competitors(case, folder, opened, setting.methods, setting.tolerances)
                others = _others(case, folder, peer, setting) if setting.with_peers else []
                rows = measure(
                    case,
                    alternate(lines, others),
                    repeats=setting.repeats,
                    limit=setting.limit,
                    paces=paces,
                    patience=setting.patience,
                    tick=functools.partial(progress, "bench"),
                )
                result = {"scene": case.scene, "data": case.data, "n": case.n, "pairs": case.pairs}
                norm = float(np.linalg.norm(case.wanted)) / case.norm
                document["cases"].append({**result, "pixels": setting.pixels, "norm": norm, "rows": rows})
                document["machine"]["load"] = [document["machine"]["load"][0], *load()]
                keep(document)
                say("\n" + tables.text(document["cases"][-1]))
    for paragraph in filter(None, (tables.growth_text(document["cases"]), tables.EXPLAINED)):
        say("\n" + paragraph)
    return document


def _opened_peer(stack: ExitStack, python: str, backend: str) -> tuple[_peers.Peer | None, dict[str, str]]:
    """The running peer, closed with `stack`, or None where it is absent; and its entry in the document."""
    try:
        peer = stack.enter_context(_peers.Peer(python))
    except Absent as exc:
        return None, {"name": "fastsar", "absent": f"{exc}; --peer-python PATH names a Python that has it"}
    return peer, {"name": "fastsar", "version": peer.version, "python": peer.python, "backend": backend}


def _others(case: _cases.BenchCase, folder: Path, peer: _peers.Peer | None, setting: Setting) -> list[Competitor]:
    """The NumPy baseline, and the peer where there is one."""
    others, backend, methods = [], setting.peer_backend, setting.methods
    if "direct" in methods:
        others += baseline.competitors(case)
    if peer is not None:
        try:
            peer.load(folder)
            others += _peers.competitors(case, peer, methods, backend)
        except Absent as exc:
            lost = str(exc)

            def gone() -> NoReturn:
                raise Absent(lost)

            others += [Competitor(peer.name, backend, method, "any", gone) for method in methods]
    return others
