"""REXS, the Reusable Engineering EXchange Standard of gearboxes (https://www.rexs.info): files to jobs and back."""

from .job import RexsJob, rexs_job
from .model import Attribute, Component, Model, Relation
from .read import read_rexs
from .write import write_rexs

__all__ = ["Attribute", "Component", "Model", "Relation", "RexsJob", "read_rexs", "rexs_job", "write_rexs"]
