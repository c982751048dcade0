"""Whether the kernels are compiled already, and numba loaded without what they do not use."""

from __future__ import annotations

import sys
from pathlib import Path


def load_numba_without_blas() -> None:
    """Import numba, sparing it SciPy's BLAS wrappers: a third of a second that no kernel needs.

    After this, ``np.dot`` does not compile in this process, so only a program of our own may call
    it: the command line does, the library never.
    """
    blas = "scipy.linalg.cython_blas"
    if blas in sys.modules or "numba" in sys.modules:
        return
    sys.modules[blas] = None  # type: ignore[assignment]  # an import of it now fails, as numba allows
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules[blas]


def is_compiled() -> bool:
    """Whether an earlier run left machine code of the metrics' kernels in the cache."""
    from sixd.metrics.kernels import symmetric_max_pairs

    cache = Path(symmetric_max_pairs._cache.cache_path)  # type: ignore[attr-defined]
    return any(cache.glob("kernels.symmetric_max_pairs-*.nbi"))
