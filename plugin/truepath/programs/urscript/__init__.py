"""URScript: parse, resolve, rewrite; every byte that is no target stays."""
