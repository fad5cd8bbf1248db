"""Tables in texts that instruments, spreadsheets and scripts write.

A text is divided into blocks, each with its names, units and rows of cells (`read_blocks`); what
the columns are is for those to say who know the quantity: decays, curves, matrices.

Names are listed in `__init__.pyi`, and loaded when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
