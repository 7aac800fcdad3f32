"""The figures of a run, as PNG and SVG. Nothing here touches matplotlib's global state."""
