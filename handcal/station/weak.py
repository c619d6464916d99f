"""Methods that do not keep their object in memory."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import ParamSpec, TypeVar

Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")


def weakly(method: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """Return a function that calls a method, for a part of the method's own object.

    With the method itself, object and part keep each other in memory until Python collects garbage.
    Beside a window's many objects it does so rarely, and ended stations piled up.
    """
    reference = weakref.WeakMethod(method)

    def call(*arguments: Arguments.args, **options: Arguments.kwargs) -> Answer:
        found = reference()
        if found is None:
            raise ReferenceError("the object of this method has ended")
        return found(*arguments, **options)

    return call
