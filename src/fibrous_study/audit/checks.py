"""All checks of statements: importing the modules that hold them enters them."""

from fibrous_study.audit import constants, costs, curves, example, laws, table_1, tissue  # noqa: F401
from fibrous_study.audit.verdict import CHECKS

__all__ = ["CHECKS"]
