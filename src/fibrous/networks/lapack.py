"""Banded Cholesky of LAPACK for compiled code that holds no lock, so that threads factorise at the same time.

The routines are SciPy's. Their addresses are arguments, not constants, of the compiled functions: an address changes
from run to run, and a function that held one could not be kept on disk.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import get_cython_function_address, intrinsic
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Addresses of `dpbtrf` and `dtbtrs`, as the compiled functions take them.
ADDRESSES = tuple(get_cython_function_address("scipy.linalg.cython_lapack", name) for name in ("dpbtrf", "dtbtrs"))


@intrinsic
def _call(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Call the routine at an address with pointers, which Fortran takes for all its arguments."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = ir.IntType(8).as_pointer()
        function = ir.FunctionType(ir.VoidType(), [pointer] * len(arguments)).as_pointer()
        pointers = [builder.inttoptr(value, pointer) for value in cgutils.unpack_tuple(builder, values[1])]
        builder.call(builder.inttoptr(values[0], function), pointers)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), generate


@njit(cache=True, nogil=True)
def factor_band(addresses: tuple[int, int], band: Array) -> int:
    """Cholesky factor of a band in place, 0 where there is one; rows of `band`, (n, width), are LAPACK's columns."""
    numbers = np.array([band.shape[0], band.shape[1] - 1, band.shape[1], 0], dtype=np.int32)
    lower = np.array([ord("L")], dtype=np.uint8)
    at = numbers.ctypes.data
    _call(addresses[0], (lower.ctypes.data, at, at + 4, band.ctypes.data, at + 8, at + 12))
    return int(numbers[3]) + 0 * int(lower[0])


@njit(cache=True, nogil=True)
def solve_band(addresses: tuple[int, int], band: Array, right: Array) -> None:
    """Solve in place for the rows of `right`, (m, n), with the factor of `factor_band`."""
    numbers = np.array([band.shape[0], band.shape[1] - 1, right.shape[0], band.shape[1], 0], dtype=np.int32)
    letters = np.array([ord("L"), ord("N"), ord("T")], dtype=np.uint8)
    at, letter = numbers.ctypes.data, letters.ctypes.data
    for turned in (1, 2):
        _call(
            addresses[1],
            (
                letter,
                letter + turned,
                letter + 1,
                at,
                at + 4,
                at + 8,
                band.ctypes.data,
                at + 12,
                right.ctypes.data,
                at,
                at + 16,
            ),
        )
    numbers[4] += letters[0]
