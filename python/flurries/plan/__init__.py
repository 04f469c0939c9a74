"""What a scene needs and what it costs, before anything is rendered."""

from flurries.plan.estimate import plan_of
from flurries.plan.report import Plan, PlannedStep

__all__ = ["Plan", "PlannedStep", "plan_of"]
