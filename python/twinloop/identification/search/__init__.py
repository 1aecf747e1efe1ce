"""Search: which terms drive each chain, by description length on whitened readings."""
