"""The examples, each run once: the tests look at what they print, the gallery of the documentation shows it.

`outputs("03_identify_one_record")` gives the folder build/examples/03_... with the pictures the example drew and what
it printed (printed.txt). It is run when nothing is there, or when anything that it was made from has changed since: the
script, the packages, the versions of what they stand on.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import platform
import re
import runpy
import shutil
import sys
import time
import warnings
from importlib.metadata import version
from pathlib import Path

from docs.api import write_if_changed

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
BUILD = ROOT / "build" / "examples"
HERE = Path("generated") / "examples"  # among the pages
#: Example -> the picture and the axes in it that say most by themselves, for its card in the gallery.
HEROES = {
    "01_identify_then_design": ("bla", 0),
    "02_design_an_experiment": ("excitation", 1),
    "03_identify_one_record": ("bla", 3),
    "04_compare_grids": ("grids", 1),
    "05_levels_as_a_family": ("family", 1),
    "06_from_bla_to_weights": ("weights", 2),
    "07_shape_by_hand": ("by_hand", 1),
    "08_hinf_loop_shaping": ("hinf", 0),
    "09_pid_from_the_frf": ("pid", 3),
    "10_check_and_certificate": ("check", 2),
    "11_skogestad_postlethwaite": ("book", 3),
    "12_matlab_and_back": ("loop", 0),
    "13_motor_bench": ("motor", 1),
    "15_several_uncertainties": ("several", 0),
    "16_two_axis_stage": ("stage", 2),
    "17_measured_mirror": ("verdict", 0),
    "18_proof_with_friction": ("proof", 1),
    "20_tune_a_cascade": ("tuned", 0),
}
STORED = ROOT / "docs" / "_static"  # what examples gave whose data may not be there
#: Where the records of an example are found that does not come with them.
WHERE = {
    "13_motor_bench": "KU Leuven publishes them with the MATLAB toolbox FdiTools, as `MultisineTypeB.mat`; put that "
    "into a folder `motor_bench`",
    "17_measured_mirror": "They are in the repository `fsm-benchmark-data` of M. Floren on GitHub; put the four files "
    "`u_300mV_train.npy`, `y_300mV_train.npy` and the like into a folder `fine_steering_mirror`",
}
STANDS_ON = ("numpy", "scipy", "control", "cvxpy", "clarabel", "matplotlib", "numba", "h5py", "jinja2")


def names() -> list[str]:
    """The examples in order, by the stems of their files."""
    return sorted(path.stem for path in EXAMPLES.glob("[0-9]*.py"))


def title_and_text(name: str) -> tuple[str, str]:
    """First line of an example's docstring, and the rest."""
    docstring = re.match(r'"""(.*?)"""', (EXAMPLES / f"{name}.py").read_text(encoding="utf-8"), re.DOTALL)
    assert docstring is not None, f"{name} has no docstring"
    title, _, text = docstring.group(1).partition("\n")
    return title.strip().rstrip("."), text.strip()


def data_folder() -> Path:
    """Where measured records are looked for."""
    return Path(os.environ.get("NLFRF_DATA", ROOT.parent / "shared" / "data"))


def made_from(name: str) -> str:
    """A digest of everything that the output of an example depends on."""
    digest = hashlib.sha256()
    rooms = [path for package in ("nlfrf", "robust") for path in sorted((ROOT / package).rglob("*.*"))]
    for path in [
        EXAMPLES / f"{name}.py",
        *(path for path in rooms if path.suffix in (".py", ".json", ".jinja", ".js")),
    ]:
        digest.update(path.read_bytes())
    digest.update(str(HEROES.get(name)).encode())
    installed = [f"{package} {version(package)}" for package in STANDS_ON]
    found = [str(data_folder().is_dir()), str(shutil.which("octave") is not None)]
    digest.update(" ".join([platform.python_version(), *installed, *found]).encode())
    return digest.hexdigest()


def outputs(name: str) -> Path:
    """The folder with what an example drew and printed; runs it where that is not up to date."""
    folder, stamp = BUILD / name, BUILD / f"{name}.stamp"
    BUILD.mkdir(parents=True, exist_ok=True)
    with only_one(BUILD / f"{name}.lock"):
        wanted = made_from(name)
        if not (stamp.is_file() and stamp.read_text() == wanted):
            stamp.unlink(missing_ok=True)
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            (folder / "printed.txt").write_text(run(name), encoding="utf-8")
            stamp.write_text(wanted)
    return folder


@contextlib.contextmanager
def only_one(lock: Path):
    """Hold a lock file, so that two processes do not run the same example; waits where files can be locked."""
    with lock.open("w") as file:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def run(name: str, *arguments: str) -> str:
    """Run an example as a user would, but in this process, warnings as errors; what it printed."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    folder, argv, printed = Path.cwd(), sys.argv, io.StringIO()
    card = contextlib.nullcontext() if arguments else hero_kept(name)  # a run of its own kind leaves the card as it is
    os.chdir(BUILD)
    sys.argv = [f"{name}.py", *(arguments or ("--out", name))]
    try:
        with contextlib.redirect_stdout(printed), warnings.catch_warnings(), card:
            warnings.simplefilter("error")
            # what python-control is told by a newer NumPy
            warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"control\.")
            try:
                runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
            except SystemExit as stop:
                if stop.code:
                    raise RuntimeError(f"{name} ended with {stop.code!r}") from stop
    finally:
        os.chdir(folder)
        sys.argv = argv
        plt.close("all")
    return printed.getvalue()


@contextlib.contextmanager
def hero_kept(name: str):
    """While an example runs, keep the one axes that stands on its card, beside its folder: NAME.hero.png."""
    from matplotlib.figure import Figure

    whole, (picture, which) = Figure.savefig, HEROES.get(name, ("", 0))

    def savefig(figure: Figure, target, *args, **kwargs):
        whole(figure, target, *args, **kwargs)
        stem = Path(str(target)).stem
        if figure.axes and (stem == picture or (not picture and not (BUILD / f"{name}.hero.png").exists())):
            figure.set_layout_engine("none")  # it is laid out
            ax = figure.axes[min(which, len(figure.axes) - 1)]
            box = ax.get_tightbbox(figure.canvas.get_renderer()).transformed(figure.dpi_scale_trans.inverted())
            whole(figure, BUILD / f"{name}.hero.png", dpi=110, bbox_inches=box.padded(0.05))

    (BUILD / f"{name}.hero.png").unlink(missing_ok=True)
    Figure.savefig = savefig
    try:
        yield
    finally:
        Figure.savefig = whole


def shown_folder(name: str) -> tuple[Path, str]:
    """The folder that the gallery shows; and, where an example was skipped for want of its data, why a stored one."""
    made, stored = outputs(name), STORED / name
    if not (stored.is_dir() and (made / "printed.txt").read_text(encoding="utf-8").startswith("skipped")):
        return made, ""
    return stored, (
        "The records are not part of this project, and were not there when this page was built: below stands what the "
        f"example drew and printed where they were. {WHERE[name]} and give the folder above it by `--data` or in "
        "`NLFRF_DATA`."
    )


def write_pages(folder: Path) -> None:
    """A page for every example, with what it printed and drew, and an index with a picture of each."""
    index = [
        "# Examples",
        "",
        "Each is a script of at most a hundred lines in the folder `examples` that reads as a manual. What it drew and",
        "printed stands above its code, as it ran when this page was built.",
        "",
        '<div class="gallery">',
    ]
    for name in names():
        title, text = title_and_text(name)
        made, words = shown_folder(name)
        shown = sorted(made.glob("*.png"))
        for picture in shown:
            target = folder / f"{name}_{picture.name}"
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(picture, target)
        hero = BUILD / f"{name}.hero.png"
        first = f'<img src="heroes/{name}.png" alt="">' if hero.is_file() else ""
        if hero.is_file():
            (ROOT / "docs" / "generated" / "extra" / HERE / "heroes").mkdir(parents=True, exist_ok=True)
            shutil.copyfile(hero, ROOT / "docs" / "generated" / "extra" / HERE / "heroes" / f"{name}.png")
        index.append(f'<a href="{name}.html">{first}<span>{name[:2]}. {title}</span></a>')
        paragraphs = [
            f"```sh\n{part}\n```" if part.startswith("python ") else part for part in re.split(r"\n\s*\n", text)
        ]
        page = [
            f"# {name[:2]}. {title}",
            "",
            "\n\n".join(paragraphs),
            "",
            f"```sh\npython examples/{name}.py\n```",
            "",
            words,
            "",
            *(f":::{{figure}} {name}_{picture.name}\n:alt: {picture.stem} of this example\n:::\n" for picture in shown),
            "## What it prints",
            "",
            "```text",
            (made / "printed.txt").read_text(encoding="utf-8").rstrip(),
            "```",
            "",
            "## The script",
            "",
            f"```{{literalinclude}} ../../../examples/{name}.py\n:language: python\n```",
            "",
        ]
        write_if_changed(folder / f"{name}.md", "\n".join(page))
    listed = "\n".join(names())
    index += ["</div>", "", f"```{{toctree}}\n:hidden:\n\n{listed}\n```", ""]
    write_if_changed(folder / "index.md", "\n".join(index))


if __name__ == "__main__":
    for one in names():
        begin = time.perf_counter()
        outputs(one)
        print(f"{one}: {time.perf_counter() - begin:.1f} s")
