"""Public parameters say what they take, their annotations resolve, and mypy reads them in a program of a user."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import json
import re
import subprocess
import sys
import textwrap
import tomllib
import typing
from importlib.resources import files
from pathlib import Path

import pytest
from house.annotations import hints_of, namespace, stub, verb_signature

import sarcl
from sarcl import motion, shapes
from sarcl.arrays import map_aperture
from sarcl.experiments.fda import case
from sarcl.imaging import choose_method, focusing_task
from sarcl.model import antenna
from sarcl.papers.farooq import range_zones
from sarcl.scattering import facets
from sarcl.scene import material
from sarcl.simulation import echo_options
from sarcl.simulation.track_options import Polarization

ROOT = Path(__file__).parents[2]
MODULES = {f"sarcl.{n}": getattr(sarcl, n) for n in sarcl.__all__ if inspect.ismodule(getattr(sarcl, n))}
MODULES["sarcl.papers.farooq.range_zones"] = range_zones
ONLY = {"sarcl.illumination": ("lit", "Illumination")}  # of a module whose other names are not for users


def public() -> dict[str, typing.Any]:
    """Functions and classes for users, by the name they are known under."""
    found = {f"sarcl.{name}": getattr(sarcl, name) for name in sarcl.__all__}
    found = {name: value for name, value in found.items() if not inspect.ismodule(value)}
    for name, module in MODULES.items():
        offered = ONLY.get(name) or getattr(module, "__all__", None)
        for each, value in list(vars(module).items()):
            if each.startswith("_") or not (inspect.isfunction(value) or inspect.isclass(value)):
                continue
            if each in offered if offered else value.__module__ == module.__name__:
                found[f"{name}.{each}"] = value
    return found


PUBLIC = public()


def checker_init(kind: type) -> ast.FunctionDef | None:
    """The __init__ that a class shows to type checkers alone: what its fields are made from."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    assert isinstance(tree, ast.ClassDef)
    for node in tree.body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            return next(f for f in node.body if isinstance(f, ast.FunctionDef) and f.name == "__init__")
    return None


def methods_of(kind: type) -> list[typing.Any]:
    """Public functions that a class defines, and its constructor unless a type checker is shown another."""
    own = [
        vars(kind).get(n) for n in vars(kind) if not n.startswith("_") or n in ("__call__", "__getitem__", "__add__")
    ]
    made = [m.__func__ if isinstance(m, (classmethod, staticmethod)) else m for m in own]
    built = dataclasses.is_dataclass(kind) or "__init__" in vars(kind)
    constructor = [kind.__init__] if built and not checker_init(kind) else []
    return constructor + [m for m in made if inspect.isfunction(m)]


def parameters(thing: typing.Any) -> dict[str, typing.Any]:
    """Types of all parameters of a function, or of a class's constructor and public methods, by name.

    Of verbs and of plan(): those that the stub shows to type checkers.
    """
    if thing.__name__ in stub()[1]:
        shown = [p for signature in stub()[1][thing.__name__] for p in signature.parameters.values()]
        return {f"{thing.__name__}({p.name})": p.annotation for p in shown}
    names, found = namespace(thing), {}
    if inspect.isclass(thing):
        init = checker_init(thing)
        given = [] if init is None else [*init.args.args[1:], *init.args.kwonlyargs]
        for one in given:
            assert one.annotation is not None
            found[f"{one.arg}"] = eval(ast.unparse(one.annotation), names)
    for call in methods_of(thing) if inspect.isclass(thing) else [thing]:
        if hasattr(call, "options"):
            found |= {f"{call.__name__}({p.name})": p.annotation for p in verb_signature(call).parameters.values()}
            continue
        hints = hints_of(call, names)
        written = inspect.signature(call, follow_wrapped=False).parameters if not hasattr(call, "__signature__") else {}
        code = call.__code__
        listed = code.co_varnames[
            : code.co_argcount + code.co_kwonlyargcount + bool(code.co_flags & 4) + bool(code.co_flags & 8)
        ]
        for name in written or listed:
            if name not in ("self", "cls"):
                found[f"{call.__name__}({name})"] = hints.get(name, inspect.Parameter.empty)
    return found


def is_vague(kind: typing.Any) -> bool:
    """True for no annotation, for Any, and for what holds Any, however deep; numpy's own types are whole."""
    if kind in (typing.Any, inspect.Parameter.empty):
        return True
    origin = typing.get_origin(kind)
    if origin is typing.Literal or str(getattr(origin or kind, "__module__", "")).startswith("numpy"):
        return False
    if typing.is_typeddict(kind):
        return any(is_vague(k) for k in hints_of(kind, namespace(kind)).values())
    inner = [a for arg in typing.get_args(kind) for a in (arg if isinstance(arg, list) else [arg])]
    return any(is_vague(a) for a in inner if a is not ...)


def test_vagueness_is_found_wherever_it_hides():
    assert all(map(is_vague, (typing.Any, dict[str, typing.Any], typing.Any | None, tuple[int, list[typing.Any]])))
    assert is_vague(typing.Callable[[typing.Any], int])
    assert not any(map(is_vague, (int, str | None, typing.Callable[..., None], typing.Literal["a", "b"])))


def test_the_names_are_those_of_the_package_and_of_the_modules_for_users():
    assert len(PUBLIC) > 90 and {"sarcl.echo", "sarcl.shapes.cone", "sarcl.illumination.lit"} <= set(PUBLIC)


@pytest.mark.parametrize("name", PUBLIC)
def test_no_public_parameter_is_untyped_or_any(name):
    vague = {parameter: kind for parameter, kind in parameters(PUBLIC[name]).items() if is_vague(kind)}
    assert not vague


NOUNS = [kind for kind in PUBLIC.values() if inspect.isclass(kind) and checker_init(kind)]


@pytest.mark.parametrize("kind", NOUNS, ids=lambda kind: kind.__name__)
def test_a_constructor_shown_to_type_checkers_is_the_real_one(kind):
    shown = checker_init(kind).args
    real = list(inspect.signature(kind).parameters.values())
    assert [a.arg for a in [*shown.args[1:], *shown.kwonlyargs]] == [p.name for p in real]
    assert {a.arg for a in shown.kwonlyargs} == {p.name for p in real if p.kind is p.KEYWORD_ONLY}
    optional = [a.arg for a in shown.args[len(shown.args) - len(shown.defaults) :]] if shown.defaults else []
    optional += [a.arg for a, default in zip(shown.kwonlyargs, shown.kw_defaults, strict=True) if default]
    assert optional == [p.name for p in real if p.default is not p.empty]


def test_options_of_map_aperture_are_those_that_are_handed_to_it():
    options, verb = map_aperture.MapApertureOptions, sarcl.map_aperture
    names = namespace(options)
    assert hints_of(options, names) == {n: k for n, k in hints_of(verb, names).items() if n not in ("raw", "return")}


@pytest.mark.parametrize("shape", shapes.SHAPES, ids=lambda shape: shape.__name__)
def test_options_of_a_shape_are_those_that_it_spells_out(shape):
    hints = hints_of(shape, namespace(shape))
    (options,) = typing.get_args(hints["options"])
    own = set(hints) - {"options", "return"}
    assert set(inspect.signature(shape).parameters) == own | set(
        typing.get_type_hints(options, namespace(shape), namespace(shape))
    )


@pytest.mark.parametrize(
    ("literal", "words"),
    [
        (echo_options.Skip, echo_options.SKIPS),
        (Polarization, facets.POLARIZATIONS),
        (focusing_task.Skip, focusing_task.SKIPS),
        (antenna.Kind, antenna.KINDS),
        (material.Diagram, material.DIAGRAMS),
        (map_aperture.MapKind, map_aperture.MAPPINGS),
        ((sarcl.echo, "channels"), echo_options.CHANNELS),
        ((sarcl.echo, "receive"), echo_options.RECEIVE),
        ((sarcl.map_aperture, "offset"), map_aperture.OFFSETS),
        ((sarcl.backproject, "method"), choose_method.METHODS),
        ((motion.perturbed, "frame"), motion.FRAMES),
        ((motion.sinusoidal, "frame"), motion.FRAMES),
        ((case.Case, "progression"), case.PROGRESSIONS),
        ((case.Case, "path"), case.PATHS),
        ((case.Case, "receive"), echo_options.RECEIVE),
    ],
)
def test_words_of_a_literal_are_those_that_are_accepted(literal, words):
    if isinstance(literal, tuple):
        thing, name = literal
        shown = stub()[1].get(thing.__name__)
        literal = shown[0].parameters[name].annotation if shown else hints_of(thing, namespace(thing))[name]
    assert typing.get_args(literal) == words


def test_the_marker_and_the_shared_types_come_with_the_package():
    assert files("sarcl").joinpath("py.typed").is_file()
    packed = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["sarcl"]
    assert set(packed) == {"__init__.pyi", "py.typed"}
    light = "import sarcl.base.types, sys; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", light], capture_output=True, text=True).stdout == "False\n"


MISTAKES = """
sarcl.echo(scene, chirp, track, polarization="HX")  # No overload variant of "echo"
sarcl.echo(scene, chirp, track, skip={"beams"})  # No overload variant of "echo"
sarcl.backproject(raw, grid, windo="hamming")  # Unexpected keyword argument "windo"
sarcl.backproject(raw, grid, window="haming")  # Argument "window" to "backproject"
sarcl.backproject(raw, grid, out=3)  # No overload variant of "backproject"
sarcl.Trajectory.line(start=None, velocity=(0, 1, 0), prf=1.0, n_pulses=2)  # Argument "start"
sarcl.PhaseHistory(object(), frequency=1e9, frequency_step=1e6, tx=[(0, 0, 0)], reference_range=1.0)  # Argument 1
sarcl.PhaseHistory([[1j]], frequency=object(), frequency_step=1e6, tx=[(0, 0, 0)], reference_range=1.0)  # "frequency"
sarcl.Scene.points([(0, 0, 0)], amplitude=1.0)  # Unexpected keyword argument "amplitude"
sarcl.shapes.box((1, 1, 1), rough=0.1)  # Unexpected keyword argument "rough"
sarcl.echo(scene, chirp, [track], receiver=track)  # No overload variant of "echo"
sarcl.echo(scene, chirp, track, tolerence=1e-3)  # No overload variant of "echo"
sarcl.plan(sarcl.echo, scene, chirp, track, tolerence=1e-3)  # incompatible type overloaded function
sarcl.plan(sarcl.echo, scene, chirp, track, tolerance="fine")  # incompatible type overloaded function
sarcl.plan(sarcl.echo, scene, chirp)  # No overload variant of "plan"
sarcl.plan(sarcl.backproject, raw, grid, windo="hamming")  # incompatible type overloaded function
sarcl.plan(raw, grid, windo="hamming")  # No overload variant of "plan"
sarcl.plan(sarcl.compress, 3)  # No overload variant of "plan"
sarcl.plan(raw, grid).runs  # has no attribute "runs"
sarcl.Antenna(kind="dish")  # Literal['dish']
image.save(5)  # Argument 1 to "save"
image.grid.shapes  # has no attribute "shapes"
"""


GOOD = '''
class Rows:
    """Samples that are read as they are needed."""

    shape, dtype = (2, 4), np.dtype(np.complex64)

    def __getitem__(self, rows: slice) -> np.ndarray:
        return np.ones((2, 4), self.dtype)[rows]


lazy = sarcl.PhaseHistory(
    Rows(), frequency=[9e9, 9e9], frequency_step=1e6, tx=np.zeros((2, 3)), reference_range=(7e3, 7e3), polarization="HH"
)
bandwidth: float = float((lazy.frequency + lazy.n_samples * lazy.frequency_step).max())
sarcl.echo(scene, chirp, track, polarization=["HH", "HV"], skip={"range window"}, shadows=False, device=0)
sarcl.backproject(raw, grid, beam=(0.1, (1, 0, 0)), device=["cpu", 1], mapping={"mapping": "apparent"})
sarcl.backproject(raw, grid, out=Path("a.h5"), tile=(1, 4))
sarcl.backproject(raw, grid, out=np.empty(grid.shape, np.complex64), skip=False).save("a.png")
sarcl.Trajectory([0, 1], [(0, 0, 1), (0, 1, 1)]).picked(slice(1))
sarcl.Scene.from_mesh("tank.stl", material={"hull": "metal", "*": 0.5}, rotation=0.3)
sarcl.shapes.cone(3, 5, roughness=0.01, position=(0, 0, 1)).on(scene, 10, 0)
sarcl.Scenario(waveform=chirp, scene=scene, grid={"plane": {"shape": [64, 64], "spacing": 0.1}}, folder=Path("."))
'''


REVEALED = """
reveal_type(sarcl.echo(scene, chirp, track, tolerance=1e-3))  # PhaseHistory
reveal_type(sarcl.plan(sarcl.echo, scene, chirp, track, tolerance=1e-3))  # Forecast[PhaseHistory]
reveal_type(sarcl.echo(scene, chirp, [track, track], receiver=[track, track]))  # list[PhaseHistory]
reveal_type(sarcl.plan(sarcl.echo, scene, chirp, [track, track], tolerance=1e-3))  # Forecast[list[PhaseHistory]]
reveal_type(sarcl.plan(sarcl.fullwave_echo, scene, waveform=chirp, track=track))  # Forecast[PhaseHistory]
reveal_type(sarcl.plan(sarcl.backproject, raw, grid, tolerance=1e-3))  # Forecast[Image]
reveal_type(sarcl.plan(sarcl.range_doppler, raw, side="left").run())  # Image
reveal_type(sarcl.plan(raw, grid, window="hamming"))  # Forecast[Image]
reveal_type(sarcl.plan(raw, grid).run())  # Image
reveal_type(sarcl.backproject(raw, grid))  # Image
reveal_type(sarcl.backproject(raw, grid, out="a.h5", tile=(1, 2)))  # Image | None
reveal_type(sarcl.plan(sarcl.backproject, raw, grid, out="a.h5", tile=(1, 2)).run())  # Image | None
"""


@dataclasses.dataclass
class Said:
    """What a type checker says of the README's first example, of more that is right, and of a program of mistakes.

    right  number of the program's lines that are right
    """

    right: int
    errors: list[tuple[int, str]]
    types: dict[int, str]
    out: str

    def check_types(self) -> None:
        first = self.right - len(REVEALED.splitlines()) + 1
        wanted = {n: line.rpartition("# ")[2] for n, line in enumerate(REVEALED.splitlines(), first) if line}
        assert self.types == wanted, self.out

    def check_mistakes(self, words: bool) -> None:
        for number, line in enumerate(MISTAKES.splitlines(), self.right + 1):
            word = line.rpartition("# ")[2] if words else ""
            assert not line or any(at == number and word in text for at, text in self.errors), f"{line}\n{self.out}"


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The program, and the number of its lines that are right."""
    example = re.search(r"```python\n(import numpy.*?)```", (ROOT / "README.md").read_text(), re.S)[1]
    right = "from pathlib import Path\n" + example + GOOD + REVEALED
    path = tmp_path_factory.mktemp("user") / "program.py"
    path.write_text(right + MISTAKES)
    return path, len(right.splitlines())


@pytest.fixture(scope="module")
def mypy(program):
    api = pytest.importorskip("mypy.api", reason="mypy is not installed: pip install 'sarcl[dev]'")
    path, right = program
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)  # the cache of `mypy` in the repository serves here too
        out, error, _ = api.run(["--config-file", "pyproject.toml", str(path)])
    assert not error, error
    errors = [(int(at), text) for at, text in re.findall(r"program\.py:(\d+): error: (.*)", out)]
    types = re.findall(r'program\.py:(\d+): note: Revealed type is "(.*)"', out)
    return Said(right, errors, {int(at): re.sub(r"\w+\.", "", text) for at, text in types}, out)


@pytest.fixture(scope="module")
def pyright(program):
    """As an editor has it."""
    pytest.importorskip("basedpyright", reason="basedpyright is not installed: pip install 'sarcl[dev]'")
    path, right = program
    settings = {"typeCheckingMode": "standard", "include": [path.name], "extraPaths": [str(ROOT)]}
    path.with_name("pyrightconfig.json").write_text(json.dumps(settings))
    command = [sys.executable, "-m", "basedpyright", "--outputjson", "--pythonpath", sys.executable]
    done = subprocess.run([*command, "--project", str(path.parent)], capture_output=True, text=True)
    lines = [(d["range"]["start"]["line"] + 1, d) for d in json.loads(done.stdout)["generalDiagnostics"]]
    errors = [(at, d["message"]) for at, d in lines if d["severity"] == "error"]
    types = {at: d["message"].split('"')[-2] for at, d in lines if d["severity"] == "information"}
    return Said(right, errors, types, done.stdout)


@pytest.fixture(params=["mypy", "pyright"])
def said(request):
    return request.getfixturevalue(request.param)


@pytest.mark.slow
def test_a_program_of_a_user_is_accepted(said):
    assert not [text for line, text in said.errors if line <= said.right], said.out


@pytest.mark.slow
def test_types_of_results_follow_from_the_verb(said):
    said.check_types()


@pytest.mark.slow
def test_mistakes_of_a_user_are_reported(said, request):
    said.check_mistakes(words="mypy" in request.node.name)


@pytest.mark.slow
def test_mypy_accepts_what_the_stub_stands_for():
    """Where mypy finds a stub it reads no further: of all other files it checks the code itself."""
    api = pytest.importorskip("mypy.api", reason="mypy is not installed: pip install 'sarcl[dev]'")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        out, error, status = api.run(["--config-file", "pyproject.toml", "sarcl/verbs/__init__.py"])
    assert status == 0, out + error
