"""Entry point of the command `labrig`."""

import atexit
import os
import signal
import sys

from labrig.foundation.readable_output import make_streams_readable
from labrig.foundation.signals import STOP_SIGNALS, end_at_once

# The matrices here are small: threads of the linear algebra would only wait for one another, six
# times as long where another program computes, too. Has to be said before numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def main() -> None:
    """Run the command line; every ending has its exit code and at most one line of error."""
    for signum in STOP_SIGNALS:
        signal.signal(signum, end_at_once)
    make_streams_readable()
    from labrig.cli import guarded

    code = guarded(sys.argv[1:])
    # Somebody waits for it: to delete all objects one by one may take seconds.
    atexit._run_exitfuncs()
    os._exit(code)


if __name__ == "__main__":
    main()
