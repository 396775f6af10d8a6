"""The command line as a module: ``python -m confab plan SCENE``."""

from confab.start import main

if __name__ == "__main__":
    main()
