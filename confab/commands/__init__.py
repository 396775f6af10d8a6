"""The functions of the commands that `confab.cli` lists, in a module for each purpose."""
