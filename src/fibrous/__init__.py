"""Fibre networks of soft tissue, and the continuum laws that stand in for them."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fibrous.prediction import predict as predict


def __getattr__(name: str) -> Any:
    # Imported on demand: what this file imports would count as code of every stage of the study.
    if name == "predict":
        from fibrous.prediction import predict

        return predict
    raise AttributeError(f"module 'fibrous' has no attribute '{name}'")
