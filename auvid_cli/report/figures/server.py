"""Loaded into the server of figure processes before all else, which takes seconds to load: it ends with its command."""

import gc

from auvid_cli.children import end_with_parent

end_with_parent()
# Nothing of what it loads goes.
gc.set_threshold(50_000)
