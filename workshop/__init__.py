"""How the sets, the constants and the tables of FCLIB were made. Nothing of it is installed.

sets     the published states and the lists of chosen problems
tuning   the table of `auto`, constants of methods, and notes on what was tried
tables   the tables of docs/results/

Run a script from the root of the repository: `.venv/bin/python -m workshop.tables.batch`.
"""
