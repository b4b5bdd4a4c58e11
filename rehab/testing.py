"""What sources, measures and readers promise, as tests of each installed plug-in.

`pytest --garry` runs them. A source that needs options is tried by a subclass of
``SourceContract`` in a test of your own, with your ``arguments``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar

import pytest

from rehab.gait.recordings.readers import READERS
from rehab.sources import SOURCES
from rehab.sources.arguments import make_parser
from rehab.sources.client import Display, write_step
from rehab.sources.source import PlayedSource, Source
from rehab.training.measures import MEASURES
from rehab.training.phases import make_phase
from rehab.training.steps import Measurement, Side

PLUGINS = [*SOURCES.plugins, *MEASURES.plugins, *READERS.plugins]
STRIDES = 20


def names_of(registry: Any) -> list[str]:
    """Return the names of the plug-ins of a registry that can be used."""
    return [plugin.name for plugin in registry.plugins if not plugin.problem]


class SourceContract:
    """What holds for every source. Subclasses have a fixture ``name``."""

    arguments: ClassVar[Sequence[str]] = ()

    @pytest.fixture
    def source(self, name: str) -> Source:
        """Return the source as its command line makes it; skip one that needs options."""
        parser = make_parser(name, SOURCES[name])
        parser.error = pytest.skip  # type: ignore[assignment]
        options = parser.parse_args([*self.arguments, "--token", "t"])
        return SOURCES[name](options, lambda _text: None)

    def test_it_explains_its_options(self, name: str) -> None:
        assert "--token" in make_parser(name, SOURCES[name]).format_help()

    def test_its_strides_are_numbered_timed_and_fit_the_protocol(self, source: Source) -> None:
        if not isinstance(source, PlayedSource):
            pytest.skip("its strides come in real time")
        next_stride = source.open_walk(Side.RIGHT)
        display = Display(make_phase("training", seconds=120), 3.9, "positive")
        walked = [next_stride(display) for _ in range(STRIDES)]
        strides = [one for one in walked if isinstance(one, Measurement)]
        assert strides
        assert walked[len(strides) :] == [None] * (STRIDES - len(strides))  # an end is an end
        assert [one.number for one in strides] == list(range(1, len(strides) + 1))
        assert all(a.time_s <= b.time_s for a, b in pairwise(strides))
        for stride in strides:
            assert stride.value is None or math.isfinite(stride.value)
            assert write_step(stride, stride.number)  # raises for what the server would refuse


class TestPluginSources(SourceContract):
    """Each source of an installed package."""

    @pytest.fixture(params=names_of(SOURCES))
    def name(self, request: pytest.FixtureRequest) -> str:
        """Return its name."""
        return str(request.param)


@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.name)
def test_a_plug_in_can_be_used(plugin: Any) -> None:
    assert plugin.problem == ""


@pytest.mark.parametrize("name", names_of(MEASURES))
def test_a_measure_offers_a_goal_that_it_takes(name: str) -> None:
    measure = MEASURES[name]
    assert measure.check_goal(measure.offered_goal) == measure.offered_goal
    assert len(measure.slug) <= 32
    assert len(measure.name) <= 64
    assert len(measure.unit) <= 16
