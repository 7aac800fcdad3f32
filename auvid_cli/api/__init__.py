"""Python interface: each step of the work as a function, without a terminal, and without files unless asked.

`auvid_cli` itself offers the names of these modules, and loads each when one of its names is first used.
"""
