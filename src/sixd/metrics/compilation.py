"""Whether the kernels are compiled already, and numba loaded without what they do not use."""

from __future__ import annotations

import sys
from pathlib import Path

_SPARED = ("scipy", "yaml", "colorama")
"""What numba imports if it is there, and no kernel of ours needs."""


def load_numba_lean() -> None:
    """Import numba, sparing it packages it can do without: a third of a second.

    After this, ``np.dot`` does not compile in this process, so only a program of our own may call
    it: the command line does, the library never.
    """
    spared = [name for name in _SPARED if name not in sys.modules]
    if "numba" in sys.modules or "scipy" not in spared:
        return
    for name in spared:
        sys.modules[name] = None  # type: ignore[assignment]  # an import of it now fails
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        for name in spared:
            del sys.modules[name]


def is_compiled() -> bool:
    """Whether an earlier run left machine code of the metrics' kernels in the cache."""
    from sixd.metrics.kernels import symmetric_max_pairs

    cache = getattr(symmetric_max_pairs, "_cache", None)
    if cache is None:  # NUMBA_DISABLE_JIT: plain Python, nothing to compile
        return True
    return any(Path(cache.cache_path).glob("kernels.symmetric_max_pairs-*.nbi"))
