"""The avatar as a base: its motion is arithmetic, its face and voice are a page's."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable
from typing import ClassVar

from robot.bases.avatar.page_server import PageServer
from robot.bases.base import Abilities, Answer, BadOption, BaseLost, Indication
from robot.bases.kinematic import IDEAL, KinematicBase
from robot.motion.twist import Twist

DEFAULT_PORT = 8090


class AvatarBase(KinematicBase):
    """Moves a character on every page that is open at its address.

    It can touch nobody, so it arms itself, and a page that is closed or slow holds nothing up.
    """

    name: ClassVar[str] = "avatar"
    abilities = Abilities(simulated=True, moves=True, answers=True, real_time=True)

    def __init__(self, monotonic: Callable[[], float]) -> None:
        super().__init__(monotonic, IDEAL)  # a screen has no dead time
        self.host, self.page_port = "127.0.0.1", DEFAULT_PORT
        self.words = {True: "", False: ""}  # what it says, by whether it is glad
        self._pages: PageServer | None = None

    @classmethod
    def add_arguments(cls, group: ArgumentParser | _ArgumentGroup) -> None:
        """Add options for the page's address."""
        group.add_argument(
            "--avatar-host",
            default="127.0.0.1",
            help="who may open the page: 127.0.0.1 this computer, 0.0.0.0 every one in its network",
        )
        group.add_argument(
            "--avatar-port",
            type=int,
            default=DEFAULT_PORT,
            help=f"the page is http://HOST:PORT/ (default: {DEFAULT_PORT})",
        )

    def configure(self, options: Namespace) -> None:
        """Apply the page's address. Raises BadOption."""
        super().configure(options)
        if not 0 <= options.avatar_port <= 65535:
            raise BadOption("--avatar-port: a port is a number from 1 to 65535.")
        self.host, self.page_port = options.avatar_host, options.avatar_port
        self.words = {True: options.say_glad, False: options.say_sad}

    def open(self) -> None:
        """Serve the page. Raises BaseLost where its address is taken."""
        try:
            self._pages = PageServer(self.host, self.page_port)
        except OSError as problem:
            raise BaseLost(
                f"The avatar's page cannot be served at {self.host}:{self.page_port} "
                f"({problem.strerror}). Choose another --avatar-port."
            ) from None

    def close(self) -> None:
        """Close its pages."""
        if self._pages is not None:
            self._pages.close()

    @property
    def url(self) -> str:
        """Where its page is; empty while it is not open."""
        return "" if self._pages is None else self._pages.url

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity, and show where it has come to."""
        ordered = super().drive(twist)
        if self._pages is not None:
            pose = super().read().pose
            at = [round(one, 3) for one in (pose.x_m, pose.y_m, pose.heading_rad)]
            self._pages.show(pose=at)
        return ordered

    def show(self, indication: Indication, *, aloud: bool) -> None:
        """Show its state by its face and color.

        Parameters
        ----------
        indication
            The state; any but moving also ends its answer.
        aloud
            Has no effect: its voice belongs to its answers.
        """
        if self._pages is not None:
            self._pages.show(state=str(indication))
            if indication is not Indication.MOVING:
                self._pages.show(answer=None)

    def answer(self, answer: Answer) -> None:
        """Celebrate or droop by face, arms and voice."""
        if self._pages is not None:
            self._pages.say(
                {
                    "gesture": answer.gesture,
                    "glad": answer.is_glad,
                    "quiet": answer.is_quiet,
                    "strength": answer.strength,
                    "words": self.words[answer.is_glad],
                }
            )
