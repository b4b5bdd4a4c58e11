"""Django's `makemessages` with the keywords of our scripts (static/js/shared/language.js)."""

from pathlib import Path

from django.core.management.commands import makemessages

OPTIONS = makemessages.Command
DATE_HEADER = '"POT-Creation-Date:'  # omitted: it would change every time

# The argument that is the template of an error. "refusal" is a comment for translators: no patient
# reads these texts.
REFUSALS = [
    f'--keyword={name}:{place},"refusal"'
    for name, place in (
        ("InvalidSetting", 1),
        ("NotAllowed", 1),
        ("BadGesture", 1),
        ("BadWaypoint", 2),
        ("Marked", 1),
    )
]


class Command(makemessages.Command):
    """Collects the strings to translate into locale/. Guesses no translation."""

    xgettext_options = [*OPTIONS.xgettext_options, "--keyword=n_:1,2", *REFUSALS]
    msgmerge_options = [*OPTIONS.msgmerge_options, "--no-fuzzy-matching"]

    def write_po_file(self, potfile: str, locale: str) -> None:
        """Update the catalog of a language."""
        super().write_po_file(potfile, locale)
        for folder in self.locale_paths:
            file = Path(folder, locale, "LC_MESSAGES", f"{self.domain}.po")
            lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
            kept = (line for line in lines if not line.startswith(DATE_HEADER))
            file.write_text("".join(kept), encoding="utf-8")
