"""Loaded into the server of figure processes before all else, which takes seconds to load: it ends with its command."""

from auvid_cli.children import end_with_parent

end_with_parent()
