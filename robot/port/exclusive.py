"""Has an open serial port for us alone, also against programs that lock it in another way.

For POSIX: its modules are imported when needed, since Windows lacks them (and needs none of this).
pyserial's own lock is ``flock``; kobuki_node takes one by ``fcntl``, and neither sees the other
(docs/reference/kobuki.md#serial-link). ``TIOCEXCL`` keeps everybody else from opening it at all.
"""

from __future__ import annotations

import os

PTYS = ("/dev/pts/", "/dev/ttys")


def claim(port: int) -> None:
    """Lock an open port, given its file descriptor. Raises OSError where another program has it.

    A pty, the port of a twin, is left without ``TIOCEXCL``: it would keep that after we are killed,
    because the twin has it open too, and nobody could ever open it again.
    """
    import fcntl

    try:
        fcntl.lockf(port, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as problem:
        raise OSError(
            problem.errno, "another program has locked the port (kobuki_node?). Stop that one"
        ) from None
    if not os.ttyname(port).startswith(PTYS):
        refuse_others(port)


def refuse_others(port: int) -> None:
    """Let no other program open a port while we have it; a superuser's still may."""
    import fcntl
    import termios

    fcntl.ioctl(port, termios.TIOCEXCL)
