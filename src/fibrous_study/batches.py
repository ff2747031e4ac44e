"""How an ensemble of networks is numbered and divided into batches."""

from __future__ import annotations


def share(total: int, count: int, part: int) -> list[int]:
    """Numbers of one of `count` contiguous parts of nearly equal size.

    >>> [share(5, 2, part) for part in (0, 1)]
    [[0, 1, 2], [3, 4]]
    """
    size, longer = divmod(total, count)
    start = part * size + min(part, longer)
    return list(range(start, start + size + (part < longer)))


LARGEST_COUNT = 1000


def replicate_numbers(named: int, count: int) -> list[int]:
    """Numbers of `count` replicates of each of the first `named` networks, in the ensemble of all replicates.

    Thousands tell the named networks apart, so that more replicates leave those that are there as they are.

    >>> replicate_numbers(2, 3)
    [0, 1, 2, 1000, 1001, 1002]
    """
    return [LARGEST_COUNT * network + replicate for network in range(named) for replicate in range(count)]


def replicated(number: int) -> int:
    """The named network of which the replicate of this number is one."""
    return number // LARGEST_COUNT
