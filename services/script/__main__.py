"""``python -P -m services.script [options] FILE [arguments of the script]``."""

from services.script.command_line import main

if __name__ == "__main__":
    main()
