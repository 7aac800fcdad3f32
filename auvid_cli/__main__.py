"""The command line: `auvid`, or `python -m auvid_cli`."""

import gc
import os
import sys

from auvid_cli.cli import INTERRUPTED, WRONG_INPUT, finish, prepare_streams, print_os_error

# Use one thread for linear algebra, because filters and figures already run in parallel: this saves a tenth of the
# processor time. NumPy reads these variables when it is loaded, and child processes inherit them.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Collect garbage less often: the loaded modules contain none, and searching them took a tenth of the time.
gc.set_threshold(50_000)


def main() -> None:
    """Run the command line."""
    # Switch threads often, so that a filter in Python does not keep compiled filters waiting for data.
    sys.setswitchinterval(1e-3)
    prepare_streams()
    code: int | str | None
    try:
        # Import inside `try`, because the user may interrupt it.
        from auvid_cli.cli.app import app

        code = app()
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        code = INTERRUPTED
    except OSError as error:
        # Raised outside of a command, for example while the help is printed.
        print_os_error(error)
        code = WRONG_INPUT
    finally:
        # Without this the last garbage collection takes half a second.
        gc.freeze()
    sys.exit(finish(code))


if __name__ == "__main__":
    main()
