"""`detent docs`: the documentation, in a browser."""

from pathlib import Path


def docs(*, no_browser: bool = False, json: bool = False) -> None:
    """Open the documentation in a browser, or say where it is.

    In a checkout that is the site that `make docs` builds; elsewhere the address that the package names.

    Parameters
    ----------
    no_browser
        Print the address only.
    json
        Print the address as one line of JSON only.
    """
    import json as json_text
    import webbrowser

    from detent.cli.endings import failed

    project = Path(__file__).parents[3]
    site = project / "docs" / "_build" / "html" / "index.html"
    if site.is_file():
        address = site.as_uri()
    elif (project / "docs" / "conf.py").is_file():
        failed(f"the pages are not built: make -C {project} docs; or read {project / 'docs' / 'index.md'}")
    else:
        address = _told()
    print(json_text.dumps({"docs": address}) if json else address)
    if not (no_browser or json):
        webbrowser.open(address)


def _told() -> str:
    """The address of the documentation by the package's own word."""
    from importlib.metadata import metadata

    from detent.extras import DISTRIBUTION

    links = dict(link.split(", ", 1) for link in metadata(DISTRIBUTION).get_all("Project-URL", []))
    return str(links["Documentation"])
