"""The avatar: its page in a browser is seen and heard, and may order nothing."""

import json
import time
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import pytest
from websockets.sync.client import connect

from robot.bases.avatar import AvatarBase
from robot.bases.base import Answer, BaseLost, Indication
from robot.bases.face import FaceScreen
from robot.bases.kobuki import KobukiBase
from robot.motion.face_and_arms import REST, to_message
from robot.motion.gestures import GESTURES
from robot.motion.pose import HOME
from robot.motion.twist import Twist
from robot.play_gesture import play_gesture

# Notes every tone that the page's audio graph begins: its pitch, and when, by the audio's clock.
LISTEN = """
window.heard = [];
window.said = [];
speechSynthesis.speak = (utterance) => window.said.push(utterance.text);
const { setValueAtTime } = AudioParam.prototype;
AudioParam.prototype.setValueAtTime = function (value, at) {
  if (value > 20) window.heard.push([value, at]);
  return setValueAtTime.call(this, value, at);
};
const { stop } = AudioScheduledSourceNode.prototype;
AudioScheduledSourceNode.prototype.stop = function (at) {
  if (at === undefined) window.heard.push(["silent", 0]);
  return stop.call(this, at);
};
"""


@contextmanager
def opened(monotonic=time.monotonic):
    base = AvatarBase(monotonic)
    base.face.port = 0
    with base:
        yield base


@pytest.fixture
def avatar():
    with opened() as base:
        yield base


@contextmanager
def listening(avatar):
    """Open a page's socket, and give what takes the next state."""
    with connect(avatar.url.replace("http:", "ws:") + "avatar") as socket:
        yield lambda: json.loads(socket.recv(5))


def test_a_page_gets_the_present_state_and_what_changes(avatar):
    avatar.show(Indication.READY, aloud=False)
    with listening(avatar) as take:
        still = {"act": "rest", "look": to_message(REST), "pose": [0, 0, 0]}
        assert take() == {"state": "ready", "answer": None, "answers": 0} | still
        avatar.answer(Answer("celebrate", True, False, 0.8))
        answer = {
            "gesture": "celebrate",
            "glad": True,
            "quiet": False,
            "strength": 0.8,
            "words": "",
        }
        states = [take()]
        while states[-1]["answer"] is None:
            states.append(take())
        assert (states[-1]["answer"], states[-1]["answers"]) == (answer, 1)
        assert states[-1]["act"] == "celebrating"
        assert states[-1]["look"]["mouth"] == "laugh"
        avatar.show(Indication.STOPPED, aloud=True)
        states = [take()]
        while states[-1]["answer"] is not None:
            states.append(take())
        assert states[-1]["state"] == "stopped"


def test_a_page_that_reads_nothing_holds_nothing_up(avatar):
    with listening(avatar):
        began_s = time.monotonic()
        for number in range(20_000):
            avatar.face._pages.show(pose=[number, 0, 0])
        assert time.monotonic() - began_s < 5


def test_what_a_page_says_changes_nothing(avatar):
    with connect(avatar.url.replace("http:", "ws:") + "avatar") as socket:
        socket.send('{"type": "arm"}')
        socket.send('{"state": "ready"}')
        assert json.loads(socket.recv(5))["state"] == "waiting"


def test_there_is_one_page_and_no_other_file(avatar):
    def get(path):
        address = avatar.url.removeprefix("http://").rstrip("/")
        connection = HTTPConnection(address, timeout=5)
        with closing(connection):
            connection.request("GET", path)
            answer = connection.getresponse()
            return answer.status, answer.headers["Content-Security-Policy"], answer.read()

    status, policy, text = get("/")
    assert (status, policy.split(";")[0]) == (200, "default-src 'none'")
    assert b"avatar.js" in text
    for path in ("/base.py", "/../base.py", "/page.html/.."):
        assert get(path)[0] == 404


def test_an_address_that_is_taken_is_told_with_the_cure(avatar):
    second = AvatarBase(time.monotonic)
    second.face.port = int(avatar.url.rstrip("/").rpartition(":")[2])
    with pytest.raises(BaseLost, match="Choose another --avatar-port"):
        second.__enter__()


@pytest.fixture
def page(browser, avatar):
    context = browser.new_context(viewport={"width": 800, "height": 800})
    context.add_init_script(LISTEN)
    page = context.new_page()
    page.goto(avatar.url)
    page.wait_for_selector("body[data-state=waiting]")
    page.click("#sound")
    yield page
    context.close()


def mood(page, wanted):
    page.wait_for_selector(f"body[data-mood={wanted}]", timeout=5000)


def notes(page):
    return [hz for hz, _ in page.evaluate("window.heard") if hz != "silent"]


@pytest.mark.browser
def test_it_is_seen_and_heard_to_celebrate_and_to_droop(page, avatar):
    avatar.answer(Answer("celebrate", is_glad=True))
    mood(page, "celebrate")
    page.wait_for_function("window.heard.length >= 3")
    assert page.evaluate("window.said") == []
    rising = notes(page)
    assert rising == sorted(rising)
    assert len(set(rising)) == 3
    avatar.show(Indication.READY, aloud=False)
    mood(page, "rest")
    page.evaluate("window.heard.length = 0")
    avatar.face.words[False] = "Next one."
    avatar.answer(Answer("droop", is_glad=False))
    mood(page, "droop")
    page.wait_for_function("window.said.includes('Next one.')")
    page.wait_for_function("window.heard.filter(([hz]) => hz !== 'silent').length >= 3")
    falling = notes(page)
    assert falling == sorted(falling, reverse=True)
    assert not set(falling) & set(rising)


@pytest.mark.browser
def test_it_acts_each_gesture_and_its_variants_differ(page, avatar):
    def acts(gesture, act, *, is_glad=True):
        avatar.answer(Answer(gesture, is_glad, is_quiet=True))
        page.wait_for_selector(f"body[data-act={act}]")
        return page.evaluate("[document.body.dataset.mood, document.body.style.cssText]")

    assert acts("sway", "swaying")[0] == "calm"
    assert acts("effort_2", "trying", is_glad=False)[0] == "calm"
    assert acts("joy_1", "drooping", is_glad=False)[0] == "droop"  # never glad after weak walking
    first = acts("joy_1", "celebrating")
    avatar.show(Indication.READY, aloud=False)
    mood(page, "rest")
    second = acts("joy_2", "celebrating")
    assert first[0] == second[0] == "celebrate"
    assert first[1] != second[1]
    assert acts("streak_10_3", "celebrating")[0] == "celebrate"
    assert acts("wave", "drooping", is_glad=False)[0] == "droop"  # a clinic's own


@pytest.mark.browser
def test_a_screen_on_a_mast_shows_the_head_alone_and_its_hand(browser):
    """A Kobuki's face: what it acts goes on in time, and the picture stays where it is."""
    base = KobukiBase(time.monotonic)
    base.face = FaceScreen(time.monotonic, "127.0.0.1", 0, {True: "Well done!", False: ""})
    base.face.open()
    page = browser.new_page()
    page.goto(base.face.url + "?face")
    page.wait_for_selector("body[data-view=face][data-state=waiting]")
    assert page.locator("#hand").is_hidden()
    assert page.locator("#torso").is_hidden()
    base.show(Indication.MOVING, aloud=False)
    base.answer(Answer("greeting_1", None))
    page.wait_for_selector("body[data-hand][data-act=greeting]")
    assert page.locator("#hand").is_visible()
    angle = page.evaluate("document.body.style.getPropertyValue('--hand')")
    time.sleep(0.45)
    base.face.tick(HOME)
    page.wait_for_function(
        "(was) => document.body.style.getPropertyValue('--hand') !== was", arg=angle
    )
    base.show(Indication.READY, aloud=False)
    page.wait_for_selector("body:not([data-hand])[data-act=rest]")
    base.close()
    page.close()


@pytest.mark.browser
def test_quiet_is_seen_only_and_a_stop_is_silent_at_once(page, avatar):
    avatar.answer(Answer("celebrate", is_glad=True, is_quiet=True))
    mood(page, "celebrate")
    assert notes(page) == []
    avatar.answer(Answer("celebrate", is_glad=True))
    page.wait_for_function("window.heard.length >= 3")
    avatar.show(Indication.STOPPED, aloud=True)
    page.wait_for_selector("body[data-state=stopped][data-mood=rest]")
    page.wait_for_function("window.heard.some(([hz]) => hz === 'silent')")


@pytest.mark.browser
def test_it_moves_and_a_lost_program_is_told(page, avatar, tmp_path):
    until_s = time.monotonic() + 0.5
    while time.monotonic() < until_s:
        avatar.drive(Twist(0.2, 0.5))
        time.sleep(0.02)
    moved = "document.getElementById('figure').getAttribute('transform').includes('scale(1.0')"
    page.wait_for_function(moved)
    avatar.answer(Answer("droop", is_glad=False))
    mood(page, "droop")
    avatar.__exit__(None, None, None)
    page.wait_for_selector("body[data-lost]", timeout=5000)


@pytest.mark.browser
def test_a_page_that_comes_later_does_not_replay_what_is_past(browser, avatar):
    avatar.answer(Answer("celebrate", is_glad=True))
    context = browser.new_context()
    context.add_init_script(LISTEN)
    page = context.new_page()
    page.goto(avatar.url)
    mood(page, "celebrate")
    page.click("#sound")
    assert notes(page) == []
    context.close()


@pytest.mark.realtime
def test_a_gesture_on_the_avatar(avatar):
    said = list[dict[str, Any]]()
    with listening(avatar) as take:
        played = play_gesture(GESTURES["droop"], avatar, time.monotonic, time.sleep)
        avatar.face._pages.show(state="end")
        while not said or said[-1]["state"] != "end":
            said.append(take())
    assert played["outcome"] == "done"
    assert any(one["answer"] and not one["answer"]["glad"] for one in said)
    assert len({tuple(one["pose"]) for one in said}) > 5


def test_its_page_names_no_other_host():
    folder = Path(__file__).parents[4] / "robot" / "bases" / "face"
    for name in ("page.html", "avatar.js"):
        assert "://" not in (folder / name).read_text().replace("ws://${location.host}", "")
