"""Rows that are only ever added: what happened in a study is not rewritten."""

from __future__ import annotations

from typing import Any, NoReturn

from rehab.people.scope import ScopedModel


class AppendOnlyRow(TypeError):
    """An attempt to change or delete a row that says what happened."""

    def __init__(self, row: str) -> None:
        super().__init__(f"A {row} of a study is never changed. Add another one.")


class AppendOnlyModel(ScopedModel):
    """A model whose rows can be added and read. Erasing a patient empties free text by a query."""

    class Meta(ScopedModel.Meta):
        abstract = True

    def save(self, *args: Any, **kwargs: Any) -> None:
        """Add the row. Raises AppendOnlyRow for a stored one."""
        if not self._state.adding:
            raise AppendOnlyRow(str(self._meta.verbose_name))
        super().save(*args, **kwargs)

    def delete(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Raise AppendOnlyRow."""
        raise AppendOnlyRow(str(self._meta.verbose_name))
