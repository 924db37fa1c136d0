"""Labels of lines: none covers another or a line, none leaves the frame; ellipses beside pressures."""

import numpy as np
import pytest
from matplotlib.text import Text

from gearfe.figures.campbell import OrderLine, _label_orders
from gearfe.figures.spectra import label_lines
from gearfe.figures.stiffness import ellipse
from gearfe.figures.style import fixed


@pytest.mark.parametrize("seed", range(8))
def test_labels_keep_apart(seed):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0.0, 10.0, 60))
    y = rng.exponential(1.0, 60)
    chosen = np.argsort(-y)[:6]
    figure = fixed(8.0, 4.0)
    axes = figure.add_axes((0.1, 0.1, 0.85, 0.8))
    axes.set_xlim(0.0, 10.0)
    axes.set_ylim(0.0, 1.3 * y.max())
    label_lines(axes, [(x[i], y[i], f"{x[i]:.4f} Hz\nmesh 1 × 2") for i in chosen], x, y, fontsize=8.5)
    figure.canvas.draw()
    frame = axes.get_window_extent()
    texts = [text.get_text() for text in axes.texts]
    assert len(set(texts)) == len(texts) >= 5
    tips = axes.transData.transform(np.column_stack([x, y]))
    for number, text in enumerate(axes.texts):
        own = Text.get_window_extent(text)  # the text without its line
        assert frame.x0 - 1 <= own.x0 <= own.x1 <= frame.x1 + 1
        assert own.y1 <= frame.y1
        assert not ((tips[:, 0] > own.x0) & (tips[:, 0] < own.x1) & (tips[:, 1] > own.y0)).any()
        for other in axes.texts[:number]:
            assert not own.overlaps(Text.get_window_extent(other))


@pytest.mark.parametrize(
    ("slopes", "least"),
    [(3.2e-3 * np.arange(1, 7), 4), (16.5e-3 * np.arange(1, 7), 0), ([2e-3, 2.01e-3, 2.03e-3, 2.4e-3, 2.5e-3], 5)],
)
def test_names_of_orders_stay_in_the_picture_and_apart(slopes, least):
    """Few orders, whose names stand at the right end; many that leave at the top, close to the left end; those of two
    meshes that nearly agree."""
    figure = fixed(8.0, 4.0)
    axes = figure.add_axes((0.1, 0.1, 0.85, 0.8))
    axes.set_xlim(300.0, 1200.0)
    axes.set_ylim(0.0, 5.0)
    lines = [OrderLine(f"{k}×m1", slope, 0) for k, slope in enumerate(slopes, start=1)]
    _label_orders(axes, lines, 300.0, 1200.0, 5.0, ["k"])
    figure.canvas.draw()
    frame, boxes = axes.get_window_extent(), [Text.get_window_extent(text) for text in axes.texts]
    assert least <= len(boxes) <= (len(slopes) if least else 3)
    for number, own in enumerate(boxes):
        assert frame.x0 <= own.x0 <= own.x1 <= frame.x1
        assert own.y1 <= frame.y1
        assert not any(own.overlaps(other) for other in boxes[:number])


def test_the_ellipse_of_a_hertzian_pressure_is_itself():
    x = np.linspace(3.0, 5.0, 4001)
    found, peak = ellipse(x, 7.0 * np.sqrt(np.maximum(1.0 - ((x - 4.0) / 0.8) ** 2, 0.0)))
    assert found[[0, -1]] == pytest.approx([3.2, 4.8], rel=1e-4)
    assert peak.max() == pytest.approx(7.0, rel=1e-4)
