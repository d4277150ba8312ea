"""The examples, each run once by Sphinx-Gallery: a page shows what an example printed and drew, the
tests look at it.

`outputs("03_identify_one_record")` is the folder build/examples/03_... with what the example wrote;
`printed` is what it printed. An example is run when nothing is there, or when anything that it was
made from has changed since: the script, the packages, the versions of what they stand on.
Sphinx-Gallery itself looks at the script alone.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import platform
import re
import shutil
import textwrap
import time
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
BUILD = ROOT / "build" / "examples"
HERE = "generated/examples"  # among the pages
PAGES = ROOT / "docs" / HERE
THUMBNAIL = (520, 360)  # of a card [pixels]
CARD_INCHES = tuple(
    pixels / 120 for pixels in THUMBNAIL
)  # in which text of 10 points is a twentieth of the height
CARD_LETTERS = 48  # of its title in a row
#: Example -> which of its pictures, and which axes in it, stand on its card in the gallery; else
#: the first axes.
CARDS = {
    "01_identify_then_design": (0, 0),
    "02_design_an_experiment": (0, 1),
    "03_identify_one_record": (0, 3),
    "04_compare_grids": (0, 1),
    "05_levels_as_a_family": (0, 1),
    "06_from_bla_to_weights": (0, 2),
    "07_shape_by_hand": (0, 1),
    "08_hinf_loop_shaping": (0, 0),
    "09_pid_from_the_frf": (0, 3),
    "10_check_and_certificate": (0, 2),
    "11_skogestad_postlethwaite": (0, 3),
    "12_matlab_and_back": (0, 0),
    "13_motor_bench": (0, 1),
    "15_several_uncertainties": (0, 0),
    "16_two_axis_stage": (0, 2),
    "17_measured_mirror": (2, 0),
    "18_proof_with_friction": (0, 1),
    "20_tune_a_cascade": (0, 0),
    "22_family_of_matrix_plants": (0, 0),
    "23_learn_from_trial_to_trial": (0, 1),
    "24_schedule_over_position": (0, 0),
}
STORED = ROOT / "docs" / "_static"  # what examples gave whose records may not be there
#: Where the records of an example are found that does not come with them.
WHERE = {
    "13_motor_bench": (
        "KU Leuven publishes them with the MATLAB toolbox FdiTools, as ``MultisineTypeB.mat``; put"
        " that into a folder ``motor_bench``"
    ),
    "17_measured_mirror": (
        "They are in the repository ``fsm-benchmark-data`` of M. Floren on GitHub; put the four"
        " files ``u_300mV_train.npy``, ``y_300mV_train.npy`` and the like into a folder"
        " ``fine_steering_mirror``"
    ),
}
STANDS_ON = (
    "numpy",
    "scipy",
    "control",
    "cvxpy",
    "clarabel",
    "matplotlib",
    "numba",
    "h5py",
    "jinja2",
    "sphinx-gallery",
)
PRINTED = re.compile(
    r"\.\. rst-class:: sphx-glr-script-out\n\n \.\. code-block:: none\n\n((?: {4}.*\n|\n)+)"
)


def names() -> list[str]:
    """The examples in order, by the stems of their files."""
    return sorted(path.stem for path in EXAMPLES.glob("[0-9]*.py"))


def title_and_text(name: str) -> tuple[str, str]:
    """Title of an example, and the rest of its docstring."""
    docstring = re.match(
        r'"""\n(.*?)\n=+\n(.*?)"""',
        (EXAMPLES / f"{name}.py").read_text(encoding="utf-8"),
        re.DOTALL,
    )
    assert docstring is not None, f"{name} has no docstring with an underlined title"
    return docstring[1], docstring[2].strip()


def data_folder() -> Path:
    """Where measured records are looked for."""
    return Path(os.environ.get("NLFRF_DATA", ROOT.parent / "shared" / "data"))


def lacks_records(name: str) -> bool:
    """Whether an example needs records that are not there: it is not run then, and its page shows
    what it once gave.
    """
    folders = {"13_motor_bench": "motor_bench", "17_measured_mirror": "fine_steering_mirror"}
    return name in folders and not (data_folder() / folders[name]).is_dir()


def script_arguments(gallery_conf: dict[str, Any], script_vars: dict[str, Any]) -> list[str]:
    """The command line of an example, which runs in its own folder: its output goes to the build
    folder.
    """
    name = Path(script_vars["src_file"]).stem
    return [
        "--out",
        os.path.relpath(BUILD / name, EXAMPLES),
        *(("--data", str(data_folder())) if name in WHERE else ()),
    ]


def saved_pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Take the pictures that a block of an example saved, rather than draw them a second time."""
    from matplotlib import pyplot as plt
    from sphinx_gallery.scrapers import figure_rst

    name, shown = Path(block_vars["src_file"]).stem, block_vars.setdefault("shown", [])
    saved = sorted((BUILD / name).glob("*.png"), key=lambda path: path.stat().st_mtime_ns)
    new = [path for path in saved if path not in shown]
    picture, axes = CARDS.get(name, (0, 0))
    for path, number in zip(new, plt.get_fignums()[-len(new) :] if new else (), strict=False):
        if len(shown) + new.index(path) == picture:
            save_axes(plt.figure(number), axes, BUILD / f"{name}.card.png")
    shown += new
    targets = [next(block_vars["image_path_iterator"]) for _ in new]
    for path, target in zip(new, targets, strict=True):
        shutil.copyfile(path, target)
    return figure_rst(
        targets, gallery_conf["src_dir"], ", ".join(f"{path.stem} of this example" for path in new)
    )


def save_axes(figure: Any, which: int, path: Path) -> None:
    """Save one axes of a figure without its legend, in the size of a card: letters keep theirs, and
    can be read.
    """
    figure.set_layout_engine("none")
    figure.set_size_inches(*CARD_INCHES)
    ax = figure.axes[min(which, len(figure.axes) - 1)]
    for other in (*figure.axes, *figure.texts, *figure.legends):
        other.set_visible(other is ax)
    if ax.get_legend() is not None:
        ax.get_legend().remove()
    ax.set_position((0.2, 0.19, 0.76, 0.66))
    title, label = (
        textwrap.fill(text, letters, max_lines=2, placeholder=" ...")
        for text, letters in ((ax.get_title(), CARD_LETTERS), (ax.get_ylabel(), CARD_LETTERS // 2))
    )
    ax.set_title(title, fontsize="medium")
    ax.set_ylabel(label)
    ax.tick_params(which="both", labelbottom=True, labelleft=True)
    figure.savefig(path, dpi=THUMBNAIL[0] / CARD_INCHES[0])


def settings() -> dict[str, Any]:
    """The settings of Sphinx-Gallery."""
    missing = "".join(f"(?!{name})" for name in WHERE if lacks_records(name))
    return {
        "examples_dirs": str(EXAMPLES),
        "gallery_dirs": HERE,
        "filename_pattern": rf"{re.escape(os.sep)}{missing}\d\d_",
        "within_subsection_order": "FileNameSortKey",
        "backreferences_dir": "generated/backreferences",
        "doc_module": ("nlfrf", "robust"),
        "image_scrapers": ("docs.gallery.saved_pictures",),
        "reset_argv": "docs.gallery.script_arguments",
        "reset_modules": (),
        "show_signature": False,
        "thumbnail_size": THUMBNAIL,
        "first_notebook_cell": (
            "# The options of the script keep their defaults here.\nimport sys\n\nsys.argv[1:] = []"
        ),
    }


def made_from(name: str) -> str:
    """A digest of everything that the output of an example depends on."""
    digest = hashlib.sha256()
    modules = [
        path for package in ("nlfrf", "robust") for path in sorted((ROOT / package).rglob("*.*"))
    ]
    kept = [path for path in modules if path.suffix in (".py", ".json", ".jinja", ".js")]
    for path in [EXAMPLES / f"{name}.py", *kept]:
        digest.update(path.read_bytes())
    digest.update(str(CARDS.get(name)).encode())
    installed = [f"{package} {version(package)}" for package in STANDS_ON]
    found = [str(data_folder().is_dir()), str(shutil.which("octave") is not None)]
    digest.update(" ".join([platform.python_version(), *installed, *found]).encode())
    return digest.hexdigest()


def outputs(name: str) -> Path:
    """The folder with what an example wrote; runs it where that is not up to date."""
    folder, stamp = BUILD / name, BUILD / f"{name}.stamp"
    BUILD.mkdir(parents=True, exist_ok=True)
    with only_one(BUILD / f"{name}.lock"):
        wanted = made_from(name)
        if not (
            stamp.is_file() and stamp.read_text() == wanted and (PAGES / f"{name}.rst").is_file()
        ):
            stamp.unlink(missing_ok=True)
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            run(name)
            stamp.write_text(wanted)
    return STORED / name if lacks_records(name) else folder


def printed(name: str) -> str:
    """What an example printed, as its page shows it."""
    folder = outputs(name)
    if lacks_records(name):
        return (folder / "printed.txt").read_text(encoding="utf-8")
    page = (PAGES / f"{name}.rst").read_text(encoding="utf-8")
    return "".join(textwrap.dedent(block).rstrip("\n") + "\n" for block in PRINTED.findall(page))


@contextlib.contextmanager
def only_one(lock: Path):
    """Hold a lock file, so that two processes do not run the same example; waits where files can be
    locked.
    """
    with lock.open("w") as file:
        with contextlib.suppress(ImportError):
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def run(name: str) -> None:
    """Have Sphinx-Gallery run an example and write its page, with warnings as errors."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    from sphinx_gallery.gen_gallery import _fill_gallery_conf_defaults
    from sphinx_gallery.gen_rst import generate_file_rst
    from sphinx_gallery.utils import scale_image

    PAGES.mkdir(parents=True, exist_ok=True)
    for old in (
        *PAGES.glob(f"{name}.*"),
        *PAGES.glob(f"images/sphx_glr_{name}_*"),
        BUILD / f"{name}.card.png",
    ):
        old.unlink(missing_ok=True)
    conf = _fill_gallery_conf_defaults(settings())
    conf |= {"src_dir": str(ROOT / "docs"), "default_role": "code", "builder_name": "html"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # what python-control is told by a newer NumPy
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"control\.")
        done = generate_file_rst(f"{name}.py", PAGES, EXAMPLES, conf)[-1]
    plt.close("all")
    if "formatted_exception" in done:
        (PAGES / f"{name}.py.md5").unlink(missing_ok=True)
        raise RuntimeError(f"{name} ended with\n{done['formatted_exception']}")
    card = (
        BUILD / f"{name}.card.png"
        if not lacks_records(name)
        else next((STORED / name).glob("*.png"))
    )
    if card.is_file():
        scale_image(
            card, PAGES / "images" / "thumb" / f"sphx_glr_{name}_thumb.png", *conf["thumbnail_size"]
        )


def show_stored_outputs(app: Any, page: str, source: list[str]) -> None:
    """Where the records of an example are missing, add to its page what it gave where they were."""
    name = page.removeprefix(f"{HERE}/")
    if name in WHERE and page != name and lacks_records(name):
        note = (
            "The records are not part of this project, and were not there when this page was"
            f" built: here stands what the example drew and printed where they were. {WHERE[name]}"
            " and give the folder above it by ``--data`` or in ``NLFRF_DATA``."
        )
        rows = ["", "What it printed and drew", "------------------------", "", note, ""]
        rows += [
            f".. image:: /_static/{name}/{path.name}\n"
            for path in sorted((STORED / name).glob("*.png"))
        ]
        source[0] += "\n".join(
            [*rows, f".. literalinclude:: /_static/{name}/printed.txt", "   :language: none", ""]
        )


if __name__ == "__main__":
    for one in names():
        begin = time.perf_counter()
        outputs(one)
        print(f"{one}: {time.perf_counter() - begin:.1f} s")
