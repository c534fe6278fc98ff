"""Schedules of a cell by method, their certificates, their execution and their audit."""

from __future__ import annotations

from armtempo.planners.schedules._audit import ENGINES, Audit, Engine, audit_clearance, default_engine
from armtempo.planners.schedules._certificate import ScheduleCertificate
from armtempo.planners.schedules._clairvoyant import clairvoyant
from armtempo.planners.schedules._execution import Execution, PrecedenceExecution, ScheduleExecution
from armtempo.planners.schedules._methods import METHODS, SHAPED, SHIFTED, schedule
from armtempo.planners.schedules._schedule import Schedule
from armtempo.planners.schedules._vci_execution import VciExecution, execution_of

__all__ = [
    "Audit",
    "ENGINES",
    "Engine",
    "Execution",
    "METHODS",
    "SHAPED",
    "SHIFTED",
    "PrecedenceExecution",
    "Schedule",
    "ScheduleCertificate",
    "ScheduleExecution",
    "VciExecution",
    "audit_clearance",
    "clairvoyant",
    "default_engine",
    "execution_of",
    "schedule",
]
