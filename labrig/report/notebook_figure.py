"""Figure of matplotlib that a notebook shows by itself, without pyplot."""

from io import StringIO

from matplotlib.figure import Figure

from labrig.report.figure_style import figure_style


class NotebookFigure(Figure):
    """Figure that is shown as SVG, with the text as text."""

    def _repr_svg_(self) -> str:
        text = StringIO()
        with figure_style():
            self.savefig(text, format="svg", facecolor="white", metadata={"Date": None})
        return text.getvalue()
