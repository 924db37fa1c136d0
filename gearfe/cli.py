"""The ``gearfe`` program: listens to Ctrl-C from its first lines on, then loads the commands."""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # nothing that takes time is imported before Ctrl-C is listened to
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

#: Exit code of an interrupted program, as shells give it (128 + SIGINT).
INTERRUPTED = 130


class Interrupted(KeyboardInterrupt):
    """Ctrl-C.

    Not KeyboardInterrupt itself: where that one leaves source text that is executed, and standard modules make their
    classes so, CPython ends the process by the signal, whatever handles it later (``run_eval_code_obj``).
    """


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return its exit code.

    0 done, 1 done with failures, 2 bad input, 130 interrupted, 141 the reader of the output closed it.
    """
    listening = False
    try:
        import signal

        # who has put another handler there, or none, wants it so
        listening = signal.getsignal(signal.SIGINT) is signal.default_int_handler and _listen()
        from .commands.program import answer

        return answer(list(sys.argv[1:] if argv is None else argv))
    except KeyboardInterrupt:
        print("gearfe: interrupted", file=sys.stderr)
        return INTERRUPTED
    finally:
        if listening:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _listen() -> bool:
    """Whether Ctrl-C raises `Interrupted` from now on; only the main thread may ask for that."""
    import signal

    try:
        signal.signal(signal.SIGINT, _interrupt)
    except ValueError:
        return False
    return True


def _interrupt(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - as handlers are called
    raise Interrupted


if __name__ == "__main__":
    sys.exit(main())
