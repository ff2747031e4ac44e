"""NetCDF files by netCDF4: NetCDF-4 written, NetCDF-3 and NetCDF-4 read, and a barred file told from a broken one.

A file is read whole and handed to the library as bytes. Opened by its name, a locked file and a broken one are the same
"HDF error", a file system without locks is an error, and what a NetCDF-3 file has lost at its end is read as zeros.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import xarray as xr

from fibrous.errors import DatasetError

ENGINE: Final = "netcdf4"  # of xarray, with netCDF4 behind it
NETCDF_3 = b"CDF"  # how the files begin
NETCDF_4 = b"\x89HDF\r\n\x1a\n"
MORE = 2**16  # bytes, enough to meet the end of a full disk


def save(dataset: xr.Dataset, path: Path, encoding: Mapping[str, Mapping[str, Any]]) -> None:
    """Write a NetCDF-4 file; `encoding` as in xarray. Raises OSError where the system lets no more be written."""
    try:
        dataset.to_netcdf(path, engine=ENGINE, encoding=encoding)
    except (OSError, RuntimeError) as error:
        # The library says "HDF error" whatever the reason is; the system says it to whoever goes on writing.
        with open(path, "ab") as stream:
            stream.write(bytes(MORE))
            os.fsync(stream.fileno())
        raise OSError(str(error)) from None


def content_of(path: Path, if_missing: str) -> bytes:
    """The bytes of a file that nobody is writing. Raises DatasetError, which says what bars the way and what to do.

    `if_missing` is what to do where there is no such file.
    """
    try:
        with open(path, "rb") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DatasetError(
                    f"{path}: locked, another process has it open for writing; close it there, then run again"
                ) from None
            except OSError:  # a file system without locks
                pass
            return stream.read()
    except FileNotFoundError:
        raise DatasetError(f"{path}: no such file; {if_missing}") from None
    except PermissionError:
        raise DatasetError(f"{path}: not yours to read; mend its permission or its folder's, then run again") from None
    except OSError as error:
        raise DatasetError(f"{path}: cannot be read ({error.strerror}); mend that, then run again") from None


@contextmanager
def opened(path: Path, if_missing: str, if_broken: str) -> Iterator[xr.Dataset]:
    """The dataset of a file, its arrays not yet decoded. What goes wrong while it is open counts as a broken file.

    Raises DatasetError: what bars the way as `content_of` says, or that the content is not NetCDF or not whole, with
    `if_broken` as what to do then.
    """
    content = content_of(path, if_missing)
    try:
        with xr.open_dataset(content, engine=ENGINE) as dataset:
            yield dataset
    except MemoryError:
        raise
    except Exception as error:  # of a damaged file the library lets pass whatever it stumbles over
        raise DatasetError(f"{path}: not a readable NetCDF file ({_fault(content, error)}); {if_broken}") from None


def _fault(content: bytes, error: Exception) -> str:
    if not content:
        return "it is empty"
    if not content.startswith((NETCDF_3, NETCDF_4)):
        return "it is something else"
    text = " ".join(str(getattr(error, "strerror", None) or error).split())[:100]
    if not isinstance(error, OSError | RuntimeError):
        return text
    # So the library says that the bytes of a NetCDF-3 file end too early.
    return "its end is missing" if text == "Operation not permitted" else f"cut off or damaged, {text}"
