"""The call of a verb that a section of a scenario describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .. import verbs
from ..base.forecast import Forecast
from ..blocks.block_options import BlockOptions
from ._schema import Where


def in_blocks(section: str) -> bool:
    """Whether the verb of a section computes its result in blocks: on several devices, in pieces."""
    return issubclass(getattr(verbs, section).options, BlockOptions)


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

    def plan(self) -> Forecast[Any]:
        """Of the result."""
        with self.where.blame((self.section,), self.keys, always=False):
            forecast: Forecast[Any] = verbs.plan(getattr(verbs, self.section), *self.subjects, **self.options)
        return forecast
