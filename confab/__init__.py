"""Front desk: what a notebook imports, the command line, displays and reports."""
