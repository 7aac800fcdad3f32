"""How the compiled core lays out many states at once, and how it is compiled.

A block is a flat vector of rows, one row per quantity and `LANES` states to a row, so that one
instruction works on several states. Vehicle dynamics and filters share this layout and nothing else.
"""

LANES = 64

# Only contraction to fused multiply-add: reassociation would cancel range reductions. `nogil` lets
# filters run side by side in threads, `cache` spares every later session the compilation.
JIT = {"cache": True, "fastmath": {"contract"}, "error_model": "numpy", "nogil": True}

# Sums of products may be reordered, which vectorises them.
JIT_LINEAR_ALGEBRA = {**JIT, "fastmath": {"contract", "reassoc"}}
