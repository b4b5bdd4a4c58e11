"""How much a file from a stranger may cost: parsers of binary files may fail badly."""

from __future__ import annotations

CPU_S = 60
MEMORY_BYTES = 4 * 1024**3  # of addresses; a minute of walking takes less than half a gigabyte
FILE_BYTES = 512 * 1024**2  # of one that it writes
OPEN_FILES = 128


def limit_resources() -> None:
    """Bound what this process may use from now on; beyond, the system ends it."""
    import resource  # Windows has none; files of strangers are read by servers

    for kind, most in (
        (resource.RLIMIT_CPU, CPU_S),
        (resource.RLIMIT_AS, MEMORY_BYTES),
        (resource.RLIMIT_FSIZE, FILE_BYTES),
        (resource.RLIMIT_NOFILE, OPEN_FILES),
    ):
        _, hard = resource.getrlimit(kind)
        soft = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (soft, hard))
