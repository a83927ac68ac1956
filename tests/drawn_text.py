"""Which texts of a figure cover one another."""

from typing import Any

from matplotlib.axis import Axis
from matplotlib.text import Text


def overlapping(figure: Any) -> list[tuple[str, str]]:
    """Pairs of texts that cover one another."""
    figure.draw_without_rendering()
    outside = []  # ticks beyond an axis's ends are kept by it, but not drawn
    for axis in figure.findobj(Axis):
        low, high = sorted(axis.get_view_interval())
        unseen = [tick for tick in axis.get_major_ticks() if not (axis.axes.axison and low <= tick.get_loc() <= high)]
        outside += [text for tick in unseen for text in (tick.label1, tick.label2)]
    hidden = {id(text) for text in outside}
    texts = [t for t in figure.findobj(Text) if t.get_visible() and t.get_text().strip() and id(t) not in hidden]
    boxes = [(t.get_text(), t.get_window_extent().padded(-1.0)) for t in texts]
    return [(a, b) for k, (a, one) in enumerate(boxes) for b, other in boxes[k + 1 :] if one.overlaps(other)]
