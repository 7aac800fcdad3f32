"""Make the pictures of the how-to pages: `python -m docs.make_figures`. Takes three minutes of processor time."""

import shlex
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

_DOCS = Path(__file__).parent
IMAGES = _DOCS / "images"
_COMMANDS = (
    "run",
    "inspect results/spiral/dataset.h5 --use 0:100 -o results/inspection",
    "identifiability results/spiral/dataset.h5 --use 20:80 -o results/part",
    "simulate --set manoeuvre=manoeuvres/zigzag_20_20.yaml --seed 2 --output results/zigzag",
    "validate results/spiral/estimates/ckf.h5 results/zigzag/dataset.h5",
    "design lauv --set manoeuvre.excitation.roll_moment=null --duration '120 s' --generations 12 --draws 4",
    "identifiability lauv --set manoeuvre=mission/manoeuvre.yaml -o results/designed",
    "campaign noise.yaml --set seeds=12 --set settings.identification.judge=false",
)
# Picture in docs/images, and the figure that it is a copy of.
_PICTURES = {
    "estimates.png": "results/spiral/figures/estimates.png",
    "innovations.png": "results/spiral/figures/innovations.png",
    "convergence.png": "results/spiral/figures/convergence.png",
    "motion_errors.png": "results/spiral/figures/motion_errors.png",
    "free_runs.png": "results/spiral/figures/free_runs.png",
    "path.png": "results/spiral/figures/path.png",
    "inspection.png": "results/inspection/figures/timeline.png",
    "identifiability.png": "results/part/figures/identifiability_bounds.png",
    "identifiability_correlation.png": "results/part/figures/identifiability_correlation.png",
    "validation.png": "results/zigzag/figures/validation_horizons.png",
    "validation_velocities.png": "results/zigzag/figures/validation_velocities.png",
    "mission.png": "mission/figures/mission.png",
    "designed.png": "results/designed/figures/identifiability_bounds.png",
    "spread.png": "results/campaigns/noise/figures/spread.png",
    "map.png": "results/campaigns/noise/figures/map.png",
}


def run_all(commands: Iterable[str], folder: Path) -> None:
    """Run commands of auvid in a folder."""
    for command in commands:
        words = [sys.executable, "-m", "auvid_cli", *shlex.split(command)]
        # 1: a verdict, such as that of a validation.
        if subprocess.run(words, cwd=folder, check=False).returncode not in (0, 1):
            raise SystemExit(f"auvid {command}: failed")


def save(picture: Image.Image, target: Path) -> None:
    """Save a picture with 64 colours, which takes a third of the space."""
    # Without iterations of k-means, the colours of thin lines become grey.
    picture.convert("RGB").quantize(64, kmeans=3).save(target, optimize=True)


def main() -> None:
    """Run the commands of the pages in an empty folder, and copy their figures."""
    campaigns = (_DOCS / "how-to/campaigns.md").read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        noise = campaigns.partition("```yaml\n")[2].partition("```")[0]
        (Path(folder) / "noise.yaml").write_text(noise, encoding="utf-8")
        run_all(_COMMANDS, Path(folder))
        for name, figure in _PICTURES.items():
            with Image.open(Path(folder) / figure) as picture:
                save(picture, IMAGES / name)


if __name__ == "__main__":
    main()
