"""Flight logs: read any kind we know, say what is wrong with one, mend it."""
