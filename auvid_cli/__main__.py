"""The command line: `auvid`, or `python -m auvid_cli`."""

import gc
import sys

# As a shell says it of a command that was interrupted.
INTERRUPTED = 130


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
