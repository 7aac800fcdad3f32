"""Results of a finished campaign, damaged before the campaign is asked for again."""

import random
import shutil
from pathlib import Path

from benchmarks.attack import odd_files
from benchmarks.attack.cases import Case
from benchmarks.attack.hdf5_bytes import damage
from benchmarks.attack.material import Material
from benchmarks.attack.running import perform

_CAMPAIGN = """\
name: finished
experiment: spiral
settings: {manoeuvre.duration: 2 s}
seeds: 2
filters: [ckf, tukf]
"""
_COMMAND = "campaign", "finished.yaml", "-o", "out", "--workers", "1"
_LONGEST = 120.0
_FAILURES = (
    b"\xff\xfe\x00",
    b"run,reason\n",
    b'run\n"',
    b"\n" * 10,
    b"a,b\n1,2,3\n",
    b"run,filter,seed,reason\nx,\xff,1,y\n",
)


def _finished(material: Material, folder: Path) -> Path:
    """Return a campaign that has been done, made by whoever needs it first."""
    sound = material.folder / "campaign"
    if not sound.is_dir():
        made = folder.with_name("made")
        made.mkdir()
        (made / "finished.yaml").write_text(_CAMPAIGN)
        perform(_COMMAND, made, _LONGEST)
        try:
            made.rename(sound)
        except OSError:
            shutil.rmtree(made)
    return sound


def make(rng: random.Random, material: Material, folder: Path) -> Case:
    """Make a case."""
    shutil.copytree(_finished(material, folder), folder, dirs_exist_ok=True)
    parts = sorted((folder / "out" / "results").glob("*.parquet"))
    kind = rng.choice(("damage", "damage", "failures", "odd", "foreign", "gone"))
    path = rng.choice(parts)
    if kind == "damage":
        content = path.read_bytes()
        changed, what = damage(rng, content)
        path.write_bytes(changed)
    elif kind == "failures":
        what = "failures.csv"
        (folder / "out" / what).write_bytes(rng.choice(_FAILURES))
    elif kind == "odd":
        what = odd_files.put(rng, path)
    elif kind == "foreign":
        what = "a part of something else"
        path.with_name("other.parquet").write_bytes(rng.choice((b"PAR1PAR1", b"", b"PAR1" + bytes(100) + b"PAR1")))
    else:
        what = "parts gone"
        shutil.rmtree(path.parent)
    return Case(f"{kind}: {what}", (_COMMAND,), rewritten=True)
