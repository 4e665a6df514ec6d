"""Makes what is shown of the gallery: the table of README.md, the montage and the notebook.

The numbers are those that the examples have left in a folder: ``python cart_pole.py out`` and so on, then
``python make_gallery.py out``. The notebook is executed (needs nbclient, nbformat and ipykernel).
"""

import argparse
import importlib
import json
from pathlib import Path

import compare

HERE = Path(__file__).parent
IMAGE = HERE.parent.parent / "docs" / "images" / "gallery.png"
EXAMPLES = [
    "cart_pole", "furuta", "balancer", "arm_pendulum", "quadrotor", "race_car", "cstr", "four_tanks",
    "aircraft",
]  # fmt: skip
BEGIN, END = "<!-- table: made by make_gallery.py -->\n", "<!-- end of the table -->\n"


def table(folder: Path) -> str:
    """The table of all examples as Markdown."""
    lines = [
        "| plant | states, inputs, horizon | starts | within 1 % | cost ratio: median | worst | largest excess "
        "(IPOPT's) | ours, median (99 %) [ms] | IPOPT [ms] | do-mpc [ms] | do-mpc / ours |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name in EXAMPLES:
        found = json.loads((folder / f"{name}.json").read_text())
        rows = found["rows"]
        ratios = sorted(row["ratio"] for row in rows)
        worst, first = max(rows, key=lambda row: row["ratio"]), rows[0]
        lines.append(
            f"| [{found['title']}]({name}.py) | {found['states']}, {found['inputs']}, {found['horizon']} | "
            f"{len(rows)} | {sum(ratio <= 1.01 for ratio in ratios)} | {ratios[len(ratios) // 2]:.4f} | "
            f"{worst['ratio']:.4f} ({worst['start']}) | {max(row['excess'] for row in rows):.1e} "
            f"({max(row['excess_ipopt'] for row in rows):.1e}) | {first['median']:.3f} ({first['most']:.2f}) "
            f"| {first['median_ipopt']:.0f} | {found['do_mpc'][0]:.0f} | "
            f"{found['do_mpc'][0] / first['median']:.0f} |"
        )
    return "\n".join(lines) + "\n"


def montage() -> None:
    """The first run of each example: its path, or its first signal."""
    from matplotlib import pyplot

    whole = pyplot.figure(figsize=(11.0, 6.6), layout="constrained")
    for name, place in zip(EXAMPLES, whole.subfigures(3, 3, wspace=0.03, hspace=0.05).flat):
        example = importlib.import_module(name).example()
        run = compare.our_run(example, example.starts[0])
        if example.path is not None:
            example.path(place.subplots(), run)
        else:
            run.plot(example.show[:1], figure=place)
        place.suptitle(example.title, fontsize="medium")
    whole.savefig(IMAGE, dpi=110)


def notebook() -> None:
    """The first run of each example, as a notebook with its outputs."""
    import nbclient
    import nbformat

    cell = nbformat.v4
    cells = [
        cell.new_markdown_cell(
            "# Gallery\n\nOne closed loop of each plant; [README.md](README.md) has the comparison with converged "
            "nonlinear MPC. Made by `make_gallery.py` from the examples beside it."
        ),
        cell.new_code_cell(
            "import numpy as np\nfrom matplotlib import pyplot\n\nimport compare\nfrom figures import figure\n\n"
            'pyplot.rcParams["figure.dpi"] = 60'
        ),
    ]
    for name in EXAMPLES:
        document = importlib.import_module(name).__doc__.strip()
        headline, _, rest = document.partition("\n")
        cells.append(cell.new_markdown_cell(f"## {headline}\n{rest}"))
        cells.append(
            cell.new_code_cell(
                f"import {name}\n\nexample = {name}.example()\nrun = compare.our_run(example, example.starts[0])\n"
                'print(run, run.is_solved, f"{1e6 * np.median(run.step_times):.0f} us per step")\n'
                "figure(example, run);"
            )
        )
    made = cell.new_notebook(cells=cells)
    for i, one in enumerate(made.cells):
        one.id = f"cell-{i}"
    nbclient.NotebookClient(made, kernel_name="python3", resources={"metadata": {"path": HERE}}).execute()
    for one in made.cells:
        one.metadata = {}
    made.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    nbformat.write(made, HERE / "gallery.ipynb")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="where the examples have left their tables")
    folder = parser.parse_args().folder
    page = HERE / "README.md"
    before, _, rest = page.read_text().partition(BEGIN)
    page.write_text(before + BEGIN + "\n" + table(folder) + "\n" + END + rest.partition(END)[2])
    montage()
    notebook()


if __name__ == "__main__":
    main()
