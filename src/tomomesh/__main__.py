"""The program's first lines: they know what Ctrl-C is before anything else is imported."""


def main() -> int:
    """Run ``tomomesh``: quiet when it is stopped while it still starts, and about what only its authors can mend."""
    try:
        import sys
        import warnings

        from tomomesh.cli import main as run

        if not sys.warnoptions:
            warnings.simplefilter("ignore")
        return run()
    except KeyboardInterrupt:
        return 130
    except RuntimeError as fault:  # Python before 3.12 wraps what is raised while a class is made
        if isinstance(fault.__cause__, KeyboardInterrupt):
            return 130
        raise


if __name__ == "__main__":
    raise SystemExit(main())
