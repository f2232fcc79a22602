"""The modes of a controller and the ways between them as a picture: boxes at given places, a line for each way."""

from collections.abc import Mapping, Sequence
from html import escape
from math import hypot
from textwrap import wrap
from typing import Final

WIDTH, HEIGHT = 166, 48  # of a box
APART = (30, 13)  # two ways between two boxes, from the middle: beside each other, above each other
INK, PALE, PAPER = "#1f2a33", "#5b6b78", "#ffffff"

Place = tuple[float, float]


def picture(
    places: Mapping[str, Place],
    titles: Mapping[str, str],
    ways: Mapping[tuple[str, str], str],
    labels: Mapping[str, int],
) -> str:
    """An SVG. `ways` have what leads from one to the other; `labels` is how wide those that begin somewhere may be."""
    right = max(x for x, _ in places.values()) + WIDTH / 2 + 20
    low = max(y for _, y in places.values()) + HEIGHT / 2 + 20
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right:g} {low:g}" width="{right:g}" height="{low:g}" '
        'font-family="system-ui, sans-serif" font-size="13" role="img">',
        f"<title>{escape(', '.join(titles.values()))}</title>",
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
        f'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="{PALE}"/></marker></defs>',
        f'<rect width="{right:g}" height="{low:g}" rx="8" fill="{PAPER}"/>',
    ]
    for (start, end), why in ways.items():
        parts += _way(places[start], places[end], (end, start) in ways, why, labels.get(start, 22))
    for name, (x, y) in places.items():
        parts.append(
            f'<rect x="{x - WIDTH / 2:g}" y="{y - HEIGHT / 2:g}" width="{WIDTH}" height="{HEIGHT}" rx="10" '
            f'fill="#e8f1f5" stroke="{INK}"/>'
            f'<text x="{x:g}" y="{y + 5:g}" text-anchor="middle" fill="{INK}" font-weight="600">'
            f"{escape(titles[name])}</text>"
        )
    return "\n".join([*parts, "</svg>"]) + "\n"


def _way(start: Place, end: Place, both: bool, why: str, width: int) -> Sequence[str]:
    """An arrow with its words beside it, on the right hand of who goes along it."""
    length = hypot(end[0] - start[0], end[1] - start[1])
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    side = (-along[1], along[0])
    shift = (APART[0] if abs(side[0]) > abs(side[1]) else APART[1]) if both else 0
    begin, stop = (
        _edge((x + side[0] * shift, y + side[1] * shift), (x, y), way)
        for (x, y), way in ((start, along), (end, (-along[0], -along[1])))
    )
    middle = ((begin[0] + stop[0]) / 2, (begin[1] + stop[1]) / 2)
    lines = wrap(why, width)
    away = 8
    x, y = middle[0] + side[0] * away, middle[1] + side[1] * away
    anchor = "middle" if abs(side[0]) < SLANTED else ("start" if side[0] > 0 else "end")
    top = y - 16 * (len(lines) - 1) / 2 + 4 if anchor != "middle" else (
        y + 14 if side[1] > 0 else y - 16 * (len(lines) - 1))  # fmt: skip
    return [
        f'<line x1="{begin[0]:.1f}" y1="{begin[1]:.1f}" x2="{stop[0]:.1f}" y2="{stop[1]:.1f}" stroke="{PALE}" '
        'stroke-width="1.5" marker-end="url(#tip)"/>',
        *(
            f'<text x="{x:.1f}" y="{top + 16 * number:.1f}" text-anchor="{anchor}" fill="{INK}" '
            f'stroke="{PAPER}" stroke-width="5" paint-order="stroke">{escape(line)}</text>'
            for number, line in enumerate(lines)
        ),
    ]


SLANTED: Final = 0.2  # of a side that is not quite up or down


def _edge(at: Place, box: Place, way: Place) -> Place:
    """Where a line that starts at `at`, within a box, leaves it."""
    distances = []
    for position, middle, half, step in zip(at, box, (WIDTH / 2, HEIGHT / 2), way, strict=True):
        if abs(step) > 1e-9:
            distances.append((middle + (half if step > 0 else -half) - position) / step)
    far = min(distances)
    return at[0] + way[0] * far, at[1] + way[1] * far
