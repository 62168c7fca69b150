"""Kernels compiled by two processes at once: one runs a job as usual, the other begins with the job's last kernel.

    here     the job: k1 compiled, k1 run, k2 compiled, k2 run, ... ->
    helper   the job in plain Python, noting k1 ... k9; then k9, k8, k7 compiled ... <-

What one is building the other waits for, or leaves out (store.claim). The helper only saves time: where it cannot be
started, or ends early, all is compiled here.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from importlib import import_module

from gcodectl.jit import Kernel, noting


def compile_together(job: Callable[[], None], module: str) -> None:
    """Run `job`, whose kernels are kept then; `module` is what the helper runs, and calls `help_with` for the job."""
    helper, nowhere = None, subprocess.DEVNULL
    with suppress(OSError):
        helper = subprocess.Popen([sys.executable, "-m", module], stdin=nowhere, stdout=nowhere, stderr=nowhere)
    job()
    if helper is not None:
        helper.wait()


def help_with(job: Callable[[], None]) -> None:
    """Compile a job's kernels, the last first, as far as nobody else does."""
    with suppress(KeyboardInterrupt):
        with noting() as wanted:
            job()
        compile_each(reversed(wanted))


def compile_each(wanted: Iterable[tuple[str, str]]) -> None:
    """Compile kernels, by name and signature, that are neither kept nor being built."""
    for name, signature in wanted:
        module, _, function = name.partition(":")
        kernel = getattr(import_module(module), function, None)
        if isinstance(kernel, Kernel) and not kernel.is_kept(signature) and not kernel.is_busy(signature):
            kernel.compile(signature)
