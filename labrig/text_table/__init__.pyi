from .blocks import (
    EXPECTED as EXPECTED,
    Block as Block,
    read_blocks as read_blocks,
)
from .encoding import read_table_text as read_table_text
from .header import is_axis_line as is_axis_line
from .numbers import (
    DECIMAL_MARKS as DECIMAL_MARKS,
    exact_number as exact_number,
    is_clock as is_clock,
    parse_number as parse_number,
)
from .style import (
    SEPARATORS as SEPARATORS,
    Line as Line,
    Style as Style,
)
from .written_table import (
    cell_text as cell_text,
    plain_text as plain_text,
    table_text as table_text,
)
