"""Write the screen samples of the pages from what the commands print: `python -m docs.make_screens`.

Takes two and a half minutes of processor time. `--slow` also fits the log of the tutorial, which takes five more. Names
of pages, such as `how-to/compare`, choose their samples only.
"""

import argparse
import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from docs.make_field import settings
from docs.section import replace_section

_WIDTH = 80  # columns
_SPIRAL = "results/spiral/dataset.h5"
_CKF = f"identify {_SPIRAL} --filter ckf --set identification.judge=false"
_SIMULATE = "simulate --set manoeuvre=manoeuvres/zigzag_20_20.yaml --seed 2 --output results/zigzag"
_ZIGZAG = "validate results/spiral/estimates/ckf.h5 results/zigzag/dataset.h5"
_SURVEY = "results/survey/dataset.h5"
_FIT = f"fit {_SURVEY} --use 0:320"
_TEST = f"validate results/survey/estimates/smoother.h5 {_SURVEY} --use 321:"
_SEEN = f"{_SURVEY} --use 0:320 --set lateral.yaml"
_BY_HAND = f"validate results/by_hand/estimates/smoother.h5 {_SURVEY} --use 321: -o results/by_hand"
_IMPORT = "simulate field --as-log -o field", "import --map field/map.yaml"
_SUGGEST = (
    "import --suggest field/compass.csv field/depth.csv field/dvl.csv field/fins.csv --vehicle field/vehicle.yaml"
)
_INIT = "init mine --length '2 m' --diameter '20 cm' --mass '60 kg' --fin-span '10 cm' --fin-area '120 cm^2'"
_BIASED = (
    "run --set sensors=sensors/table_iii_bias.yaml --set 'identification.estimate.biases=[gyro, attitude]'"
    " -o results/biased"
)
_TERMS = "terms results/lacking/dataset.h5 --set 'vehicle.terms=[]'"
# A term is simulated that the model lacks.
_LACKING = (
    "simulate --set manoeuvre=manoeuvres/multisine.yaml --set 'manoeuvre.duration=90 s'"
    " --set 'manoeuvre.initial_speed=3.9 m/s' --set 'sensors.gyroscope={rate: 20 Hz, noise: 0.1 deg/s}'"
    " --set 'sensors.attitude={source: direct, rate: 10 Hz, noise: 0.1 deg}'"
    " --set 'sensors.dvl={rate: 5 Hz, noise: 0.5 cm/s}' --set identification.prior.factor=3"
    """ --set 'vehicle.terms=[{name: N_|v|r, row: N, factors: ["|v|", r], value: -120 kg*m/rad}]' -o results/lacking"""
)
_WITHOUT_TRIM = (
    "run --filter smoother --set 'manoeuvre.duration=100 s' --set 'manoeuvre.fin_trim={rudder: 1 deg}'"
    " -o results/no_trim"
)
_TRIM = f"{_WITHOUT_TRIM.replace('no_trim', 'trim')} --set 'identification.estimate.biases=[fin_trim]'"
_NOT_ROBUST = (
    "run --filter smoother --set 'manoeuvre.duration=60 s' --set sensors.dvl.outlier_probability=0.01"
    " --set 'sensors.dvl.outlier_size=20 cm/s' -o results/not_robust"
)
_ROBUST = f"{_NOT_ROBUST.replace('not_robust', 'robust')} --set identification.robust=huber"
_COMPARE = "compare results/biased results/spiral"
_FILE = "cat mine/vehicle.yaml"
# Commands that must run before another one.
_BEFORE = {
    _COMPARE: ("run", _BIASED),
    _FILE: (_INIT,),
    _SUGGEST: _IMPORT[:1],
    _IMPORT[1]: _IMPORT[:1],
    _ZIGZAG: ("run", _SIMULATE),
    _TERMS: (_LACKING,),
    _FIT: _IMPORT,
    _TEST: (_FIT,),
    _BY_HAND: (
        *_IMPORT,
        f"tune {_SEEN} -o results/by_hand",
        f"identify {_SEEN} --set results/by_hand/tuned.yaml -o results/by_hand",
    ),
}
_VERDICTS = "filter +average error"


class Screen(NamedTuple):
    """A sample: its page, its name there, the command, and an expression for each part that is kept."""

    page: str
    name: str
    command: str
    kept: tuple[str, ...]

    @property
    def is_slow(self) -> bool:
        """Whether the command takes minutes."""
        return self.command in (_FIT, _TEST, _BY_HAND)


SCREENS = (
    Screen("quick-start", "verdicts", "run", (_VERDICTS, "EKF", "CKF", "TUKF", "smoother")),
    Screen("explanation/verdicts", "sound", "run", (_VERDICTS, "CKF")),
    Screen("paper", "RMSE", "run", ("coefficient", r"X_u\|u\|", r"Y_v\|v\|", "below paper")),
    Screen("paper", "steady state", "run", ("average +[0-9.]+ +6.064", "below paper")),
    Screen(
        "how-to/identifiability",
        "bounds",
        f"identifiability {_SPIRAL} --use 20:80 -o results/part",
        ("symbol", r"X_u\|u\|", "N_uudr", r"Y_r\|r\|", r"M_w\|w\|", "median bound"),
    ),
    Screen(
        "how-to/inspect",
        "inspection",
        f"inspect {_SPIRAL} --use 0:100 -o results/inspection",
        ("data: ", "no check fails", "next: "),
    ),
    Screen(
        "how-to/tune-noise",
        "noise",
        f"tune {_SPIRAL} --use 0:60 -o results/tuned",
        ("noise", "process_noise.velocity", "process_noise.rate", "process_noise.attitude", "log-like", "next: "),
    ),
    Screen(
        "how-to/choose-filter",
        "two estimators",
        f"identify {_SPIRAL} --filter smoother --filter ckf",
        ("symbol", r"X_u\|u\|", "N_uudr", "Smoother, CKF", "next: "),
    ),
    Screen(
        "how-to/imperfect-data",
        "segments",
        f"identify {_SPIRAL} --use 0:60 --use 65:110 --filter smoother -o results/two_segments",
        ("symbol", r"X_u\|u\|", "N_uudr", "Smoother", "next: "),
    ),
    Screen("how-to/imperfect-data", "not robust", _NOT_ROBUST, (_VERDICTS, "smoother")),
    Screen("how-to/imperfect-data", "robust", _ROBUST, (_VERDICTS, "smoother", "smoother: weighted")),
    Screen("how-to/disturbances", "without trim", _WITHOUT_TRIM, (_VERDICTS, "smoother")),
    Screen(
        "how-to/disturbances",
        "trim",
        _TRIM,
        ("Errors of", "error", "rudder_trim", "elevator_trim", _VERDICTS, "smoother"),
    ),
    Screen(
        "how-to/experiment",
        "simulation",
        _SIMULATE,
        ("results/", "next: "),
    ),
    Screen(
        "how-to/export",
        "export",
        "export results/spiral/estimates/tukf.h5 --to python",
        ("No term", "The covariances", "results/"),
    ),
    Screen(
        "explanation/verdicts",
        "doubtful",
        "run --filter smoother --set 'manoeuvre.duration=30 s' --set 'sensors.gyroscope.bias=0.06 deg/s' -o results/d",
        (r"Smoother doubtful(?s:.*?)\)\.",),
    ),
    Screen(
        "explanation/verdicts",
        "inconsistent",
        f"{_CKF} --set 'vehicle.parameters.Ixx=4 kg*m^2' --set 'vehicle.parameters.zG=3 cm' -o results/i",
        ("CKF inconsistent",),
    ),
    Screen(
        "explanation/verdicts",
        "diverged",
        f"{_CKF} --set identification.prior.factor=300 -o results/p",
        ("CKF diverged",),
    ),
    Screen("explanation/verdicts", "unjudged", f"{_CKF} -o results/u", ("CKF unjudged",)),
    Screen(
        "how-to/own-vehicle",
        "first folder",
        _INIT,
        (" buoyancy", " inertia about x", " inertia about y", " spiral: speed", " spiral: largest", "mine: ", "next: "),
    ),
    Screen(
        "how-to/sensor-errors",
        "biased run",
        _BIASED,
        ("Errors of", "error", "bias_p", "bias_psi", _VERDICTS, "EKF", "CKF", "TUKF", "smoother", "smoother: "),
    ),
    Screen(
        "how-to/compare",
        "differences",
        _COMPARE,
        (
            "first: ",
            "row",
            "(?=.)",
            "(?=.)",
            "and ",
            r"coefficients.csv(?s:.*?)(?=\nsummary)",
            "velocity",
            "[0-9]+ of",
        ),
    ),
    Screen(
        "how-to/vehicle-from-drawing",
        "file",
        _FILE,
        (" +Iyy", r" +X_u\|u\|", r" +M_w\|w\|", " +Y_uudr"),
    ),
    Screen(
        "how-to/import-logs",
        "map",
        _SUGGEST,
        ("sensors:", "  dvl:", "    zeros", "  attitude:", "      psi", "    standard"),
    ),
    Screen(
        "how-to/import-logs", "import", _IMPORT[1], (" +rate Hz", "dvl", "attitude", "fins.top", "dvl: 220", "next: ")
    ),
    Screen("how-to/own-terms", "search", _TERMS, ("step", r"1 +N_\|v\|r", r"1 +N_\|r\|v", "1 +N_r ", "Found: ")),
    Screen("quick-start", "prediction", _ZIGZAG, ("Yaw rate in turns", "Sway in turns", "The model of")),
    Screen("own-log", "step", _FIT, ("look 1, candidate 2", "look 1: kept")),
    Screen(
        "own-log", "fit", _FIT, ("symbol", "N_url", "Prediction", "Judgement", "Added", "scale", "current:", "Held")
    ),
    Screen(
        "how-to/fit",
        "fit",
        _FIT,
        (
            "look 1, candidate 2",
            "look 1: kept",
            "symbol",
            "N_url",
            "Prediction",
            "Judgement",
            "Added",
            "trim",
            "Held",
            "next: ",
        ),
    ),
    Screen("how-to/survey-logs", "fit", _FIT, ("symbol", "N_url", "Prediction", "Added", "current", "trim", "Held")),
    Screen(
        "how-to/survey-logs",
        "test",
        _TEST,
        ("Yaw rate in turns", "Sway in turns", r"Yaw rate on straight(?s:.*?)\.$"),
    ),
    Screen("own-log", "test", _TEST, ("Yaw rate in turns", "Sway in turns")),
    Screen("own-log", "by hand", _BY_HAND, ("Yaw rate in turns", "Sway in turns")),
    Screen(
        "how-to/validate",
        "first lines",
        _BY_HAND,
        ("Yaw rate in turns", "Sway in turns", r"Yaw rate on straight(?s:.*?)\.$"),
    ),
)


def sample(printed: str, kept: tuple[str, ...]) -> str:
    """Return the lines of each match, searched from the one before on; `...` stands for lines that are left out."""
    lines = [line.rstrip() for line in printed.splitlines()]
    text = "\n".join(lines)
    shown: list[str] = []
    begin = 0  # line
    for expression in kept:
        match = re.compile(f"^ ?(?:{expression})", re.MULTILINE).search(text, sum(len(x) + 1 for x in lines[:begin]))
        if match is None:
            raise LookupError(f"{expression!r} is not in the rest of:\n{printed}")
        first, last = (text.count("\n", 0, place) for place in match.span())
        if last + 1 < len(lines) and set(lines[last + 1].strip()) == {"─"}:
            last += 1  # the rule below a heading
        if shown and any(lines[begin:first]):
            shown.append(" ..." if lines[first].startswith(" ") else "...")
        elif shown and begin < first:
            shown.append("")
        for line in lines[first : last + 1]:
            shown += (
                [line]
                if len(line) <= _WIDTH or line.startswith("next: ")
                else textwrap.wrap(line, _WIDTH, break_on_hyphens=False)
            )
        begin = last + 1
    return "\n".join(shown)


def printed_by(command: str, folder: Path, done: dict[str, str]) -> str:
    """Return what a command prints, after the commands that it needs; each runs once."""
    for needed in _BEFORE.get(command, ("run",) if _SPIRAL.rpartition("/")[0] in command else ()):
        printed_by(needed, folder, done)
    if command.startswith("cat "):
        return (folder / command.removeprefix("cat ")).read_text(encoding="utf-8")
    if command not in done:
        words = [sys.executable, "-m", "auvid_cli", *shlex.split(command)]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
        result = subprocess.run(words, cwd=folder, check=False, **streams)
        if result.returncode not in (0, 1):  # 1: a verdict
            raise SystemExit(f"auvid {command}: failed\n{result.stdout}")
        done[command] = result.stdout
    return done[command]


def main() -> None:
    """Write the samples into their pages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", help="pages whose samples are written (default: all)")
    parser.add_argument("--slow", action="store_true", help="also the samples that take minutes")
    options = parser.parse_args()
    done: dict[str, str] = {}
    with TemporaryDirectory() as name:
        (Path(name) / "lateral.yaml").write_text(settings()[0], encoding="utf-8")
        for screen in SCREENS:
            is_chosen = not options.pages or screen.page in options.pages
            if is_chosen and (options.slow or not screen.is_slow):
                shown = sample(printed_by(screen.command, Path(name), done), screen.kept)
                replace_section(screen.name, f"```text\n{shown}\n```", screen.page)


if __name__ == "__main__":
    main()
