"""How commands end."""

DONE, VERDICT_FAILED, WRONG_INPUT = 0, 1, 2
# As a shell says it of a command that was interrupted.
INTERRUPTED = 130
