"""What so many clinics need, on paper: `python deploy/capacity.py` prints the tables.

They stand in docs/capacity.md. Nothing here was run at that size. What a step costs is read from
docs/performance.md, where it was measured; how clinics walk and what machines cost are assumptions,
and stand in ``Assumed``.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SIZES = (10, 100, 1000, 10_000)  # clinics
GB = 1e9
STEPS_S = 2  # of each session in the measured runs


@dataclass(frozen=True)
class Measured:
    """What a step costs, as docs/performance.md and docs/hosting.md have it.

    Attributes
    ----------
    planned_sessions
        How many sessions at once docs/hosting.md plans for a process.
    server_us, process_cores
        Processor time of a hosted process: of each step, with tablet, monitor and robot [µs], and
        of itself [cores], from the two runs that share steps among two and ten.
    beat_ms, thorough_ms
        Processor time of the database for each look of one server after what dead ones left: every
        second, and twice a minute for owners without a lease, with 10,000 clinics.
    row_us
        From a batch to the commit, by COPY [µs a row], in one connection.
    row_bytes, index_bytes, parquet_bytes
        Of a step in PostgreSQL, in its indexes, and archived.
    sent_bytes
        Of a step as text, to tablet, monitor and robot together.
    """

    planned_sessions: float
    server_us: float
    process_cores: float
    beat_ms: float
    thorough_ms: float
    row_us: float
    row_bytes: float
    index_bytes: float
    parquet_bytes: float
    sent_bytes: float

    @classmethod
    def read(cls, performance: str, hosting: str) -> Measured:
        """Return the figures in the texts of the two pages. Raises ValueError."""

        def find(pattern: str, text: str = performance) -> tuple[float, ...]:
            match = re.search(pattern, " ".join(text.split()))
            if match is None:
                raise ValueError(f"The documentation has no figure like {pattern!r}.")
            return tuple(float(figure.replace(",", "")) for figure in match.groups())

        (planned,) = find(r"Plan (\d+) sessions at once", hosting)
        many, of_two = find(r"\| ([\d,]+) \| two processes \|[^|]*\| ([\d,]+) \|")
        few, of_ten = find(r"\| ([\d,]+) \| ten processes \|[^|]*\| ([\d,]+) \|")
        own_us = (of_ten - of_two) / (10 / few - 2 / many)  # for each session's steps: both share
        beat, thorough = find(r"takes ([\d.]+) ms each second, thoroughly .*? ([\d.]+) ms twice")
        (row,) = find(r"50 rows by COPY .*? \((\d+) of wall time\)")
        sizes = r"a row of (\d+) bytes and (\d+) of two indexes, as Parquet \(zstd\) (\d+)"
        row_bytes, index_bytes, parquet_bytes = find(sizes)
        to = {whom: find(rf"to the {whom} (\d+)")[0] for whom in ("tablet", "monitor", "robot")}
        return cls(
            planned_sessions=planned,
            server_us=of_two - own_us * 2 / many,
            process_cores=own_us * STEPS_S / 1e6,
            beat_ms=beat,
            thorough_ms=thorough,
            row_us=row,
            row_bytes=row_bytes,
            index_bytes=index_bytes,
            parquet_bytes=parquet_bytes,
            sent_bytes=sum(to.values()),
        )


@dataclass(frozen=True)
class Assumed:
    """How a clinic walks, and what machines are used and cost: no measurement of ours."""

    stations: float = 2
    sessions_a_day: float = 10
    days_a_month: float = 21
    walking_s: float = 1800  # of a session, its pauses left out
    step_every_s: float = 1.05  # of the trained leg (tests/sources: the walkers' cadence)
    day_s: float = 8 * 3600
    peak: float = 2.0  # the busiest hour of all clinics together, over the mean of the day
    busy: float = 0.5  # of a core that a process may use, so that its 99 % stays low
    other: float = 2.0  # of a database's bytes and work: events, boards, audit, free space
    online_months: float = 12  # that steps stay in the database before they are archived
    database_rows_at_once: float = 0.25  # of the time a connection's batch takes, one core's
    connections_a_process: float = 10  # 8 of its pool, the writer's and the lease's
    connections: float = 97  # PostgreSQL's default of 100 without those of the superuser
    memory_gb: float = 64  # of the database's machine: indexes and the newest month fit, or not
    one_disk_gb: float = 4000
    restore_mb_s: float = 100  # at which a database is copied back
    restore_h: float = 4  # that a clinic may be without its database at worst
    sockets_a_session: float = 4  # source, tablet, monitor, robot
    sockets_a_host: float = 28_000  # to one address of a server, by the proxy's local ports
    proxy_connections: float = 20_000  # of clients: maxconn of haproxy.cfg
    core_month: float = 15.0  # euros: a core with 4 GB
    disk_gb_month: float = 0.12
    copies: float = 3  # of the database: primary, replica, backups
    archive_gb_month: float = 0.02
    egress_gb: float = 0.05


@dataclass(frozen=True)
class Need:
    """What so many clinics need."""

    clinics: float
    sessions: float  # at once, at the peak
    steps_s: float  # at the peak
    processes: float
    database_cores: float
    rows_month: float
    online_gb: float
    index_gb: float
    archive_gb_year: float
    egress_gb_month: float
    cost_month: float  # euros, all clinics

    @property
    def cost_a_clinic(self) -> float:
        """Euros a clinic and month."""
        return self.cost_month / self.clinics


def need(clinics: float, measured: Measured, assumed: Assumed = Assumed()) -> Need:
    """Return what so many clinics need, by the same figures for each."""
    a = assumed
    walked_s = clinics * a.sessions_a_day * a.walking_s  # a day
    sessions = a.peak * walked_s / a.day_s
    steps_s = sessions / a.step_every_s
    rows_month = walked_s * a.days_a_month / a.step_every_s
    work = steps_s * measured.server_us / 1e6 / (a.busy - measured.process_cores)
    processes = max(2.0, math.ceil(work), math.ceil(sessions / measured.planned_sessions))
    row_s = measured.row_us / 1e6 * a.database_rows_at_once * a.other
    beats = beat_cores(processes, clinics, measured)
    database_cores = max(2.0, math.ceil((steps_s * row_s + beats) / a.busy))
    online = rows_month * a.online_months
    index_gb = online * measured.index_bytes / GB
    online_gb = online * (measured.row_bytes + measured.index_bytes) * a.other / GB
    archive_gb = 12 * rows_month * measured.parquet_bytes / GB
    egress_gb = rows_month * measured.sent_bytes / GB
    cores = processes + (a.copies - 1) * database_cores + 2  # HAProxy
    cost = (
        cores * a.core_month
        + online_gb * a.copies * a.disk_gb_month
        + archive_gb * a.archive_gb_month
        + egress_gb * a.egress_gb
    )
    return Need(
        clinics,
        sessions,
        steps_s,
        processes,
        database_cores,
        rows_month,
        online_gb,
        index_gb,
        archive_gb,
        egress_gb,
        cost,
    )


def beat_cores(processes: float, clinics: float, measured: Measured) -> float:
    """Return the cores of the database that all servers take to look after each other."""
    thorough_ms = measured.thorough_ms * clinics / 10_000 * 2 / 60
    return processes * (measured.beat_ms + thorough_ms) / 1000


# What breaks, and by how much of it so many clinics use: 1 is its end.
Limit = tuple[str, str, Callable[[Need, Measured, Assumed], float]]
LIMITS: tuple[Limit, ...] = (
    (
        "two server processes",
        "more processes and hosts",
        lambda n, m, a: n.sessions / m.planned_sessions / 2,
    ),
    (
        "a restore within four hours",
        "archive, or shard",
        lambda n, m, a: n.online_gb * 1000 / a.restore_mb_s / 3600 / a.restore_h,
    ),
    (
        "half of the database's memory, by the steps' indexes",
        "partition: only the newest index is written",
        lambda n, m, a: n.index_gb / (a.memory_gb / 2),
    ),
    (
        "connections to one database",
        "max_connections 500, then PgBouncer for pages",
        lambda n, m, a: n.processes * a.connections_a_process / a.connections,
    ),
    (
        "one disk",
        "archive, or shard",
        lambda n, m, a: n.online_gb / a.one_disk_gb,
    ),
    (
        "connections of one HAProxy (maxconn 20,000)",
        "raise it, and open files",
        lambda n, m, a: n.sessions * a.sockets_a_session / a.proxy_connections,
    ),
    (
        "sockets from one HAProxy to a server",
        "more addresses",
        lambda n, m, a: n.sessions * a.sockets_a_session / n.processes / a.sockets_a_host,
    ),
    (
        "commits of one server's writer",
        "more processes",
        lambda n, m, a: n.steps_s / n.processes * m.row_us / 1e6,
    ),
    (
        "cores of one database's machine (32)",
        "shard by clinic",
        lambda n, m, a: (
            (
                n.steps_s * m.row_us / 1e6 * a.database_rows_at_once * a.other
                + beat_cores(n.processes, n.clinics, m)
            )
            / (32 * a.busy)
        ),
    ),
)
ENDLESS = 1_000_000  # clinics


def breaks_at(limit: Limit, measured: Measured, assumed: Assumed = Assumed()) -> int | None:
    """Return the first number of clinics at which a limit is passed; None for none at all."""
    _, _, share = limit

    def is_over(clinics: int) -> bool:
        return share(need(clinics, measured, assumed), measured, assumed) > 1

    if not is_over(ENDLESS):
        return None
    low, high = 0, ENDLESS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_over(middle) else (middle, high)
    return high


def write_tables(measured: Measured, assumed: Assumed = Assumed()) -> str:
    """Return the tables of docs/capacity.md."""
    needs = [need(clinics, measured, assumed) for clinics in SIZES]
    rows: list[tuple[str, Callable[[Need], float]]] = [
        ("sessions at once, at the peak", lambda n: n.sessions),
        ("steps a second, at the peak", lambda n: n.steps_s),
        ("server processes (a core each)", lambda n: n.processes),
        ("cores of the database", lambda n: n.database_cores),
        ("rows a month [million]", lambda n: n.rows_month / 1e6),
        ("database, a year online [GB]", lambda n: n.online_gb),
        ("Parquet, a year [GB]", lambda n: n.archive_gb_year),
        ("sent to pages and robots, a month [GB]", lambda n: n.egress_gb_month),
        ("euros a month", lambda n: n.cost_month),
        ("euros a clinic and month", lambda n: n.cost_a_clinic),
    ]
    lines = ["| clinics | " + " | ".join(f"{size:,}" for size in SIZES) + " |"]
    lines.append("|---|" + "---|" * len(SIZES))
    for name, figure in rows:
        lines.append(f"| {name} | " + " | ".join(_write(figure(one)) for one in needs) + " |")
    lines += ["", "| what breaks | at clinics | then |", "|---|---|---|"]
    found = [(breaks_at(limit, measured, assumed), limit) for limit in LIMITS]
    for at, (what, cure, _) in sorted(found, key=lambda one: one[0] or ENDLESS):
        where = f"{at:,}" if at is not None else f"beyond {ENDLESS:,}"
        lines.append(f"| {what} | {where} | {cure} |")
    return "\n".join(lines) + "\n"


def _write(figure: float) -> str:
    """Return a figure with two that say something."""
    if figure >= 100:
        places = 1 - math.floor(math.log10(figure))
        return f"{round(figure, places):,.0f}"
    return f"{figure:.0f}" if figure >= 10 or figure == int(figure) else f"{figure:.2g}"


def read_measured() -> Measured:
    """Return what the documentation has."""
    pages = [(ROOT / "docs" / name).read_text("utf-8") for name in ("performance.md", "hosting.md")]
    return Measured.read(*pages)


if __name__ == "__main__":
    sys.stdout.write(write_tables(read_measured()))
