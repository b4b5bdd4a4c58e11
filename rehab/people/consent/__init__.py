"""Consents of patients, and tombstones of those who were erased."""
