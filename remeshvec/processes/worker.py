"""The main loop of a worker process: it answers every task with one message."""

from __future__ import annotations

import _thread
import os
import pickle
import queue
import signal
import struct
import sys
import threading
import time
import traceback
from collections.abc import Callable
from time import perf_counter
from typing import Any, BinaryIO

from ..errors import RemeshvecError, WorkerError

__all__ = ["END_PATIENCE", "answer", "attempt", "receive", "send", "serve"]

END_PATIENCE = 5.0  # seconds that a process has to clean up before it is killed

_LENGTH = struct.Struct("<Q")  # length of a message, sent in front of it


def serve() -> None:
    """Answer messages from the standard input until it ends, or until this process is asked to end.

    The main thread works. Another thread reads, so it notices at once when the parent process has
    gone, for whatever reason.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    source = sys.stdin.buffer
    target = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints must not end up among the answers
    messages: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    status = 0
    try:
        threading.Thread(target=_read, args=(source, messages), daemon=True).start()
        _work(messages, target)
    except (KeyboardInterrupt, OSError):  # the parent no longer reads the answers
        pass
    except BaseException:
        traceback.print_exc()
        status = 1
    finally:
        os._exit(status)


def _read(source: BinaryIO, messages: queue.SimpleQueue[bytes | None]) -> None:
    try:
        while True:
            messages.put(receive(source))
    except (EOFError, OSError, ValueError):
        messages.put(None)
        _interrupt()


def _leave(*_: Any) -> None:
    """End at once: before the first task there is nothing to clear away.

    An exception in its place could hit the import of an extension module, some of which abort then.
    """
    os._exit(0)


def _interrupt() -> None:
    """Interrupt the main thread, and end the process if that has no effect."""
    if hasattr(signal, "pthread_kill"):  # also ends system calls
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
    else:
        _thread.interrupt_main(signal.SIGTERM)
    time.sleep(END_PATIENCE)
    os._exit(1)


def _work(messages: queue.SimpleQueue[bytes | None], target: BinaryIO) -> None:
    setup = messages.get()
    if setup is None:
        return
    try:
        function, common, warm_up = pickle.loads(setup)
        if warm_up is not None:
            warm_up()
    except Exception as error:
        send(target, pickle.dumps(f"{type(error).__name__}: {error}"))
        return
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # KeyboardInterrupt
    send(target, pickle.dumps(None))
    while (message := messages.get()) is not None:
        send(target, answer(function, message, common))
        del message


def answer(function: Callable[..., Any], message: bytes, common: Any) -> bytes:
    """Do one task; return a pickled (value, error, seconds)."""
    start = perf_counter()
    try:
        task = pickle.loads(message)
    except Exception as error:
        reason = f"it cannot be received by a worker process ({error}); workers=1 sends nothing"
        return pickle.dumps((None, WorkerError(reason), perf_counter() - start), 5)
    value, problem, seconds = attempt(function, task, common)
    if problem is not None:
        return pickle.dumps((None, _portable(problem), seconds), 5)
    try:
        return pickle.dumps((value, None, seconds), 5)
    except Exception as error:
        reason = f"its result cannot be sent from the worker process ({error})"
        return pickle.dumps((None, WorkerError(reason), seconds), 5)


def attempt(
    function: Callable[..., Any], task: Any, common: Any
) -> tuple[Any, Exception | None, float]:
    """Call the function; return its value or its error, and the seconds."""
    start = perf_counter()
    try:
        return function(task, common), None, perf_counter() - start
    except Exception as error:
        del task
        _let_go_of_arrays(error)
        return None, error, perf_counter() - start


def _let_go_of_arrays(error: BaseException | None) -> None:
    """Drop the variables of an error and keep its traceback: a caller may keep many errors."""
    while error is not None:
        traceback.clear_frames(error.__traceback__)
        error = error.__cause__ or error.__context__


def _portable(error: Exception) -> Exception:
    """Return an error that can be sent to another process."""
    try:
        if not isinstance(error, RemeshvecError):  # unexpected: add where it comes from
            frames = "".join(traceback.format_exception(type(error), error, error.__traceback__))
            error.__notes__ = [f"In a worker process:\n{frames}"]
        pickle.loads(pickle.dumps(error))
    except Exception:
        return WorkerError(f"{type(error).__name__}: {error}")
    return error


def send(stream: BinaryIO, message: bytes) -> None:
    """Write a message with its length in front."""
    stream.write(_LENGTH.pack(len(message)))
    stream.write(message)
    stream.flush()


def receive(stream: BinaryIO) -> bytes:
    """Read one message; `EOFError` at the end of the stream."""
    (length,) = _LENGTH.unpack(_exactly(stream, _LENGTH.size))
    return _exactly(stream, length)


def _exactly(stream: BinaryIO, length: int) -> bytes:
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return content
