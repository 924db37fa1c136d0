"""Arrays as the signatures of the package name them; shapes stand in the docstrings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

#: Real numbers; where a signature takes what converts to them, too.
Array = NDArray[Any]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
#: A dataclass, and a function of it gives the same one.
Dataclass = TypeVar("Dataclass", bound="DataclassInstance")
