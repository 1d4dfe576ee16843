"""Reports: tables and pages of any result documents."""
