"""The lines that start sensors' programs, as the page of a new token shows them."""

import shlex

import pytest
from django.utils.html import strip_tags

from rehab.sources import SOURCES
from rehab.sources.arguments import make_parser
from rehab.stations.sensor_programs import PROGRAMS

SERVER = "http://192.168.7.2:8000"


def parse(command):
    python, flag, module, name, *options = shlex.split(command)
    assert (python, flag, module) == ("python", "-m", "rehab.sources")
    return name, make_parser(name, SOURCES[name]).parse_args(options)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda one: one.source.split()[0])
def test_each_line_is_one_that_its_program_takes(program):
    _name, options = parse(strip_tags(program.command(SERVER, "abc")))
    assert (options.server, options.token, options.stay) == (SERVER, "abc", True)


def test_each_source_but_recordings_has_its_line():
    """A recording is played from its own page."""
    assert {one.source.split()[0] for one in PROGRAMS} == SOURCES.keys() - {"recording"}
