"""Hokuyo laser over SCIP 2."""
