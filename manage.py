#!/usr/bin/env python
"""Run GARRY's management commands: `serve`, `runsession`, `migrate`, …"""

from garry_site.__main__ import main

if __name__ == "__main__":
    main()
