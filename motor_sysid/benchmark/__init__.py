"""How often the diagnosis is right: an independent simulator, many cases, and tables."""
