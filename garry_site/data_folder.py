"""The folder of database and secrets: closed to others, with the key that GARRY made for itself."""

import os
import secrets
from pathlib import Path


def close_data_folder(folder: Path) -> None:
    """Close an existing data folder to other accounts of the machine, if it is ours."""
    try:
        found = folder.stat()
        if found.st_uid == os.geteuid() and found.st_mode & 0o077:
            folder.chmod(0o700)
    except (AttributeError, OSError):  # Windows; no folder yet; a disk without permissions
        pass  # check garry.E011 names a folder that stays open


def read_secret_key(folder: Path) -> str:
    """Return the key of a data folder; where there is none, make one (one machine only)."""
    file = folder / "secret_key"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with os.fdopen(os.open(file, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600), "w") as out:
                out.write(secrets.token_urlsafe(50))
        except FileExistsError:
            pass  # another process was faster; its key counts
    return file.read_text().strip()
