"""The tdint command line."""


def start() -> None:
    """Run the installed command.

    A signal during the loading of modules ends the process without a message.
    """
    import gc
    import os

    # Loading modules creates few cycles. A collection per 700 new objects, the default, would take
    # 2 % of the time of a short command.
    gc.set_threshold(50_000)
    # Until the handlers are set, Ctrl-C raises KeyboardInterrupt, also while `signal` is imported.
    try:
        import signal

        # Replace only the default handlers; another handler was set on purpose (`nohup`). Some
        # systems do not have all signals.
        defaults = (signal.SIG_DFL, signal.default_int_handler)
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGXCPU"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) in defaults:
                # Shells report a process that a signal ended with 128 plus the signal number.
                signal.signal(number, lambda received, _: os._exit(128 + received))
    except KeyboardInterrupt:
        os._exit(130)
    from tdint_cli.main import main

    main()
