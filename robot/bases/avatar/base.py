"""The avatar as a base: its motion is arithmetic, its face and voice are a page's."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, _ArgumentGroup
from collections.abc import Callable
from typing import ClassVar

from robot.bases.avatar.face_screen import FaceScreen, read_face
from robot.bases.base import Abilities, Answer, Indication
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
        self.face = FaceScreen(monotonic, "127.0.0.1", DEFAULT_PORT, {True: "", False: ""})

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
        self.face = read_face(options, self._monotonic, "avatar")

    def open(self) -> None:
        """Serve the page. Raises BaseLost where its address is taken."""
        self.face.open()

    def close(self) -> None:
        """Close its pages."""
        self.face.close()

    @property
    def url(self) -> str:
        """Where its page is; empty while it is not open."""
        return self.face.url

    def drive(self, twist: Twist) -> Twist:
        """Order a velocity, and show where it has come to."""
        ordered = super().drive(twist)
        self.face.tick(super().read().pose)
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
        self.face.show(indication)

    def answer(self, answer: Answer) -> None:
        """Act by face, arms and voice."""
        self.face.answer(answer)
