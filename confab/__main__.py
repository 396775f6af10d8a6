"""The command line, run as a module by ``python -m confab plan SCENE``."""

from confab.start import main

if __name__ == "__main__":
    main()
