"""Make the pictures of the how-to pages: `python -m docs.make_figures`. Takes two minutes of processor time."""

import shlex
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

_IMAGES = Path(__file__).with_name("images")
_COMMANDS = (
    "run",
    "inspect results/spiral/dataset.h5 --use 0:100 -o results/inspection",
    "identifiability results/spiral/dataset.h5 --use 20:80 -o results/part",
    "simulate --set manoeuvre=manoeuvres/zigzag_20_20.yaml --seed 2 --output results/zigzag",
    "validate results/spiral/estimates/ckf.h5 results/zigzag/dataset.h5",
    "design lauv --set manoeuvre.excitation.roll_moment=null --duration '120 s' --generations 12 --draws 4",
)
# Picture in docs/images, and the figure that it is a copy of.
_PICTURES = {
    "estimates.png": "results/spiral/figures/estimates.png",
    "innovations.png": "results/spiral/figures/innovations.png",
    "free_runs.png": "results/spiral/figures/free_runs.png",
    "path.png": "results/spiral/figures/path.png",
    "inspection.png": "results/inspection/figures/timeline.png",
    "identifiability.png": "results/part/figures/identifiability_bounds.png",
    "identifiability_correlation.png": "results/part/figures/identifiability_correlation.png",
    "validation.png": "results/zigzag/figures/validation_horizons.png",
    "validation_velocities.png": "results/zigzag/figures/validation_velocities.png",
    "mission.png": "mission/figures/mission.png",
}


def main() -> None:
    """Run the commands of the pages in an empty folder, and copy their figures."""
    with TemporaryDirectory() as folder:
        for command in _COMMANDS:
            words = [sys.executable, "-m", "auvid_cli", *shlex.split(command)]
            # 1: the verdict of a validation.
            if subprocess.run(words, cwd=folder, check=False).returncode not in (0, 1):
                raise SystemExit(f"auvid {command}: failed")
        for name, figure in _PICTURES.items():
            _copy(Path(folder) / figure, _IMAGES / name)


def _copy(figure: Path, target: Path) -> None:
    """Copy a figure with 64 colours, which takes a third of the space."""
    with Image.open(figure) as picture:
        picture.convert("RGB").quantize(64).save(target, optimize=True)


if __name__ == "__main__":
    main()
