"""The functions of the commands, in a module for each purpose; `confab.cli` lists the commands."""
