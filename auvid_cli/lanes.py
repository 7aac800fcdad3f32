"""How the compiled core lays out many states at once.

A block is a flat vector of rows, one row per quantity and `LANES` states to a row, so that one
instruction works on several states. Vehicle dynamics and filters share this layout and nothing else.
"""

LANES = 64
