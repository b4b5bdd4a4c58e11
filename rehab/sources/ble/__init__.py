"""Sensors by Bluetooth Low Energy: what each kind sends, and the source that reads them."""
