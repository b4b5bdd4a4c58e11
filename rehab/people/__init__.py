"""Clinics, accounts, patients, and who may see what."""
