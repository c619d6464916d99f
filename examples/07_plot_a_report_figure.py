"""Plot two figures of a session's report as you want them: φ with its ellipses, and convergence.

python examples/07_plot_a_report_figure.py [--session FOLDER] [--output FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from matplotlib.figure import Figure

import handcal
from handcal.cli.terminal import errors_in_one_line
from handcal.export.figures import draw_convergence, draw_ellipses

EXAMPLE = Path(__file__).parents[1] / "resources/example_session"


def main() -> None:
    """Draw two of the report's figures into axes made here, and save them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--session", type=Path, default=EXAMPLE, help="session folder")
    parser.add_argument(
        "--output", type=Path, default=Path("results/figure.png"), help="PNG, SVG or PDF"
    )
    arguments = parser.parse_args()

    session = handcal.open_session(arguments.session)
    results = handcal.solve(session)

    # `Figure` draws without a window; in a notebook, plt.subplots() does as well.
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    above, below = figure.subplots(nrows=2, ncols=2)
    draw_ellipses(axes=above, results=results)
    draw_convergence(axes=below, results=results)
    figure.suptitle(f"{session.path.name}: {results.method}")

    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.output, dpi=150)
    print(f"Written: {arguments.output}")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
