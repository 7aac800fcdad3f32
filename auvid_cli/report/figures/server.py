"""First module that the fork server of the figure workers loads: it ends with its command, and lets others go first."""

import gc
import os
from contextlib import suppress

from auvid_cli.child_processes import end_with_parent
from auvid_cli.report.figures.workers import load_matplotlib

end_with_parent()
if hasattr(os, "nice"):
    # The compiler and the filters are needed before the figures.
    os.nice(10)
# Modules stay loaded: looking for garbage among them is wasted time.
gc.set_threshold(50_000)
# Without memory, for example. The worker that draws tries again, and reports the error.
with suppress(Exception):
    load_matplotlib()
    from auvid_cli.report.figures import coefficients, motion, timeline, validation  # noqa: F401
