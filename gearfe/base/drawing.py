"""Find the picture function of a result.

Pictures stand above all results, and results must not name what is above them. So the package itself, which is above
both (`gearfe/__init__.py`), puts the function here that `gearfe.base.shown.Shown.plot` calls.
"""

TYPE_CHECKING = False  # `typing` itself would be a third of ``import gearfe``
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

#: Result -> its picture as a matplotlib figure.
draw: "Callable[[Any], Any]"
