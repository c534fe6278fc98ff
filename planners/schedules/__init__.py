"""Schedules of a cell by method, their certificates, their execution and their audit."""
