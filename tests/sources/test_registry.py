"""Every source that is registered, and what sources must do without."""

import subprocess
import sys
from pathlib import Path

import pytest

from rehab.sources import SOURCES, SUMMARIES
from rehab.sources.source import LiveSource, PlayedSource

REPO = Path(__file__).parents[2]


@pytest.mark.parametrize("name", SOURCES)
def test_a_registered_source_is_one(name):
    assert issubclass(SOURCES[name], LiveSource | PlayedSource)
    assert SUMMARIES[name]


def test_sources_run_where_there_is_neither_django_nor_unix():
    program = (
        "import sys\n"
        "for name in ('django', 'channels', 'pty', 'fcntl', 'termios'):\n"
        "    sys.modules[name] = None\n"
        "import rehab.sources\n"
        "assert 'rows' in rehab.sources.SOURCES\n"
        "assert not {'asyncio', 'socket', 'numpy'} & set(sys.modules)\n"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", program], cwd=REPO, capture_output=True, text=True
    )

    assert run.returncode == 0, run.stderr
