"""Build: a wheel carries the files of the pages, which a checkout has beside the packages."""

from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.command.egg_info import FileList


def page_files() -> list[str]:
    """Return what MANIFEST.in names. Raises SystemExit, with the cure, where a part is missing."""
    found = FileList()
    for line in Path("MANIFEST.in").read_text("utf-8").splitlines():
        before = len(found.files)
        found.process_template_line(line)
        if len(found.files) == before and not line.startswith("prune"):
            raise SystemExit(f"Nothing is there for: {line}. Cure: npm ci, make messages")
    return sorted(found.files)


class BuildWithPageFiles(build_py):
    """Copies them into the package, where garry_site.settings finds them; unless editable."""

    def run(self) -> None:
        """Build."""
        super().run()
        if self.editable_mode:
            return
        for name in page_files():
            target = Path(self.build_lib, "garry_site", "files", name)
            self.mkpath(str(target.parent))
            self.copy_file(name, str(target), preserve_mode=False)


setup(cmdclass={"build_py": BuildWithPageFiles})
