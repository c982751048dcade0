"""Sets of ids as people write them: ``"1,5,6,8-12"``, or a list of integers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

LARGEST_ID = 2**31 - 1
"""Ids of scenes, images and objects lie in 0 to this; BOP's own have at most six digits."""


class Ids(tuple[int, ...]):
    """Distinct ids in increasing order."""

    __slots__ = ()

    @classmethod
    def parse(cls, written: object) -> Ids:
        """Read ``"1,5,6,8-12"`` or ``[1, 5, 6]``.

        Raises:
            ValueError: neither of the two forms, an id out of range, or one given twice.
        """
        if isinstance(written, str):
            ids = [i for part in written.split(",") if part.strip() for i in _range(part)]
        elif isinstance(written, Iterable):
            ids = [_id(item) for item in written]
        else:
            raise ValueError(f'Expected ids like `"1,5,8-12"` or `[1, 5, 8]`, got `{written!r}`')
        if len(set(ids)) != len(ids):
            twice = next(i for i, n in Counter(ids).items() if n > 1)
            raise ValueError(f"Expected distinct ids, got `{twice}` twice")
        return cls(sorted(ids))

    def __str__(self) -> str:
        """The short form: ``1,5,6,8-12``."""
        runs: list[list[int]] = []
        for i in self:
            if runs and runs[-1][1] == i - 1:
                runs[-1][1] = i
            else:
                runs.append([i, i])
        return ",".join(str(a) if a == b else f"{a}-{b}" for a, b in runs)


def some(ids: Iterable[object], most: int = 10) -> str:
    """Ids for a message, as they come: the first ten, and how many more."""
    listed = list(ids)
    more = f" and {len(listed) - most:,} more" if len(listed) > most else ""
    return ", ".join(map(str, listed[:most])) + more or "none"


def _range(part: str) -> range:
    first, dash, last = part.strip().partition("-")
    try:
        a, b = _id(int(first)), _id(int(last if dash else first))
    except ValueError:
        raise ValueError(f'Expected ids like `"1,5,8-12"`, got `{part.strip()}`') from None
    if b < a:
        raise ValueError(f"Expected a range from low to high, got `{part.strip()}`")
    if b - a >= 1_000_000:
        raise ValueError(f"Expected at most a million ids, got `{part.strip()}`")
    return range(a, b + 1)


def _id(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_ID:
        raise ValueError(f"Expected an id from 0 to {LARGEST_ID}, got `{value!r}`")
    return value
