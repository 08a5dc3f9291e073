"""The tdint command line."""


def start() -> None:
    """Entry point of the installed command: until all is loaded that ends it with a word, a signal
    ends it without."""
    import os

    # A signal during the import of `signal` itself still has Python's handler.
    try:
        import signal

        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) in (
                signal.SIG_DFL,
                signal.default_int_handler,
            ):
                signal.signal(number, lambda ended, _: os._exit(128 + ended))
    except KeyboardInterrupt:
        os._exit(130)
    from tdint_cli.main import main

    main()
