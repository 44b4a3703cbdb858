"""Workers on other machines: an executor on a Dask cluster.

The workers need this package, and the data folder under the same path. Tasks may be
done twice without harm, so that what a lost worker had in hand is done again by
another.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from concurrent.futures import Executor

from sidm.config import first_line

WAIT = "10s"  # for the scheduler to answer
LOSSES = 10  # workers that may be lost with a task in hand before it is given up


@contextlib.contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """An executor on the cluster whose scheduler is at `address`, 'tcp://HOST:PORT' or the path of a scheduler file.

    Raises:
        ImportError: Dask is not installed; one line.
        OSError: no scheduler answers there; one line.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ImportError(
            "a Dask cluster needs the package distributed: pip install distributed"
        ) from None
    where = (
        {"scheduler_file": address} if os.path.exists(address) else {"address": address}
    )
    try:
        client = Client(**where, timeout=WAIT)
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        raise OSError(
            f"{address}: no Dask scheduler answers there ({first_line(error)})"
        ) from None
    with client:
        yield client.get_executor(pure=False, retries=LOSSES)
