"""The command line: one or two files per group of commands, imported when one is called."""
