"""Tables in texts that instruments, spreadsheets and scripts write.

A text is divided into blocks, each with its names, units and rows of cells (`read_blocks`); what
the columns are is for those to say who know the quantity: decays, curves, matrices.
"""

from labrig.text_table.blocks import EXPECTED, Block, read_blocks
from labrig.text_table.encoding import read_table_text
from labrig.text_table.header import is_axis_line
from labrig.text_table.numbers import DECIMAL_MARKS, exact_number, is_clock, parse_number
from labrig.text_table.style import SEPARATORS, Line, Style
from labrig.text_table.written_table import cell_text, plain_text, table_text

__all__ = [
    "DECIMAL_MARKS",
    "EXPECTED",
    "SEPARATORS",
    "Block",
    "Line",
    "Style",
    "cell_text",
    "exact_number",
    "is_axis_line",
    "is_clock",
    "parse_number",
    "plain_text",
    "read_blocks",
    "read_table_text",
    "table_text",
]
