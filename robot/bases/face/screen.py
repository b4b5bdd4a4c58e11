"""A face on every page that is open at its address: a character, or a screen on a base's mast."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable

from robot.bases.base import Answer, BadOption, BaseLost, Indication
from robot.bases.face.page_server import PageServer
from robot.motion.face_and_arms import REST, Script, find_act, look_at, to_message
from robot.motion.pose import Pose


class FaceScreen:
    """Acts the answers of one base by face, arms and voice. A page that is closed holds nothing up.

    Parameters
    ----------
    monotonic
        The clock [s].
    host, port
        Where its page is served.
    words
        What it says, by whether it is glad.
    """

    def __init__(
        self, monotonic: Callable[[], float], host: str, port: int, words: dict[bool, str]
    ) -> None:
        self.host, self.port, self.words = host, port, words
        self._monotonic = monotonic
        self._pages: PageServer | None = None
        self._script: Script = (REST,)
        self._began_s = 0.0

    def open(self) -> None:
        """Serve the page. Raises BaseLost where its address is taken."""
        try:
            self._pages = PageServer(self.host, self.port)
        except OSError as problem:
            raise BaseLost(
                f"The page of its face cannot be served at {self.host}:{self.port} "
                f"({problem.strerror}). Choose another --avatar-port or --face-port."
            ) from None

    def close(self) -> None:
        """Close its pages."""
        if self._pages is not None:
            self._pages.close()

    @property
    def url(self) -> str:
        """Where its page is; empty while it is not open."""
        return "" if self._pages is None else self._pages.url

    def tick(self, pose: Pose) -> None:
        """Show where the base is, and the present look of what it acts."""
        if self._pages is not None:
            look = look_at(self._script, self._monotonic() - self._began_s)
            at = [round(one, 3) for one in (pose.x_m, pose.y_m, pose.heading_rad)]
            self._pages.show(pose=at, look=to_message(look))

    def show(self, indication: Indication) -> None:
        """Show the base's state; any but moving also ends what it acts."""
        if self._pages is None:
            return
        self._pages.show(state=str(indication))
        if indication is not Indication.MOVING:
            self._script = (REST,)
            self._pages.show(answer=None, act="rest", look=to_message(REST))

    def answer(self, answer: Answer) -> None:
        """Begin to act an answer, in place of the last one."""
        if self._pages is None:
            return
        act, self._script = find_act(answer.gesture, is_glad=answer.is_glad)
        self._began_s = self._monotonic()
        words = "" if answer.is_glad is None else self.words[answer.is_glad]
        self._pages.show(act=act, look=to_message(self._script[0]))
        self._pages.say(
            {
                "gesture": answer.gesture,
                "glad": answer.is_glad,
                "quiet": answer.is_quiet,
                "strength": answer.strength,
                "words": words,
            }
        )


def read_face(options: Namespace, monotonic: Callable[[], float], name: str) -> FaceScreen:
    """Return the face of a command line's ``--NAME-host`` and ``--NAME-port``. Raises BadOption."""
    host, port = getattr(options, f"{name}_host"), getattr(options, f"{name}_port")
    if not 0 <= port <= 65535:
        raise BadOption(f"--{name}-port: a port is a number from 1 to 65535.")
    return FaceScreen(monotonic, host, port, {True: options.say_glad, False: options.say_sad})
