"""What `import auvid_cli` offers: each step of the work as a function, without a terminal, without files unless asked.

`auvid_cli` itself hands on the names of these modules, and loads each only when one of its names is asked for.
"""
