"""How an ensemble is divided; apart from the plan, whose changes must not make the networks anew."""

from __future__ import annotations


def share(total: int, count: int, part: int) -> list[int]:
    """Numbers of one of `count` contiguous parts of nearly equal size.

    >>> [share(5, 2, part) for part in (0, 1)]
    [[0, 1, 2], [3, 4]]
    """
    size, longer = divmod(total, count)
    start = part * size + min(part, longer)
    return list(range(start, start + size + (part < longer)))
