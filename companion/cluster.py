"""Workers on other machines: an executor on a Dask cluster.

The workers need this package, and the data folder under the same path. A task may be
done twice without harm, so another worker repeats the task of a lost one.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from concurrent.futures import Executor

from sidm.config import first_line

TIMEOUT = "10s"  # for the scheduler to answer
RETRIES = 10  # times that a task is repeated because its worker was lost


@contextlib.contextmanager
def executor_at(address: str | None) -> Iterator[Executor | None]:
    """An executor on a Dask cluster, closed at the end of the block; None for None.

    The address is that of the cluster's scheduler, 'tcp://HOST:PORT', or the path of a
    scheduler file. Without Dask it raises ImportError, where no scheduler answers
    OSError, each of one line.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise ImportError(
            "a Dask cluster needs the package distributed: pip install distributed"
        ) from None
    parameter = "scheduler_file" if os.path.exists(address) else "address"
    try:
        client = Client(**{parameter: address}, timeout=TIMEOUT)
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        raise OSError(
            f"{address}: no Dask scheduler answers there ({first_line(error)})"
        ) from None
    with client:
        yield client.get_executor(pure=False, retries=RETRIES)
