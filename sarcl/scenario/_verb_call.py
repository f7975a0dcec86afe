"""The call of a verb that a section of a scenario describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .. import verbs
from ._schema import Where


@dataclass(frozen=True)
class VerbCall:
    """A verb, the section that names it, its arguments; keys: those of the section, whose lines messages name."""

    where: Where
    section: str
    subjects: tuple[object, ...]
    options: Mapping[str, object]
    keys: Mapping[str, object]

    def run(self) -> Any:
        """The result."""
        with self.where.blame((self.section,), self.keys, always=False):
            return getattr(verbs, self.section)(*self.subjects, **self.options)

    def plan(self) -> Any:
        """The forecast of the result."""
        with self.where.blame((self.section,), self.keys, always=False):
            return verbs.plan(getattr(verbs, self.section), *self.subjects, **self.options)
