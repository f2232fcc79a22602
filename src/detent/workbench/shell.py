"""What stands around every page: title and tabs above, the controls of time and the time line below."""

from collections.abc import Callable, Sequence
from html import escape

from nicegui import ui

from detent.workbench.board import PACES
from detent.workbench.icons import icon
from detent.workbench.pages import STOP_KEY, Page, Window

STYLES = ("workbench.css", "unit.css")
SCRIPTS = ("workbench.js", "timeline.js", "tour.js", "stop.js")

FAVICON = (
    "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 24 24'><rect width='24' height='24' rx='5' fill='%2323282b'/>"
    "<path d='M3 16h3.500l2.500-8 3 8 3-8 2.500 8H21' fill='none' stroke='%237fe3d0' stroke-width='1.800'/></svg>"
)

# Before anything is drawn, so that no page flashes in the other theme.
_THEME_FIRST = """<script>
(() => { let t = null; try { t = localStorage.getItem("detent.theme"); } catch {}
document.documentElement.dataset.theme = t === "light" || t === "dark" ? t :
  matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"; })();
</script>"""


def head(pages: Sequence[Page], version: str) -> str:
    """The lines in the head of every page: theme, style sheets, scripts. `version` keeps browsers from old ones."""
    styles = dict.fromkeys((*STYLES, *(style for page in pages for style in page.styles)))
    scripts = dict.fromkeys((*SCRIPTS, *(script for page in pages for script in page.scripts)))
    lines = [_THEME_FIRST, '<meta name="theme-color" content="#23282b">']
    lines += [f'<link rel="stylesheet" href="/assets/{style}?{version}">' for style in styles]
    lines += [f'<script type="module" src="/assets/{script}?{version}"></script>' for script in scripts]
    return "\n".join(lines)


def build(window: Window, pages: Sequence[Page]) -> None:
    """The shell, and in it the page that the address names."""

    def shown(page: Page) -> Callable[[], None]:
        def show() -> None:
            window.leave()
            page.build(window.bench, window)

        return show

    ui.html(_top(window.bench.picture.title or window.bench.picture.target, pages), sanitize=False).classes("top")
    with ui.element("main").classes("page"):
        ui.sub_pages({page.path: shown(page) for page in pages}).classes("grow")
    ui.html(_bottom(), sanitize=False).classes("bottom")


def _top(title: str, pages: Sequence[Page]) -> str:
    tabs = "".join(
        f'<a href="{page.path}" data-name="{page.name}">{icon(page.icon)}<span>{page.name}</span></a>' for page in pages
    )
    return f"""<header>
  <span class="brand" aria-hidden="true"><svg viewBox="0 0 24 24"><path d="M2 17h4l3-10 3 10 3-10 3 10h4"/></svg></span>
  <h1 class="title" data-live="title">{escape(title)}</h1>
  <nav class="tabs" data-part="tabs" aria-label="Pages">{tabs}</nav>
  <span class="tools">
    {STOP_KEY}
    <span class="others" data-level="windows" data-help="Windows that show this cell"><b data-live="windows"></b>
      windows</span>
    <button class="key bare" data-part="restart" aria-label="Begin anew"
      data-help="Begin anew from the cell file: click twice">{icon("restart")}</button>
    <button class="key bare" data-part="theme" aria-label="Light or dark"
      data-help="Light or dark">{icon("theme")}</button>
    <button class="key bare" data-part="tour-button" aria-label="Guided tour"
      data-help="A short guided tour ( ? )">{icon("tour")}</button>
  </span>
</header>
<dialog class="panel futures" data-part="futures" aria-label="Other futures"><h2>Other futures</h2>
<p class="quiet">The cell went on from its past, and something else happened. What had happened before is kept.</p>
<ul></ul><div class="row">{STOP_KEY}<span class="grow"></span><button class="key" data-close>Close</button></div>
</dialog>
<div class="alarm" role="alert" data-part="alarm"><span data-live="crashed"></span>
  <button class="key small primary" data-do="revive">Start the cell again</button></div>
<div class="alarm halted" role="alert"><span data-live="realwhy"></span>
  <button class="key small primary" data-do="recover" data-help="Look at the machine first">Recover</button></div>
<div class="alarm silent" role="alert"><span>The process of the cell has said nothing for <b data-live="silent"></b> s:
  this computer is very busy, or it hangs. <b class="stoppable">STOP ends it, and boards that it drives stop.</b></span>
  <button class="key small" data-do="end_silent">End it, and start it again</button></div>
<div class="alarm mute" role="alert"><span>No answer from the workbench since <b></b> s: what this page
  shows is older. <b class="stoppable">STOP may reach nothing: if something moves, switch off the supply of its
  motor.</b></span></div>
<div class="alarm link" role="alert">No connection to the workbench. Trying again …
  <b class="stoppable">STOP reaches nothing meanwhile: if something moves, switch off the supply of its motor.</b></div>
<div class="alarm unconfirmed" role="alert" data-part="unconfirmed"><span></span>
  <button class="key small" data-close>Seen</button></div>"""


def _bottom() -> str:
    notches = [("max", "max") if one is None else (f"{one:g}", f"{one:g}&times;") for one in PACES]
    paces = "".join(f'<option value="{value}">{text}</option>' for value, text in notches)
    return f"""<footer aria-label="Time">
  <div class="transport">
    <button class="key" data-do="step_back" data-args="[null]" aria-label="Back by one event"
      data-help="Back by one event ( , )">{icon("back")}</button>
    <button class="key primary go" data-part="go" data-pressed="held" aria-label="Pause or go"
      data-help="Pause or go (space)"><i class="when-held">{icon("go")}</i>
      <i class="when-going">{icon("pause")}</i></button>
    <button class="key" data-do="step_event" aria-label="On by one event"
      data-help="On by one event ( . )">{icon("step")}</button>
    <span class="pace"><button class="key" data-do="slower" aria-label="Slower"
      data-help="Slower ( [ )">{icon("slower")}</button><select class="field" data-part="pace" aria-label="Pace"
      data-help="How fast the cell runs: times real time">{paces}</select><button class="key" data-do="faster"
      aria-label="Faster" data-help="Faster ( ] )">{icon("faster")}</button></span>
    <span class="notices"><button class="waiting" data-part="broken" hidden></button>
    <a class="waiting" href="/terminal" data-part="waiting" hidden
      data-help="Commands that wait until time goes on: see them, or take them back, on the page Terminal"></a>
    <button class="waiting calm" data-part="branches" hidden
      data-help="The cell went on from its past: what came after is kept. Compare it, or take it again"></button></span>
    <span class="why" data-live="why" data-level="past" aria-live="polite"></span>
    <span class="pulse" data-help="How late events of the cell are served, 99 of 100 at most; how fast it really runs">
      <span class="dropped" data-level="dropped"><b data-live="dropped"></b> bytes lost</span>
      <span class="gone" data-level="begin" data-help="What was before is dropped: --memory says how much is kept">kept
      from <b class="num" data-live="begin" data-form="time"></b> s</span>
      late <b class="num" data-live="late" data-form="fixed"></b> ms
      <b class="num" data-live="faster" data-form="pace"></b></span>
    <output class="clock" aria-label="Time of the cell">
      <b data-live="now" data-form="time"></b><small>s</small></output>
  </div>
  <div class="history" data-part="timeline" tabindex="0" role="slider" aria-label="Time line"></div>
</footer>"""
