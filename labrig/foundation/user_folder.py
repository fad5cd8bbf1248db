"""Files of this user's own settings, on this PC."""

from pathlib import Path


def settings_file(name: str) -> Path:
    """Return the path of a file in the folder of this user's settings, which may not exist yet."""
    import typer  # slow to load

    return Path(typer.get_app_dir("labrig")) / name
