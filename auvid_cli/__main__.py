"""The command line: `auvid`, or `python -m auvid_cli`."""

import gc
import os
import sys

from auvid_cli.cli.streams import INTERRUPTED, WRONG_INPUT, finish, prepare_streams, print_os_error

# Before NumPy is loaded, here and in processes that this one starts: estimators and figures stand side by side already,
# and beside them threads of linear algebra turned idly between short products, for a tenth of the processor time.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

# Of the modules that a command loads nothing goes: to look for garbage there again and again took a tenth of its time.
gc.set_threshold(50_000)

if "__mp_main__" in sys.modules:
    # A worker process loads this program again first.
    from auvid_cli.child_processes import end_with_parent

    end_with_parent()


def main() -> None:
    """Run the command line."""
    # A filter in Python would keep those that are compiled waiting whenever they come for more data.
    sys.setswitchinterval(1e-3)
    prepare_streams()
    code: int | str | None
    try:
        # Here, because loading the commands takes a moment in which one may be interrupted as well.
        from auvid_cli.cli.app import app

        code = app()
    except SystemExit as end:
        code = end.code
    except KeyboardInterrupt:
        code = INTERRUPTED
    except OSError as error:
        # Of the help, for example: no command has begun that would say so itself.
        print_os_error(error)
        code = WRONG_INPUT
    finally:
        # Going through all that lives once more before the process ends would take half a second.
        gc.freeze()
    sys.exit(finish(code))


if __name__ == "__main__":
    main()
