"""What can be added from outside: a registry for each kind, of GARRY's own parts and of plug-ins.

A plug-in is an entry point of an installed package. GARRY's own parts are listed in the code, so
that a checkout that was never installed has them; both are loaded and checked by the same rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pkgutil import resolve_name
from typing import Any, Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Plugin:
    """A part of another package: its kind and name there, and the package's name and version.

    ``problem``: why it cannot be used; empty where it can.
    """

    group: str
    name: str
    package: str
    version: str
    summary: str
    thing: Any = None
    problem: str = ""

    def describe(self) -> dict[str, str]:
        """Return what a session's record has of it."""
        return {
            "kind": self.group,
            "name": self.name,
            "package": self.package,
            "version": self.version,
        }


class Registry(Mapping[str, T], Generic[T]):
    """The parts of a kind by name: first GARRY's own, then those of plug-ins that can be used.

    Plug-ins are loaded when names are first listed, or one that is not our own is asked for. One
    that fails is left out, and never ends the program.

    Parameters
    ----------
    group
        Of the entry points: ``garry.bases``.
    own
        GARRY's own parts; a text ``module:name`` is loaded when it is asked for.
    check
        Raises TypeError or ValueError, given name and part, for what is none of this kind.
    """

    def __init__(
        self, group: str, own: Mapping[str, T | str], check: Callable[[str, Any], None]
    ) -> None:
        self.group = group
        self._own = dict(own)
        self._check = check

    def __getitem__(self, name: str) -> T:
        if name not in self._own:
            return self._usable[name].thing  # type: ignore[no-any-return]
        part: Any = self._own[name]
        if isinstance(part, str):
            part = resolve_name(part)
            self._check(name, part)
            self._own[name] = part
        return part  # type: ignore[no-any-return]

    def __iter__(self) -> Iterator[str]:
        yield from self._own
        yield from self._usable

    def __len__(self) -> int:
        return len(self._own) + len(self._usable)

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self._usable

    @cached_property
    def plugins(self) -> tuple[Plugin, ...]:
        """All of other packages, by package and name; broken ones, too."""
        from importlib.metadata import entry_points  # of what is installed; slow, so not before

        found: dict[str, Plugin] = {}
        broken: list[Plugin] = []
        for point in sorted(entry_points(group=self.group), key=_order):
            package = point.dist
            about = (
                self.group,
                point.name,
                package.name if package else "",
                package.version if package else "",
                (package.metadata["Summary"] or "") if package else "",
            )
            try:
                if point.name in self._own or point.name in found:
                    raise ValueError("the name is taken. Give it another one")
                part = point.load()
                self._check(point.name, part)
            except (Exception, SystemExit) as problem:
                why = f"{type(problem).__name__}: {problem}"
                broken.append(Plugin(*about, problem=why))
            else:
                found[point.name] = Plugin(*about, part)
        return (*found.values(), *broken)

    @cached_property
    def _usable(self) -> dict[str, Plugin]:
        return {plugin.name: plugin for plugin in self.plugins if not plugin.problem}

    def find_plugin(self, name: str) -> Plugin | None:
        """Return the plug-in that has this part; None where it is GARRY's own, or none at all."""
        return None if name in self._own else self._usable.get(name)


def find_names(group: str) -> list[str]:
    """Return what plug-ins of a kind call their parts, without loading them.

    Parameters
    ----------
    group
        Of the entry points.
    """
    from importlib.metadata import entry_points

    return sorted(entry_points(group=group).names)


def _order(point: Any) -> tuple[str, str]:
    return (point.dist.name if point.dist else "", point.name)


def check_class(base: type) -> Callable[[str, Any], None]:
    """Return a check that a part is a class that implements an interface, under its own name.

    Parameters
    ----------
    base
        The interface, as ``MobileBase``.
    """

    def check(name: str, part: Any) -> None:
        if not (isinstance(part, type) and issubclass(part, base)):
            raise TypeError(f"{part!r} is no {base.__name__}")
        if missing := getattr(part, "__abstractmethods__", ()):
            raise TypeError(f"{part.__name__} lacks {', '.join(sorted(missing))}")
        own = getattr(part, "name", name)
        if own != name:
            raise ValueError(f"it calls itself {own}. Give its entry point that name")

    return check


def check_one(kind: type, attribute: str) -> Callable[[str, Any], None]:
    """Return a check that a part is an object of a class, whose attribute has its name.

    Parameters
    ----------
    kind
        The class, as ``Measure``.
    attribute
        What holds the part's own name.
    """

    def check(name: str, part: Any) -> None:
        if not isinstance(part, kind):
            raise TypeError(f"{part!r} is no {kind.__name__}")
        if getattr(part, attribute) != name:
            own = getattr(part, attribute)
            raise ValueError(f"it calls itself {own}. Give its entry point that name")

    return check
