"""What is installed: Goshawk's version, and whether its packages, some of generic names, are the ones Python finds."""

import os.path
from importlib.util import find_spec

PACKAGES = ("flight", "esdf", "vehicle", "mapping", "planner", "sysid", "firmware_bridge", "preflight", "gcs_web")
"""The packages that come with `goshawk`, in the same folder."""


def version() -> str:
    """Of the installed distribution."""
    from importlib import metadata  # not at every start

    return metadata.version("goshawk")


def require_own_packages() -> None:
    """Look each package up without importing it.

    Raises:
        ImportError: Python finds another module of that name, or none.
    """
    ours = os.path.realpath(os.path.join(os.path.dirname(__file__), ".."))
    for name in PACKAGES:
        found = _file_of(name)
        if found is None:
            raise ImportError(f"{name}, a package of Goshawk, is not in {ours}; install Goshawk again")
        if os.path.realpath(os.path.join(os.path.dirname(found), "..")) != ours:
            raise ImportError(
                f"Python finds another {name!r}, {found}, before Goshawk's, {ours}/{name}; rename or uninstall it, "
                "or install Goshawk in an environment of its own"
            )


def other_owners() -> dict[str, list[str]]:
    """Other installed distributions with a package of one of our names: in the same folder they replace its files."""
    from importlib import metadata

    owners = metadata.packages_distributions()
    others = {name: sorted({*owners.get(name, ())} - {"goshawk"}) for name in PACKAGES}
    return {name: found for name, found in others.items() if found}


def _file_of(name: str) -> str | None:
    try:
        spec = find_spec(name)
    except ValueError:  # somebody made a module of this name without a file
        return f"a module {name} without a file"
    return spec.origin if spec else None
