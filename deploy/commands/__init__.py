"""The command line: one or two files for each group of commands, imported when one is called."""
