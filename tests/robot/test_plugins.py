"""Parts of other packages: found by their metadata, checked, and left out where they are broken."""

from __future__ import annotations

import sys

import pytest

from robot.bases import BASES, MobileBase
from robot.bases.null import NullBase
from robot.doctor import list_plugins
from robot.plugins import Registry, check_class

PARTS = """
from robot.bases.null import NullBase
class Wagon(NullBase):
    name = "wagon"
class Kobuki(NullBase):
    name = "kobuki"
class Lost:
    name = "lost"
"""
NAMES = """[garry.bases]
absent = no_such_module:Base
kobuki = wagon_parts:Kobuki
lost = wagon_parts:Lost
other = wagon_parts:Wagon
wagon = wagon_parts:Wagon
"""


@pytest.fixture
def bases(tmp_path, monkeypatch):
    """Install a package with one good base and four that cannot be used."""
    about = tmp_path / "garry_wagon-1.2.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Name: garry-wagon\nVersion: 1.2\nSummary: a wagon\n")
    (about / "entry_points.txt").write_text(NAMES)
    (tmp_path / "wagon_parts.py").write_text(PARTS)
    monkeypatch.syspath_prepend(tmp_path)
    yield Registry("garry.bases", {"null": NullBase, "kobuki": NullBase}, check_class(MobileBase))
    sys.modules.pop("wagon_parts", None)


def test_a_part_of_another_package_stands_beside_our_own(bases):
    assert list(bases) == ["null", "kobuki", "wagon"]
    assert bases["wagon"].name == "wagon"
    assert "absent" not in bases
    assert bases.find_plugin("wagon").describe() == {
        "kind": "garry.bases",
        "name": "wagon",
        "package": "garry-wagon",
        "version": "1.2",
    }
    assert bases.find_plugin("null") is None


def test_what_cannot_be_used_says_why_and_takes_no_name_of_ours(bases):
    problems = {plugin.name: plugin.problem for plugin in bases.plugins}
    assert problems["wagon"] == ""
    assert "No module named 'no_such_module'" in problems["absent"]
    assert "taken" in problems["kobuki"]
    assert "no MobileBase" in problems["lost"]
    assert "calls itself wagon" in problems["other"]
    assert bases["kobuki"] is NullBase
    with pytest.raises(KeyError):
        bases["lost"]


def test_the_robots_doctor_names_them(bases, monkeypatch):
    monkeypatch.setattr("robot.doctor.BASES", bases)
    found = {one.what.split()[0]: one.cure for one in list_plugins()}
    assert found["wagon"] == ""
    assert found["absent"] == "pip install --upgrade garry-wagon"


def test_our_own_are_no_plug_ins():
    assert [BASES.find_plugin(name) for name in BASES] == [None] * len(BASES)
