"""First module that the fork server of the figure workers loads: it ends with its command, and lets others go first."""

import gc
import os

from auvid_cli.child_processes import end_with_parent

end_with_parent()
if hasattr(os, "nice"):
    # The compiler and the filters are needed before the figures.
    os.nice(10)
# Modules stay loaded: looking for garbage among them is wasted time.
gc.set_threshold(50_000)
