"""A dataset judged before anybody identifies from it."""
