"""One page for what a command found: a file that needs no other, and asks no network."""
