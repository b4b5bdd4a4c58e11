"""Tags are drawn in their size and found again; a mirrored one and night are none."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

pytest.importorskip("cv2", reason="pip install garry[tag]")

from robot.homing.detector import MODULES, find_tags, is_dark, make_detector, tag_modules
from robot.homing.sheet import RULER_MM, draw_sheet

SVG = "{http://www.w3.org/2000/svg}"


def picture_of(tag, module_px=12):
    """Return a picture of a tag on white paper."""
    paper = np.pad(np.where(tag_modules(tag), 20, 230), 3, constant_values=230)
    return np.kron(paper, np.ones((module_px, module_px))).astype(np.uint8)


@pytest.mark.parametrize("tag", [0, 7, 586])
def test_a_tag_is_found_where_it_is(tag):
    ((number, corners),) = find_tags(make_detector(), picture_of(tag))
    assert number == tag
    low, high = 3 * 12 - 0.5, (3 + MODULES) * 12 - 0.5
    assert np.allclose(corners, [(low, low), (high, low), (high, high), (low, high)], atol=0.7)


def test_a_mirrored_tag_is_none():
    detector = make_detector()
    for tag in range(0, 587, 7):
        assert find_tags(detector, np.fliplr(picture_of(tag)).copy()) == []


def test_night_and_a_cover_are_dark_and_a_dim_room_is_not():
    picture = picture_of(7).astype(float)
    assert is_dark((picture * 0.1).astype(np.uint8))
    assert is_dark(np.zeros((480, 640), np.uint8))
    assert not is_dark((picture * 0.4).astype(np.uint8))


@pytest.mark.parametrize("size_m", [0.05, 0.16, 0.3])
def test_a_sheet_has_the_tag_in_its_size_and_a_ruler(size_m):
    text = draw_sheet(7, size_m)
    svg = ET.fromstring(text)  # noqa: S314 (ours)
    width_mm, height_mm = (float(svg.get(side).removesuffix("mm")) for side in ("width", "height"))
    assert svg.get("viewBox") == f"0 0 {width_mm:g} {height_mm:g}"  # so a unit is a millimeter
    paths = [path.get("d") for path in svg.iter(f"{SVG}path")]
    starts = [tuple(map(float, xy)) for xy in re.findall(r"M([\d.]+) ([\d.]+)h", paths[0])]
    module = 1000 * size_m / MODULES
    xs, ys = zip(*starts, strict=True)
    assert max(xs) - min(xs) + module == pytest.approx(1000 * size_m, abs=0.01)
    assert max(ys) - min(ys) + module == pytest.approx(1000 * size_m, abs=0.01)
    assert min(xs) >= module  # white beside it
    assert len(starts) == tag_modules(7).sum()
    assert f"h{RULER_MM}M" in paths[1]
    assert f"{1000 * size_m:g} mm" in text


def test_the_squares_of_a_sheet_are_the_tag():
    svg = ET.fromstring(draw_sheet(33, 0.16))  # noqa: S314 (ours)
    black = next(svg.iter(f"{SVG}path")).get("d")
    page = np.full((297 * 4, 210 * 4), 255, np.uint8)
    for x, y, side in re.findall(r"M([\d.]+) ([\d.]+)h([\d.]+)v", black):
        left, top, size = (round(4 * float(one)) for one in (x, y, side))
        page[top : top + size, left : left + size] = 0
    assert [number for number, _ in find_tags(make_detector(), page)] == [33]
