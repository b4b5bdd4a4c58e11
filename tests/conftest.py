"""What all tests share. No Django up here: the pure packages are also tested without it."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import hypothesis
import pytest

from tests.bench import mutation_probe
from tests.support import clock, matrix
from tests.support.extent import EVERYTHING, FAST

if TYPE_CHECKING:
    from tests.support.world import World

TESTS = Path(__file__).parent
DATABASE_FIXTURES = {"db", "transactional_db", "live_server"}
# What robots that tests start record stays out of this computer's own folder.
os.environ["GARRY_ROBOT_BLACK_BOX"] = "off"
MARKED_BY_FOLDER = {"bench", "screenshots"}
# What tests in a row share, by who is one of them: ended before a test that is not.
SHARED: dict[str, tuple[Callable[[pytest.Item], bool], Callable[[], None]]] = {}

# How many examples a property is tried with that does not say so itself. A busy machine is no
# fault of an example.
hypothesis.settings.register_profile("fast", max_examples=10, deadline=None)
hypothesis.settings.register_profile("quick", max_examples=25, deadline=None)
hypothesis.settings.register_profile("full", max_examples=100, deadline=None)
hypothesis.settings.load_profile("full" if EVERYTHING else "fast" if FAST else "quick")


@pytest.hookimpl(tryfirst=True)  # before -m looks at the marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what a test needs by what it uses and where it lives, so that no one forgets to."""
    chromium = shutil.which("chromium")
    for item in items:
        folder = item.path.relative_to(TESTS).parts[0]
        if folder in MARKED_BY_FOLDER:
            item.add_marker(folder)
            item.add_marker(pytest.mark.timeout(0))
        fixtures = set(getattr(item, "fixturenames", ()))
        if item.get_closest_marker("django_db") or fixtures & DATABASE_FIXTURES:
            item.add_marker("database")
        if item.get_closest_marker("browser") and not chromium and "CI" not in os.environ:
            item.add_marker(pytest.mark.skip(reason="no Chromium: apt-get install chromium"))
    matrix.mark_the_others(items)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return how many tests run at once: half as many again as there are cores, since many wait for
    a server, a browser or a child.
    """
    return max(2, (os.cpu_count() or 1) * 3 // 2)


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Look for garbage seldom, and not in what was imported and collected: it stays to the end,
    and looking took a tenth of the tests' time.
    """
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """End what the tests before have shared and this one does not, and empty the boards' cache."""
    for name, (shares, end) in list(SHARED.items()):
        if not shares(item):
            del SHARED[name]
            end()
    if (boards := sys.modules.get("rehab.boards.cache")) is not None:
        boards.clear_cache()


def pytest_unconfigure() -> None:
    """End what the last tests have shared."""
    while SHARED:
        _, (_, end) = SHARED.popitem()
        end()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Return a database test its clock, its module's fixtures too."""
    with nullcontext() if clock.has_real_clock(item) else clock.started():
        return (yield)


@pytest.fixture(scope="session", autouse=True)
def own_data_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Give each process of the tests a data folder of its own, as each server has."""
    if "django.conf" in sys.modules:
        from django.conf import settings

        settings.DATA_DIR = tmp_path_factory.mktemp("data")


@pytest.fixture(scope="session")
def django_db_modify_db_settings(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Have a test database for each run: a real SQLite file, since threads and WAL behave
    differently in memory, or a name on PostgreSQL that no run beside this one has.
    """
    from django.db import connection

    name = f"garry_test_{os.getpid()}"
    if connection.vendor == "sqlite":
        name = str(tmp_path_factory.mktemp("database") / f"{name}.sqlite3")
    connection.settings_dict["TEST"]["NAME"] = name


@pytest.fixture(scope="session")
def _is_migrated(django_db_modify_db_settings: None) -> Iterator[bool]:
    """Begin with the tables of a run before, if the code has not changed since."""
    from django.db import connection

    from tests.support import templates

    kept = templates.read(clock.NAME) if connection.vendor == "sqlite" else None

    def copy(*_: Any) -> str:
        assert kept is not None
        name: str = connection.settings_dict["TEST"]["NAME"]
        Path(name).write_bytes(kept)
        return name

    with pytest.MonkeyPatch.context() as patch:
        if kept is not None:
            patch.setattr(connection.creation, "_create_test_db", copy)
        yield kept is not None


@pytest.fixture(scope="session")
def _without_durability() -> Iterator[None]:
    """Wait for no disk and hash passwords quickly: rows of this process need not outlive a power
    cut. Servers and commands that tests start keep the product's own settings.
    """
    from django.conf import settings
    from django.test import override_settings

    options = settings.DATABASES["default"].get("OPTIONS", {})
    if "init_command" in options:
        options["init_command"] += "PRAGMA synchronous=OFF;"
    from rehab.people.sign_in.factors import recovery_codes

    quick = {"PASSWORD_HASHERS": ["django.contrib.auth.hashers.MD5PasswordHasher"]}
    with override_settings(**quick), mock.patch.object(recovery_codes, "SCRYPT_N", 2):
        yield


@pytest.fixture(scope="session")
def _logs_can_be_flushed() -> Iterator[None]:
    """Lift the triggers of append-only logs where tests empty the tables after themselves."""
    from django.db import connection

    from rehab.people.audit import append_only_triggers

    flush = connection.ops.execute_sql_flush

    def flush_all(statements: list[str]) -> None:
        with append_only_triggers.lifted(connection.alias):
            flush(statements)

    with mock.patch.object(connection.ops, "execute_sql_flush", flush_all):
        yield


@pytest.fixture(scope="session")
def django_db_setup(
    _is_migrated: bool,
    _without_durability: None,
    _logs_can_be_flushed: None,
    django_db_setup: None,
    django_db_blocker: Any,
) -> Iterator[None]:
    """Bring first rows back quickly. Hang up, before the test database goes, whatever a thread or
    a pool still holds of it: PostgreSQL drops no database that somebody is in, and autovacuum may
    be.
    """
    from django.db import connection
    from django.test import TransactionTestCase

    from tests.support import templates
    from tests.support.snapshots import Snapshot

    with pytest.MonkeyPatch.context() as patch:
        if connection.vendor == "sqlite":
            with django_db_blocker.unblock():
                first = Snapshot()
            if not _is_migrated:
                templates.keep(clock.NAME, first.file())
            patch.setattr(TransactionTestCase, "_fixture_teardown", lambda _: first.restore())
        yield
        if connection.vendor == "sqlite":
            first.close()

    # Chromium first: beside the loop of its driver Django refuses to touch a database.
    for name in ("chromium", "rows"):
        if name in SHARED:
            SHARED.pop(name)[1]()
    if connection.vendor != "postgresql":
        return
    with django_db_blocker.unblock(), connection.cursor() as cursor:
        cursor.execute(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
            "WHERE datname = current_database() AND pid <> pg_backend_pid()"
        )


@pytest.fixture(scope="session")
def _kept_rows(django_db_setup: None, django_db_blocker: Any) -> Any:
    from tests.support.kept import KeptRows

    return KeptRows(django_db_blocker.unblock)


@pytest.fixture(scope="session")
def _snapshots(django_db_setup: None) -> Iterator[Any]:
    from tests.support.snapshots import Snapshots

    snapshots = Snapshots()
    yield snapshots
    snapshots.close()


# pytest makes class fixtures anew for each test outside a class, before those of a function: so
# before pytest-django's savepoint, which must be inside the transaction of the kept rows.
@pytest.fixture(scope="class")
def keep(request: pytest.FixtureRequest, _kept_rows: Any, _snapshots: Any) -> Callable[[Any], Any]:
    """A function that stores rows once for all tests in a row that ask for the same: it takes the
    function that builds them and returns one that copies what was built.
    """
    from django.db import connection

    if mutation_probe.HITS in os.environ:  # each test comes to what builds its rows
        return lambda build: build
    mark = request.node.get_closest_marker("django_db")
    others_see_it = "transactional_db" in request.fixturenames or (
        mark and mark.kwargs.get("transaction")
    )
    real_clock = clock.has_real_clock(request.node)
    if not others_see_it and not real_clock:
        shares = lambda item: "keep" in getattr(item, "fixturenames", ())  # noqa: E731
        SHARED["rows"] = shares, _kept_rows.end
        return _kept_rows.begin  # type: ignore[no-any-return]
    _kept_rows.end()
    if real_clock or connection.vendor != "sqlite":
        return lambda build: build
    return _snapshots.begin  # type: ignore[no-any-return]


def _build_amber() -> World:
    from tests.support.world import build_world

    return build_world("amber")


@pytest.fixture(scope="class")
def _amber(keep: Callable[[Any], Any]) -> Callable[[], World]:
    made: Callable[[], World] = keep(_build_amber)
    return made


@pytest.fixture
def world(_amber: Callable[[], World], db: None) -> World:
    """A clinic, its people, and a row of every model."""
    return _amber()


@pytest.fixture
def pt(world: World) -> Any:
    """A browser in which the clinic's therapist is signed in."""
    return world.pt


@pytest.fixture
def patient(world: World) -> Any:
    """Rosa, a patient of the clinic who has not walked yet."""
    return world.add_patient(code="B-1")


@pytest.fixture(scope="session")
def shared_chromium() -> Any:
    from tests.support.browsers import SharedChromium

    return SharedChromium()


@pytest.fixture(scope="module")
def browser(shared_chromium: Any) -> Iterator[Any]:
    """Chromium: one process for all tests in a row that need it. Its driver leaves no room for an
    event loop of a test, so it ends before a test of another kind.
    """
    SHARED["chromium"] = (
        (lambda item: bool(item.get_closest_marker("browser"))),
        shared_chromium.close,
    )
    running = shared_chromium.browser()
    yield running
    for context in running.contexts:
        context.close()
