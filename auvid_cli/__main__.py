"""The command line: `auvid`, or `python -m auvid_cli`."""

import gc
import sys

from auvid_cli.cli.exit_codes import INTERRUPTED


def main() -> None:
    """Run the command line."""
    try:
        # Here, because loading the commands takes a moment in which one may be interrupted as well.
        from auvid_cli.cli.app import app

        app()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    finally:
        # Going through all that lives once more before the process ends would take half a second.
        gc.freeze()


if __name__ == "__main__":
    main()
