"""The command line: parse, call `api`, print. A command imports what it needs when it runs, so that help is fast."""
