"""Figures of motors: all that is drawn can be seen, and each line says what it is."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from detent.motors.curve import PullOut
from detent.motors.drive import Drive
from detent.motors.named import motor
from detent.outputs import motor_figures, tuning_figures

pytest.importorskip("matplotlib")


@pytest.mark.parametrize("torque", [0.1, 0.35, 0.58, 3.0])
def test_a_torque_above_the_rated_one_is_in_the_picture(torque: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """More current than the rated one gives more torque: the curve left the picture at its top."""
    drawn: list[Any] = []
    monkeypatch.setattr(motor_figures, "save", lambda figure, path: drawn.append(figure))
    points = [PullOut(rate, torque * (1 - rate / 2000), 90.0) for rate in (50.0, 1000.0)]
    motor_figures.write_curve(Path("torque.png"), motor("qsh4218-41-10-035"), Drive(24, 1.0), points)
    (axes,) = drawn[0].axes
    bottom, top = axes.get_ylim()
    for line in axes.get_lines():
        assert bottom <= np.min(line.get_ydata()) <= np.max(line.get_ydata()) < top
        assert not line.get_label().startswith("_")


def test_a_comparison_begins_with_its_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(tuning_figures, "save", lambda figure, path: drawn.append(figure))
    lines = [tuning_figures.Line(f"{end}", np.linspace(0.01, end, 9), np.full(9, 100.0), np.zeros(9))
             for end in (1.0, 3.0)]  # fmt: skip
    tuning_figures.write_comparison(Path("compared.png"), lines, title="settings", about="")
    for axes in drawn[0].axes:
        begin, end = axes.get_xlim()
        assert begin == 0
        assert end > 3000


@pytest.mark.parametrize("words", [3, 12, 30, 90])
@pytest.mark.parametrize("panels", [1, 2])
def test_no_heading_runs_out_of_its_picture_or_into_the_panels(words: int, panels: int) -> None:
    """A reason why steps are lost is as long as it is, and a map may be of 32 moves."""
    about = " ".join(["swings grow"] * words)
    figure, axes = motor_figures.blank(" ".join(["qsh4218"] * min(words, 40)), about, panels)
    assert " ".join(figure.texts[1].get_text().split()) == about
    for text in figure.texts:
        box = text.get_window_extent()
        assert box.x1 <= figure.bbox.width
        assert box.y0 > axes[-1].get_window_extent().y1
    assert figure.texts[1].get_fontsize() == 10 or words > 20
