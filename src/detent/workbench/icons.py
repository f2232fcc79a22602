"""The icons of the workbench: outlines on a grid of 24, drawn in the colour of the text around them."""

_PATHS = {
    "cell": "M4 5h7v14H4zM15 9h5v10h-5zM11 8h2v4h2M7.5 8.5v0M7.5 12v0M7.5 15.5v0M17.5 13v0M17.5 16v0",
    "program": "M5 4h14v16H5zM8.5 8.5h4M8.5 12h7M8.5 15.5h5",
    "terminal": "M3.5 5h17v14h-17zM7 9.5l3 2.5-3 2.5M12.5 15H17",
    "scope": "M3.5 5h17v14h-17zM6 12c1.5-5 3-5 4.5 0s3 5 4.5 0q1-3 3-3",
    "motion": "M4 19h16M4 19l4.5-11h7L20 19M8.5 8v11M15.5 8v11",
    "unit": "M4 6h16v12H4zM8 12a2 2 0 1 0 0 .01M13 10h4M13 14h4",
    "begin": "M4 11l8-7 8 7M6.5 9.5V20h11V9.5M10 20v-5h4v5",
    "commands": "M4 5h6q2 0 2 2v12q0-2-2-2H4zM20 5h-6q-2 0-2 2v12q0-2 2-2h6z",
    "pause": "M8 5.5v13M16 5.5v13",
    "go": "M7.5 5l11 7-11 7z",
    "step": "M6 5l8.5 7L6 19zM18 5v14",
    "back": "M18 5l-8.5 7 8.5 7zM6 5v14",
    "theme": "M12 4a8 8 0 1 0 0 16zM12 4a8 8 0 0 1 0 16",
    "tour": "M12 3.5a8.5 8.5 0 1 0 0 17 8.5 8.5 0 0 0 0-17zM9.5 9.5q.5-2.5 2.5-2.5t2.5 2.5c0 2-2.5 2-2.5 4.5M12 17v0",
    "power": "M12 3.5v8M7.5 6.5a7.5 7.5 0 1 0 9 0",
    "restart": "M5 12a7 7 0 1 0 2.5-5.4M5 4v4h4",
    "send": "M4 12h14M13 6.5l5.5 5.5-5.5 5.5",
    "start": "M7.5 5l11 7-11 7z",
    "faster": "M5 6l6 6-6 6M12.5 6l6 6-6 6",
    "slower": "M19 6l-6 6 6 6M11.5 6l-6 6 6 6",
}


def icon(name: str) -> str:
    """The icon as inline SVG. Raises KeyError."""
    return f'<svg class="icon" viewBox="0 0 24 24" aria-hidden="true"><path d="{_PATHS[name]}"/></svg>'
