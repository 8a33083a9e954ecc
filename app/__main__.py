"""``python -m app`` is the console command without installing it."""

from app.cli import main

if __name__ == "__main__":
    main()
