"""`detent docs`: the documentation, in a browser."""

from pathlib import Path


def docs(*, no_browser: bool = False, json: bool = False) -> None:
    """Open the documentation in a browser, or say where it is.

    In a checkout that is the site that `make docs` builds; an installed package has the same pages as text.

    For example: `detent docs --no-browser`

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
    from detent.extras import how_to_install

    package = Path(__file__).parents[1]
    project = package.parents[1]
    site, pages = project / "docs" / "_build" / "html" / "index.html", package / "docs" / "index.md"
    if not site.is_file() and (project / "docs" / "conf.py").is_file():
        failed(f"the pages are not built: make -C {project} docs; or read {project / 'docs' / 'index.md'}")
    if not site.is_file() and not pages.is_file():
        failed(f"the pages are not where they were installed, in {pages.parent}: {how_to_install()}")
    found = site if site.is_file() else pages
    print(json_text.dumps({"docs": found.as_uri()}) if json else found.as_uri() if found == site else f"Read {found}")
    if found == site and not (no_browser or json):
        webbrowser.open(found.as_uri())
