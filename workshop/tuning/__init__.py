"""What chose the stages of `auto` and constants of methods; notes.md has what was tried."""
