"""`python -m robot tag`: prints a tag, says what is seen, and learns home."""

import math
import threading
from dataclasses import replace

import pytest

pytest.importorskip("cv2", reason="pip install garry[tag]")

from robot.bases import BASES
from robot.calibration import store_home_view
from robot.doctor import try_cameras
from robot.homing.home_view import Carried
from robot.homing.sighting import Sighting
from robot.motion.pose import HOME
from robot.tag import NotLearned, describe, fit_field_deg, learn, main, make_parser
from tests.support.tag_pictures import picture_of, show
from tests.support.tag_room import LENS, SIZE_M, HomingStage, TagRoom, thing

LEARN = ["learn", "--base", "kobuki", "--field-deg", "62", "--ahead-mm", "100"]


def teach(stage, *more):
    """Return what is learned on a stage, whose clock goes on meanwhile."""

    def sleep(span_s):
        stage.now_s += span_s

    options = make_parser().parse_args([*LEARN, *more])
    return learn(stage.eye, options, lambda: stage.now_s, sleep)


def sighting_of(room, pose=HOME):
    corners = tuple(map(tuple, room.corners(pose).tolist()))
    return Sighting(10.0, ((7, corners),), (LENS.width_px, LENS.height_px))


def test_what_is_learned_is_how_home_is_seen():
    stage = HomingStage(HOME)
    view, true = teach(stage), stage.room.view()
    assert view.lens == true.lens
    assert view.mount == true.mount
    assert math.dist(view.place_m, true.place_m) < 0.01
    assert math.dist(view.turn_rad, true.turn_rad) < 0.02


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"problem": "camera_dark"}, "cover"),
        ({"problem": "no_camera"}, "does not open"),
        ({"is_silent": True}, "Unplug"),
        ({"every_s": 0.36}, "too few frames"),
        ({"see": lambda _pose: []}, "not in view"),
    ],
)
def test_what_cannot_be_learned_is_said_with_the_cure(fault, said):
    stage = HomingStage(HOME)
    for name, value in fault.items():
        setattr(stage.eye, name, value)
    with pytest.raises(NotLearned, match=said):
        teach(stage)


def test_another_tag_is_named():
    stage = HomingStage(HOME)
    with pytest.raises(NotLearned, match="In view: 7"):
        teach(stage, "--id", "12")


def test_a_tag_that_is_seen_from_the_front_is_not_learned():
    room = TagRoom(fixed=thing(1.3, 0.0, 0.25, 178.0, Carried.CAMERA))
    with pytest.raises(NotLearned, match="turn it 30° to 45°"):
        teach(HomingStage(HOME, room=room))


def test_what_the_camera_sees_is_told():
    room = TagRoom()
    (line,) = describe(sighting_of(room), 10.07, SIZE_M, 62.0)
    assert "tag 7: 0.886 m, -16.4° to the right" in line
    assert "turned 29° from the line of sight" in line
    assert "70 ms old" in line
    (line,) = describe(Sighting(10.0, (), (640, 480)), 10.1, SIZE_M, 62.0)
    assert line.startswith("no tag")
    (line,) = describe(Sighting(10.0, problem="camera_dark"), 10.1, SIZE_M, 62.0)
    assert "cover" in line


def test_a_ruler_says_how_wide_the_view_is():
    room = TagRoom(fixed=thing(1.1, 0.0, 0.25, 178.0, Carried.CAMERA))
    seen = sighting_of(room)
    assert fit_field_deg(seen, SIZE_M, 50.0, 1.0) == pytest.approx(62.0, abs=0.5)


def test_a_sheet_is_written(tmp_path, capsys):
    file = tmp_path / "tag.svg"
    assert main(["sheet", str(file), "--id", "3", "--size-mm", "120"]) == 0
    assert "120 mm" in file.read_text()
    assert "measure" in capsys.readouterr().out


@pytest.mark.parametrize("bad", [["--id", "600"], ["--size-mm", "5"]])
def test_a_tag_that_there_is_not_is_refused(tmp_path, capsys, bad):
    assert main(["sheet", str(tmp_path / "tag.svg"), *bad]) == 2
    assert "tag" in capsys.readouterr().err


def test_without_opencv_it_says_the_cure(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("robot.tag.find_spec", lambda _name: None)
    with pytest.raises(SystemExit):
        main(["sheet", str(tmp_path / "tag.svg")])
    assert "garry[tag]" in capsys.readouterr().err


@pytest.mark.server
def test_the_doctor_tries_the_camera_by_which_home_is_found(tmp_path):
    picture = tmp_path / "seen.png"
    base, view = (
        BASES["kinematic"](lambda: 0.0),
        replace(TagRoom().view(), camera=f"file:{picture}"),
    )
    assert list(try_cameras()) == []
    store_home_view(base, view)
    stop = threading.Event()

    def film():
        while not stop.wait(0.05):
            show(picture, picture_of(view.tag))

    thread = threading.Thread(target=film)
    thread.start()
    try:
        (seen,) = try_cameras()
    finally:
        stop.set()
        thread.join()
    assert f"tags: {view.tag}" in seen.what
    assert seen.cure == ""
    store_home_view(base, replace(view, camera=str(tmp_path / "none.mp4")))
    (missing,) = try_cameras()
    assert "does not open" in missing.cure
