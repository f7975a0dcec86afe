"""The six targets of Zou et al. 2021, table 2, as closed bodies about the origin, whole or reduced."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import pi

from ...scene import shapes
from ...scene.scene import Scene

SECTIONS, FACETS = 180, 8000  # of round targets: facets stay within 2e-4 of the radius


@dataclass(frozen=True)
class Target:
    """A target of table 2: its letter in the figures, its name, the sizes printed, and what makes it in full size."""

    letter: str
    name: str
    printed: str
    make: Callable[[], Scene]

    def scene(self, reduction: float = 1) -> Scene:
        """The target with every length divided by `reduction`; the centre of its box is the origin."""
        body = self.make()
        return Scene.facets((body.triangles - body.center) / reduction, two_sided=False)


# Solids stand upright. Cuboid and tank are longest along the track: figure 8 of the paper sees a brick broadside.
TARGETS = (
    Target("a", "cuboid", "6 x 3 x 3 m", lambda: shapes.box((3, 6, 3))),
    Target("b", "cylinder", "radius 1.5 m, height 6 m", lambda: shapes.cylinder(1.5, 6, sections=SECTIONS)),
    Target("c", "sharp cone", "radius 1.5 m, height 6 m", lambda: shapes.cone(1.5, 6, sections=SECTIONS)),
    Target("d", "blunt cone", "radius 3 m, height 1.5 m", lambda: shapes.cone(3, 1.5, sections=SECTIONS)),
    Target("e", "sphere", "radius 1.5 m", lambda: shapes.sphere(1.5, facets=FACETS)),
    Target("f", "tank", "9.58 x 4.01 x 4.02 m", lambda: shapes.tank(rotation=pi / 2)),
)


def find(name: str) -> Target:
    """The target of this name."""
    return next(target for target in TARGETS if target.name == name)
